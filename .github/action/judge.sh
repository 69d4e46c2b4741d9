#!/usr/bin/env bash
# A step of action.yml: runs or merges, verifies goldens, compares with the base and writes reports. It ends with 0
# where it came to a verdict of any kind; the last step of the action says what that means.
# Reads SUITE, MERGE, ARGS, RENDERER, SHARD, BASE, GOLDENS, OUT, REPORTS and FAIL_ON.
set -euo pipefail

fail() {
    echo "::error title=aogauge::$1" >&2
    exit 1
}

# The worse of two exit codes, in the order of aogauge; the second is one that this gave.
worse() {
    local code
    case $1 in
        [0-6]) ;;
        *) fail "aogauge ended with $1: it was ended from outside, or it has a bug" ;;
    esac
    for code in 2 4 5 3 1 6 0; do
        if [ "$1" = "$code" ] || [ "$2" = "$code" ]; then
            echo "$code"
            return
        fi
    done
}

# A wrong word is found before an hour of rendering, not after.
for word in ${FAIL_ON//,/ }; do
    case $word in
        failed | golden | nothing | incomplete | inconclusive | never) ;;
        *) fail "fail-on: '$word' is none of failed, golden, nothing, incomplete, inconclusive, never" ;;
    esac
done
for format in ${REPORTS//,/ }; do
    case $format in
        markdown | github | html | junit | json) ;;
        *) fail "reports: '$format' is none of github, html, junit, json, markdown" ;;
    esac
done
case $OUT in
    '' | / | . | .. | *$'\n'*) fail "out: give a folder of its own for the record" ;;
esac

args=()
while [ "${ARGS%$'\n'}" != "$ARGS" ]; do ARGS=${ARGS%$'\n'}; done
case $ARGS in
    *$'\n'*) while IFS= read -r line; do [ -z "$line" ] || args+=("$line"); done <<< "$ARGS" ;;
    *) read -r -a args <<< "$ARGS" ;;
esac

# Where a base was asked for and is not there, gates against it are left out on purpose.
no_base=
if [ -n "$BASE" ]; then
    no_base=--no-base
    if [ ! -f "$BASE/record.json" ]; then
        echo "::notice title=aogauge::there is no record in $BASE: nothing is compared"
        BASE=
    elif ! aogauge explain -- "$BASE" > /dev/null; then
        # As after a new version of aogauge; no fault of the change.
        echo "::warning title=aogauge::the record in $BASE cannot be read: nothing is compared"
        BASE=
    else
        no_base=
    fi
fi

# Options are joined with their values and names come after --, so that none is taken for an option.
if [ -n "$MERGE" ]; then
    command=(aogauge merge "--out=$OUT")
else
    command=(aogauge run "--out=$OUT" "--renderer=$RENDERER")
    [ -z "$SHARD" ] || command+=("--shard=$SHARD")
fi
[ -z "$BASE" ] || [ -n "$SHARD" ] || command+=("--base=$BASE")
[ -z "$no_base" ] || command+=("$no_base")
command+=(${args[@]+"${args[@]}"} -- "${MERGE:-$SUITE}")
code=0
"${command[@]}" || code=$?
code=$(worse "$code" 0) || exit 1

record='' report='' changes=''
if [ "$code" != 2 ] && [ "$code" != 4 ] && [ -f "$OUT/record.json" ]; then
    record=$OUT
    more=0
    [ -z "$GOLDENS" ] || aogauge golden verify "--goldens=$GOLDENS" -- "$OUT" || more=$?
    code=$(worse "$more" "$code") || exit 1
    if [ -n "$BASE" ]; then
        more=0
        aogauge compare --format=markdown -- "$BASE" "$OUT" > "$OUT/changes.md" || more=$?
        if [ "$more" = 2 ]; then
            echo "::warning title=aogauge::the record in $BASE cannot be compared with"
            rm "$OUT/changes.md"
        else
            changes=$OUT/changes.md
            code=$(worse "$more" "$code") || exit 1
            # A summary of more than 1 MiB is dropped whole.
            head -c 500000 "$changes" >> "$GITHUB_STEP_SUMMARY"
        fi
    fi
    for format in ${REPORTS//,/ }; do
        more=0
        case $format in
            json) aogauge report --format=json -- "$OUT" > "$OUT/report.json" || more=$? ;;
            *) aogauge report "--format=$format" -- "$OUT" || more=$? ;;
        esac
        # A report that cannot be made (2) hides a verdict, so the step is red; the record and its path are there.
        code=$(worse "$more" "$code") || exit 1
    done
    for file in report.html report.md; do
        if [ -f "$OUT/$file" ]; then
            report=$OUT/$file
            break
        fi
    done
fi

words=(pass failed usage golden nothing incomplete inconclusive)
{
    echo "exit-code=$code"
    echo "verdict=${words[$code]}"
    echo "record=$record"
    echo "report=$report"
    echo "changes=$changes"
} >> "$GITHUB_OUTPUT"
