"""Writes every `run:` of workflows and actions to a file of its own, for shellcheck.

    scripts-of.py FOLDER FILE...

Needs ruamel.yaml.
"""

import pathlib
import sys

from ruamel.yaml import YAML

folder = pathlib.Path(sys.argv[1])
folder.mkdir()
count = 0
for name in sys.argv[2:]:
    file = YAML(typ="safe").load(pathlib.Path(name))
    jobs = file["jobs"].values() if "jobs" in file else [file["runs"]]
    for step in (step for job in jobs for step in job["steps"]):
        if "run" not in step:
            continue
        # A script that holds an expression would run what stands in it.
        assert "${{" not in step["run"], (name, step)
        count += 1
        (folder / f"{count}.sh").write_text("#!/usr/bin/env bash\nset -eo pipefail\n" + step["run"])
