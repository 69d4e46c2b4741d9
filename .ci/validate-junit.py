"""validate-junit.py AOGAUGE RECORD WORK XSD...: the test report of a record, and of what can become of it, must validate
against each schema, and hold a failure or an error exactly where the run does not pass."""

import copy
import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import xmlschema

aogauge, record, work, *schemas = sys.argv[1:]
record = json.loads((Path(record) / "record.json").read_text())
work = Path(work)
hostile = "a|b`c\n::error::x <s>]]>&amp;\"'\u001b[31m\u0000\ufffe\uffff\u202e\U0001f642 --> <![CDATA[ ]]>"


def outcome(kind):
    def change(r):
        r["verdicts"][0] |= {"outcome": kind, "reason": hostile, "gate": hostile}
        r["suite"]["name"] = r["machine"]["gpu"] = hostile

    return change


def error(r):
    r["cases"][0]["error"] = r["scenes"][0]["judge_error"] = r["incomplete"] = hostile


def idle(excused):
    return lambda r: r["idle_gates"].append({"gate": hostile, "reason": hostile, "excused": excused})


def empty(r):
    r["verdicts"], r["idle_gates"] = [], []


def long(r):
    r["timing"]["judges"] = {s["name"]: 12_345_678.9 for s in r["scenes"]}


changes = {"as it is": lambda r: None, "error": error, "idle": idle(False), "excused": idle(True), "no gates": empty, "long": long}
changes |= {kind: outcome(kind) for kind in ["fail", "inconclusive", "warn", "known-failure", "pass"]}
wrong = 0
for name, change in changes.items():
    changed = copy.deepcopy(record)
    change(changed)
    work.mkdir(exist_ok=True)
    (work / "record.json").write_text(json.dumps(changed))
    code = subprocess.run([aogauge, "report", work, "--format", "junit", "--gate"], stderr=subprocess.DEVNULL).returncode
    file = work / "junit.xml"
    root = ET.parse(file).getroot()
    red = int(root.get("failures")) + int(root.get("errors"))
    faults = [f"exit code {code}, {red} failures and errors"] if (code != 0) != (red > 0) else []
    for schema in schemas:
        faults += [f"{e.path}: {e.reason}" for e in xmlschema.XMLSchema(schema).iter_errors(str(file))]
    print(f"{name}: exit code {code}, {len(root.findall('.//testcase'))} tests, {red} failures and errors; {len(faults)} faults")
    print("".join(f"  {f}\n" for f in faults), end="")
    wrong += len(faults)
print(f"against {len(schemas)} schemas")
sys.exit(wrong > 0)
