"""Runs the steps of action.yml as a runner would, on this machine, and holds what comes of them.

    try-action.py AOGAUGE WORK

Shell steps run for real, with their `env` and `if` evaluated; steps that use another action are told, and the cache is
played. Releases come from a folder, through the same script. Needs ruamel.yaml.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

from ruamel.yaml import YAML

ROOT = pathlib.Path(__file__).resolve().parent.parent
ACTION = YAML(typ="safe").load(ROOT / "action.yml")
AOGAUGE, WORK = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
TARGET = "x86_64-unknown-linux-gnu"
TOKEN = re.compile(r"\s*('(?:[^']|'')*'|true|false|&&|\|\||==|!=|!|\(|\)|[a-z][\w.-]*)")


def evaluate(expression, contexts, is_cancelled=False):
    """The part of GitHub's expressions that action.yml uses."""
    python = []
    at = 0
    while at < len(expression.rstrip()):
        found = TOKEN.match(expression, at)
        assert found, f"an expression that this script does not know: {expression}"
        at, token = found.end(), found[1]
        if token in ("(", ")", "==", "!="):
            python.append(token)
        elif token in ("&&", "||", "!", "true", "false"):
            python.append({"&&": " and ", "||": " or ", "!": " not "}.get(token, f" {token.title()} "))
        elif token.startswith("'"):
            python.append(repr(token[1:-1].replace("''", "'")))
        elif token == "cancelled":
            python.append(f"(lambda: {is_cancelled})")
        else:
            value = contexts
            for part in token.split("."):
                value = value.get(part, "") if isinstance(value, dict) else ""
            python.append(repr(value))
    return eval("".join(python), {})  # made of nothing but the tokens above


def filled(text, contexts):
    def word(value):
        return {True: "true", False: "false"}.get(value, value) if isinstance(value, bool) else str(value)

    return re.sub(r"\$\{\{(.*?)\}\}", lambda m: word(evaluate(m[1], contexts)), str(text))


def pairs(path):
    """What a step wrote to GITHUB_OUTPUT."""
    return dict(line.split("=", 1) for line in path.read_text().splitlines())


class Run:
    """One use of the action in a job of its own."""

    def __init__(self, name, inputs, ref="v0.1", repository="OWNER/aogauge", built_before=False, workspace=None, env=None):
        self.temp = WORK / "action" / name
        self.temp.mkdir(parents=True)
        self.workspace = workspace or self.temp / "workspace"
        self.workspace.mkdir(exist_ok=True)
        unknown = set(inputs) - set(ACTION["inputs"])
        assert not unknown, unknown
        values = {k: str(inputs.get(k, v["default"])) for k, v in ACTION["inputs"].items()}
        self.contexts = {
            "inputs": values,
            "github": {"action_ref": ref, "action_repository": repository},
            "runner": {"os": "Linux", "temp": str(self.temp)},
            "steps": {},
        }
        self.environment = {
            **os.environ, "GITHUB_ACTION_PATH": str(ROOT), "GITHUB_SERVER_URL": f"file://{WORK}/server", "RUNNER_OS": "Linux",
            "RUNNER_ARCH": "X64", "RUNNER_TEMP": str(self.temp), "GITHUB_STEP_SUMMARY": str(self.temp / "summary"),
            "XDG_CACHE_HOME": str(WORK / "cache"), **(env or {}),
        }
        self.log, self.used, self.ran, self.code = "", {}, [], 0
        (self.temp / "summary").touch()
        for step in ACTION["runs"]["steps"]:
            self.step(step, built_before)
        self.outputs = {k: filled(v["value"], self.contexts) for k, v in ACTION["outputs"].items()}

    def step(self, step, built_before):
        condition = str(step.get("if", "")).removeprefix("${{").removesuffix("}}")
        # A step without a status function is skipped after one that failed.
        if self.code and "cancelled()" not in condition:
            return
        if condition and not evaluate(condition, self.contexts):
            return
        outputs = {}
        if "uses" in step:
            given = {k: filled(v, self.contexts) for k, v in step["with"].items()}
            self.used[step["uses"].split("@")[0]] = given
            if step["uses"].startswith("actions/cache@") and built_before:
                shutil.copy(AOGAUGE, given["path"])
                outputs["cache-hit"] = "true"
        else:
            self.ran.append(step["name"])
            out, path = self.temp / "output", self.temp / "path"
            for file in (out, path):
                file.write_text("")
            env = {**self.environment, "GITHUB_OUTPUT": str(out), "GITHUB_PATH": str(path)}
            env |= {k: filled(v, self.contexts) for k, v in step.get("env", {}).items()}
            command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", filled(step["run"], self.contexts)]
            done = subprocess.run(command, cwd=self.workspace, env=env, text=True, capture_output=True)
            self.log += done.stdout + done.stderr
            self.code = self.code or done.returncode
            outputs = pairs(out)
            for line in path.read_text().splitlines():
                self.environment["PATH"] = f"{line}:{self.environment['PATH']}"
        if "id" in step:
            self.contexts["steps"][step["id"]] = {"outputs": outputs}

    def expect(self, code, verdict, *says):
        assert (self.code, self.outputs["verdict"]) == (code, verdict), (self.code, self.outputs, self.log)
        for text in says:
            assert text in self.log, (text, self.log)
        return self


def release(tag="v0.1.0"):
    """A release as release.yml makes it, in a folder that stands for GitHub's."""
    folder = WORK / "server/OWNER/aogauge/releases/download" / tag
    folder.mkdir(parents=True)
    subprocess.run([ROOT / ".ci/archive", TARGET, AOGAUGE], check=True, capture_output=True)
    archive = folder / f"aogauge-{tag}-{TARGET}.tar.gz"
    shutil.move(ROOT / "dist" / archive.name, archive)
    with open(folder / "SHA256SUMS", "w") as sums:
        subprocess.run(["sha256sum", archive.name], cwd=folder, check=True, stdout=sums)
    return archive


def git(*arguments):
    command = ["git", "-c", "user.name=peers", "-c", "user.email=peers@localhost", *arguments]
    return subprocess.run(command, cwd=WORK / "server/OWNER/aogauge", check=True, text=True, capture_output=True).stdout


def suite(workspace, limit=None):
    """A suite of a second; with a limit on the contrast error of classic AO."""
    workspace.mkdir(parents=True, exist_ok=True)
    text = (ROOT / ".ci/tiny.toml").read_text()
    if limit is not None:
        text = text.split("[[gate]]")[0]
        text += f'[[gate]]\nname = "limit"\nmetric = "contrast-error"\nestimators = ["classic"]\nmax = {limit}\n'
    (workspace / "suite.toml").write_text(text)
    return workspace


def installs(archive):
    base = {"suite": "suite.toml", "renderer": "cpu", "args": "--no-cache"}
    run = Run("release", base, workspace=suite(WORK / "release"))
    run.expect(0, "pass", "aogauge 0.1.0")
    assert run.ran == ["Install the released program", "Judge", "Verdict"], run.ran
    kept = run.used["actions/upload-artifact"]
    assert (kept["path"], kept["include-hidden-files"], kept["name"]) == ("aogauge-record", "false", "aogauge-record")
    yield "the tag v0.1 installs the release, runs a suite and keeps its record"

    (WORK / "server/OWNER/aogauge/.gitignore").write_text("releases\n")
    git("init", "-q"), git("add", "."), git("commit", "-qm", "a release"), git("tag", "-am", "v0.1.0", "v0.1.0")
    commit = git("rev-parse", "HEAD").strip()
    run = Run("commit", base | {"suite": "smoke", "args": "--dry-run"}, ref=commit)
    assert "built from source" not in run.log and "aogauge 0.1.0" in run.log, run.log
    for name, ref in (("other-commit", "0" * 40), ("branch", "v0.1-next"), ("folder", "")):
        run = Run(name, base, ref=ref, repository="OWNER/aogauge" if ref else "", built_before=True, workspace=suite(WORK / name))
        run.expect(0, "pass", "built from source")
        assert run.used["actions/cache"]["key"].startswith("aogauge-Linux-X64-"), run.used
    yield "so does the commit of a release; another commit, a branch or a folder is built from source, once per source"

    run = Run("built", base | {"version": "source"}, workspace=suite(WORK / "built"), env={"CARGO_TARGET_DIR": str(ROOT / "target")})
    run.expect(0, "pass", "Installed package `aogauge")
    assert "Build the program" in run.ran
    yield "cargo install builds it from the action's folder"

    # A program that is killed, by a signal or for its memory, has no verdict.
    folder = WORK / "server/OWNER/aogauge/releases/download/v0.0.9"
    (folder / f"aogauge-v0.0.9-{TARGET}").mkdir(parents=True)
    program = folder / f"aogauge-v0.0.9-{TARGET}/aogauge"
    program.write_text('#!/bin/sh\n[ "$1" = --version ] || kill -KILL $$\n')
    program.chmod(0o755)
    name = f"{program.parent.name}.tar.gz"
    subprocess.run(f"tar -czf {name} {program.parent.name} && sha256sum {name} > SHA256SUMS", cwd=folder, shell=True, check=True)
    Run("killed", base | {"version": "0.0.9"}).expect(1, "", "aogauge ended with 137")
    yield "a program that is killed turns the job red"

    run = Run("none", base | {"version": "9.9.9"}).expect(1, "", "release v9.9.9 of OWNER/aogauge has no aogauge-v9.9.9")
    Run("no-version", base | {"version": "newest; true"}).expect(1, "", "is no release")
    whole = archive.read_bytes()
    archive.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    run = Run("changed", base, built_before=True).expect(1, "", "it is not installed")
    assert not list(run.temp.glob("**/aogauge")) and "actions/cache" not in run.used
    archive.write_bytes(whole)
    yield "a release that is not there, or whose checksum is another, ends the job and is not replaced by another program"


def judges():
    base = {"suite": "suite.toml", "renderer": "cpu", "args": "--no-cache"}
    for name, limit, code, verdict in (("red", 0.0, 1, "failed"), ("green", 1.0, 0, "pass")):
        run = Run(name, base, workspace=suite(WORK / name, limit)).expect(code, verdict)
        assert (run.workspace / run.outputs["record"] / "record.json").is_file() and "actions/upload-artifact" in run.used
        assert (run.workspace / run.outputs["report"]).is_file(), run.outputs
    Run("let", base | {"fail-on": "incomplete"}, workspace=suite(WORK / "red", 0.0)).expect(0, "failed", "fail-on lets through")
    Run("word", base | {"fail-on": "fail"}, workspace=suite(WORK / "red", 0.0)).expect(1, "", "'fail' is none of")
    Run("nothing", base | {"args": "--filter\nno such case\n"}, workspace=suite(WORK / "red")).expect(4, "nothing", "no such case")
    yield "red where a gate fails, unless fail-on lets it through; the record is kept either way"

    Run("no-golden", base | {"goldens": "goldens"}, workspace=suite(WORK / "green", 1.0)).expect(3, "golden")
    run = Run("first", base | {"base": "base"}, workspace=suite(WORK / "first")).expect(0, "pass", "nothing is compared")
    assert run.outputs["changes"] == ""
    shutil.copytree(WORK / "green/aogauge-record", WORK / "red/base")
    run = Run("compared", base | {"base": "base"}, workspace=suite(WORK / "red", 0.0)).expect(1, "failed")
    changes = (WORK / "red" / run.outputs["changes"]).read_text()
    assert changes in (run.temp / "summary").read_text() and "aogauge" in changes
    (WORK / "red/base/record.json").write_text("{}")
    Run("unreadable", base | {"base": "base"}, workspace=suite(WORK / "red", 0.0)).expect(1, "failed", "cannot be read")
    yield "goldens are verified, a base is compared with; a base that is missing or unreadable is told and is no fault"

    workspace = suite(WORK / "sharded")
    for shard in ("1/2", "2/2"):
        out = f"shards/{shard[0]}"
        run = Run(f"shard-{shard[0]}", base | {"shard": shard, "out": out}, workspace=workspace).expect(0, "pass")
        assert run.used["actions/upload-artifact"]["include-hidden-files"] == "true" and run.outputs["record"] == ""
    run = Run("merge", base | {"merge": "shards", "args": ""}, workspace=workspace).expect(0, "pass")
    assert (workspace / run.outputs["record"] / "record.json").is_file()
    yield "shards render, and a merge judges"


def is_no_shell():
    """Names that a pull request may choose."""
    names = ["$(touch pwned)", "`touch pwned`", "; touch pwned", "x' ; touch pwned #", '"; touch pwned; "', "--help", "-- --help"]
    for i, name in enumerate(names):
        base = {"suite": name, "args": name, "out": f"a{i}", "base": name, "goldens": name, "artifact": name}
        run = Run(f"hostile-{i}", base | {"renderer": "cpu"})
        assert run.code == (0 if name == "--help" else 2), (name, run.log)
        run = Run(f"hostile-suite-{i}", {"suite": name, "renderer": name if i < 5 else "cpu"})
        assert run.code == 2, (name, run.log)
        for option in ("version", "reports", "fail-on", "shard"):
            run = Run(f"hostile-{i}-{option}", {option: name, "suite": "nowhere.toml"})
            assert run.code, (name, option, run.log)
    assert not list(WORK.glob("**/pwned")) and not (ROOT / "pwned").exists()
    Run("newline", {"out": "a\nverdict=pass"}).expect(1, "", "give a folder of its own")
    yield f"{len(names)} names that are commands or options, in every input, run nothing"


def is_documented():
    page = (ROOT / "docs/ci.md").read_text()
    for name in [*ACTION["inputs"], *ACTION["outputs"]]:
        assert f"`{name}`" in page, f"docs/ci.md does not tell of {name}"
    for name, value in ACTION["inputs"].items():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
        told = row.split("|")[2].strip()
        assert told == (f"`{value['default']}`" if value["default"] else "") or name in ("fail-on", "version"), row
    yield "docs/ci.md tells of every input with its default, and of every output"


def main():
    archive = release()
    for part in (is_documented(), installs(archive), judges(), is_no_shell()):
        for line in part:
            print(line, flush=True)


if __name__ == "__main__":
    main()
