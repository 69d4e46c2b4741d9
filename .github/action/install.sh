#!/usr/bin/env bash
# A step of action.yml: installs the released program for this runner, or says that it is to be built.
# Reads VERSION, ACTION_REPOSITORY and ACTION_REF beside what a runner sets.
set -euo pipefail

fail() {
    echo "::error title=aogauge::$1"
    exit 1
}

sha256() { # of a file, or of standard input
    if command -v sha256sum > /dev/null; then sha256sum "$@"; else shasum -a 256 "$@"; fi | cut -d ' ' -f 1
}

# Ends the step: the next ones build the program, unless the cache has one of the same source.
build() {
    echo "aogauge is built from source: $1"
    local source
    source=$(cd "$GITHUB_ACTION_PATH" &&
        find Cargo.toml Cargo.lock src scenes -type f ! -path '*/tests/*' | LC_ALL=C sort | tr '\n' '\0' | xargs -0 cat | sha256)
    {
        echo "source=true"
        echo "key=aogauge-${RUNNER_OS:?}-${RUNNER_ARCH:?}-$source"
    } >> "$GITHUB_OUTPUT"
    mkdir -p "$bin"
    echo "$bin" >> "$GITHUB_PATH"
    exit 0
}

# The action's release is asked for by a tag, v0.1.0 or v0.1, or by the commit of its tag.
is_release() {
    [ "$ACTION_REF" != "$tag" ] || return 0
    [ "$ACTION_REF" != "${tag%.*}" ] || return 0
    [[ $ACTION_REF =~ ^[0-9a-f]{40}$ ]] || return 1
    git ls-remote "$GITHUB_SERVER_URL/$ACTION_REPOSITORY" "refs/tags/$tag" "refs/tags/$tag^{}" | grep -q "^$ACTION_REF"
}

get() { curl --fail --silent --show-error --location --retry 3 --output "$2" "$releases/$1"; }

bin="$RUNNER_TEMP/aogauge/bin"
[ "$VERSION" != source ] || build "the workflow asks for it"
tag=v${VERSION#v}
if [ -z "$VERSION" ]; then
    tag=v$(sed -n '/^\[workspace\.package\]/,/^$/s/^version = "\(.*\)"$/\1/p' "$GITHUB_ACTION_PATH/Cargo.toml")
    [ -n "$ACTION_REPOSITORY" ] || build "the action is a folder of this machine"
    is_release || build "'$ACTION_REF' is not the release $tag"
fi
[[ $tag =~ ^v[0-9]+\.[0-9]+\.[0-9]+(-[0-9A-Za-z.-]+)?$ ]] || fail "version: '$VERSION' is no release; write one such as 0.1.0"
[ -n "$ACTION_REPOSITORY" ] || fail "version: an action that is a folder has no releases; leave it out, or write source"

case $RUNNER_OS-$RUNNER_ARCH in
    Linux-X64) target=x86_64-unknown-linux-gnu ;;
    Linux-ARM64) target=aarch64-unknown-linux-gnu ;;
    macOS-X64) target=x86_64-apple-darwin ;;
    macOS-ARM64) target=aarch64-apple-darwin ;;
    Windows-X64) target=x86_64-pc-windows-msvc ;;
    *) [ -z "$VERSION" ] || fail "release $tag has no program for $RUNNER_OS on $RUNNER_ARCH"
        build "there is no release for $RUNNER_OS on $RUNNER_ARCH" ;;
esac
name=aogauge-$tag-$target
archive=$name.tar.gz
[ "$RUNNER_OS" != Windows ] || archive=$name.zip
releases="$GITHUB_SERVER_URL/$ACTION_REPOSITORY/releases/download/$tag"
work=$(mktemp -d "$RUNNER_TEMP/aogauge-XXXXXX")
if ! get SHA256SUMS "$work/SHA256SUMS" || ! get "$archive" "$work/$archive"; then
    # Another version in place of the one that is asked for would be wrong.
    [ -z "$VERSION" ] || fail "release $tag of $ACTION_REPOSITORY has no $archive"
    build "release $tag of $ACTION_REPOSITORY has no $archive"
fi
expected=$(awk -v name="$archive" '$2 == name || $2 == "*" name { print $1 }' "$work/SHA256SUMS")
[ -n "$expected" ] || fail "SHA256SUMS of release $tag does not name $archive"
found=$(sha256 "$work/$archive")
[ "$found" = "$expected" ] || fail "$archive has the checksum $found, and $expected is that of the release: it is not installed"

mkdir -p "$bin"
case $archive in
    *.zip) unzip -q "$work/$archive" -d "$work" && mv "$work/$name/aogauge.exe" "$bin/" ;;
    *) tar -xzf "$work/$archive" -C "$work" && mv "$work/$name/aogauge" "$bin/" ;;
esac
"$bin/aogauge" --version
echo "$bin" >> "$GITHUB_PATH"
