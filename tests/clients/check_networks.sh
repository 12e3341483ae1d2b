#!/bin/sh
# Lets onnxruntime run the network that `tagalong model --export` writes, and compares its outputs
# with those of the plugin itself:
#
#   tests/clients/check_networks.sh
#
# onnxruntime is installed into a virtual environment of its own, by default target/networks-venv
# (or the folder in TAGALONG_NETWORKS_VENV). TAGALONG names the program, by default the one that
# cargo builds.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
venv=${TAGALONG_NETWORKS_VENV:-$here/../../target/networks-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -f "$venv/installed" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet numpy onnx onnxruntime
    touch "$venv/installed"
fi

made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
set -- model --export depth-net "$made/depth-net.onnx" --sample "$made/sample.json"
if [ -n "${TAGALONG:-}" ]; then
    "$TAGALONG" "$@"
else
    cargo run --quiet --release -p tagalong-cli --manifest-path "$here/../../Cargo.toml" -- "$@"
fi
"$venv/bin/python" "$here/check_networks.py" "$made/depth-net.onnx" "$made/sample.json"
