#!/bin/sh
# Lets onnxruntime run the network that `tagalong model --export` writes and the hand-weighted
# networks for re-identification of `[appearance]`, one of each convention, and compares its outputs
# with ours:
#
#   tests/clients/check_networks.sh
#
# onnxruntime is installed into a virtual environment of its own, by default target/networks-venv
# (or the folder in TAGALONG_NETWORKS_VENV). TAGALONG names the program, and TAGALONG_VECTORS the
# example `vectors` of tagalong-network, by default those that cargo builds.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
venv=${TAGALONG_NETWORKS_VENV:-$root/target/networks-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -f "$venv/installed" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet numpy onnx onnxruntime
    touch "$venv/installed"
fi

# Runs a program that is built already, or builds it: NAME_OF_PROGRAM CARGO_ARGUMENTS ...
built_or() {
    program=$1
    package=$2
    shift 2
    if [ -n "$program" ]; then
        "$program" "$@"
    else
        # The package may name an example, too.
        # shellcheck disable=SC2086
        cargo run --quiet --release -p $package --manifest-path "$root/Cargo.toml" -- "$@"
    fi
}

made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
built_or "${TAGALONG:-}" tagalong-cli \
    model --export depth-net "$made/depth-net.onnx" --sample "$made/sample.json"
"$venv/bin/python" "$here/check_networks.py" plan "$made/depth-net.onnx" "$made/sample.json"

"$venv/bin/python" "$here/check_networks.py" image "$made/people.ppm"
for convention in osnet omz; do
    network=$root/crates/network/tests/models/$convention.onnx
    # `auto`: the convention is told from the outputs.
    built_or "${TAGALONG_VECTORS:-}" "tagalong-network --example vectors" \
        "$network" "$made/people.ppm" auto 0,0,128,256 37,21,128,256 192,44,128,256 \
        > "$made/$convention.json"
    "$venv/bin/python" "$here/check_networks.py" vectors \
        "$network" "$convention" "$made/people.ppm" "$made/$convention.json"
done
