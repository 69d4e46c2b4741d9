#!/usr/bin/env bash
# The last step of action.yml: red or green. Reads CODE, VERDICT and FAIL_ON.
set -euo pipefail
[ "$CODE" != 0 ] || exit 0
is_red=
[ "$CODE" != 2 ] || is_red=yes
for word in ${FAIL_ON//,/ }; do
    [ "$word" != "$VERDICT" ] || is_red=yes
done
if [ -n "$is_red" ]; then
    echo "::error title=aogauge::$VERDICT: aogauge explain tells of the record why"
    exit "$CODE"
fi
echo "::warning title=aogauge::$VERDICT, which fail-on lets through"
