"""validate-schema.py SCHEMA FILE...: each file, JSON or TOML, must validate against the JSON Schema (2020-12)."""

import json
import sys
import tomllib
from pathlib import Path

from jsonschema import Draft202012Validator

schema, *files = map(Path, sys.argv[1:])
schema = json.loads(schema.read_text())
Draft202012Validator.check_schema(schema)
wrong = 0
for file in files:
    read = tomllib.loads if file.suffix == ".toml" else json.loads
    errors = [f"{e.json_path}: {e.message[:300]}" for e in Draft202012Validator(schema).iter_errors(read(file.read_text()))]
    print(f"{file.name}: {len(errors)} errors")
    print("".join(f"  {e}\n" for e in errors), end="")
    wrong += len(errors)
sys.exit(wrong > 0)
