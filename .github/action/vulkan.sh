#!/usr/bin/env bash
# A step of action.yml: installs Mesa's software Vulkan driver where there is no adapter. Without one the CPU renders
# alone, so what goes wrong here is told and is no error.
set -euo pipefail
has_adapter() { aogauge doctor --format json | grep -q '"gpu": "'; }
warn() { echo "::warning title=aogauge::no Vulkan driver is installed ($1): the CPU renders alone"; }

! has_adapter || exit 0
as_root=()
[ "$(id -u)" = 0 ] || as_root=(sudo -n)
if ! command -v apt-get > /dev/null; then
    warn "there is no apt-get; install your system's, or set software-vulkan to false"
elif ! "${as_root[@]}" apt-get update -q ||
    ! "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -q -y --no-install-recommends mesa-vulkan-drivers libvulkan1; then
    warn "apt-get failed"
fi
