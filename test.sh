#!/bin/sh
# Passes the tests on a fresh Debian machine with a Rust toolchain. The GPU tests
# need a Vulkan adapter; where there is none, Mesa's software driver is installed
# if apt and the rights are there, else this says what to install.
set -eu
cd "$(dirname "$0")"

missing() { ! ./target/release/aogauge doctor --format json | grep -q '"gpu": "'; }

if ! command -v cc >/dev/null; then
    echo "test.sh: no C linker: install one (on Debian: apt-get install gcc libc6-dev)" >&2
    exit 1
fi
cargo test --release --locked --workspace --no-run
if missing; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    if command -v apt-get >/dev/null && $as_root true 2>/dev/null; then
        echo "test.sh: no GPU adapter: installing Mesa's software Vulkan driver" >&2
        $as_root apt-get update -q
        DEBIAN_FRONTEND=noninteractive $as_root apt-get install -q -y --no-install-recommends \
            mesa-vulkan-drivers libvulkan1
    fi
    if missing; then
        echo "test.sh: no GPU adapter. Install a Vulkan driver; Mesa's software one will do" >&2
        echo "         (on Debian: apt-get install mesa-vulkan-drivers libvulkan1)" >&2
        exit 1
    fi
fi
exec cargo test --release --locked --workspace --no-fail-fast
