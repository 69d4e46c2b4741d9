#!/usr/bin/env bash
# A step of action.yml: builds the program from the action's own source.
set -euo pipefail
if ! command -v cargo > /dev/null; then
    echo "::error title=aogauge::there is no release for this runner, and no cargo to build one: install Rust before this step"
    exit 1
fi
# Outside the action's folder, which a self-hosted runner may share between jobs.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$RUNNER_TEMP/aogauge/target}"
cargo install --locked --no-track --path "$GITHUB_ACTION_PATH" --root "$RUNNER_TEMP/aogauge"
