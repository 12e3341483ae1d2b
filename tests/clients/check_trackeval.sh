#!/bin/sh
# Lets TrackEval score a benchmark and compares its figures with ours:
#
#   tests/clients/check_trackeval.sh bench
#
# The folder is that of a finished `tagalong bench -o bench`; its results are
# exported first. TrackEval is installed into a virtual environment of its own,
# by default target/trackeval-venv (or the folder in TAGALONG_TRACKEVAL_VENV).
# TAGALONG names the program, by default the one that cargo builds.
set -eu

[ $# -eq 1 ] || { echo "usage: $0 BENCHMARK_DIRECTORY" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
venv=${TAGALONG_TRACKEVAL_VENV:-$here/../../target/trackeval-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -f "$venv/installed" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'trackeval==1.3.*' numpy scipy
    touch "$venv/installed"
fi

tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
if [ -n "${TAGALONG:-}" ]; then
    "$TAGALONG" bench export -o "$1" --trackeval "$tree"
else
    cargo run --quiet --release -p tagalong-cli --manifest-path "$here/../../Cargo.toml" -- \
        bench export -o "$1" --trackeval "$tree"
fi
"$venv/bin/python" "$here/check_trackeval.py" "$tree" "$1/report.json"
