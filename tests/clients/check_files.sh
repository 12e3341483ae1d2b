#!/bin/sh
# Opens the files of a run with programs that others wrote: Python `mcap` (with
# CRC checks), `rosbags` (every message deserialised) and `rerun mcap check`.
#
#   tests/clients/check_files.sh runs/um-depth-ekf
#
# The clients are installed into a virtual environment of their own, by default
# target/clients-venv (or the folder in TAGALONG_VENV).
set -eu

[ $# -eq 1 ] || { echo "usage: $0 RUN_DIRECTORY" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
venv=${TAGALONG_VENV:-$here/../../target/clients-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -x "$venv/bin/rerun" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet \
        'mcap==1.6.*' 'mcap-ros2-support==0.6.*' 'rosbags==0.11.*' 'rerun-sdk==0.41.*'
fi

"$venv/bin/python" "$here/check_files.py" "$1"

# rerun spins for ever on some damaged files, and reports errors on stderr only.
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! timeout 60 "$venv/bin/rerun" mcap check --full "$1/tracks.mcap" > "$log" 2>&1; then
    cat "$log"
    echo "rerun: failed" >&2
    exit 1
fi
if grep -q 'ERROR' "$log"; then
    cat "$log"
    echo "rerun: reported an error" >&2
    exit 1
fi
echo "rerun: ok"
