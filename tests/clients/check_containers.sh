#!/bin/sh
# Converts an MCAP log with `rosbags` to a rosbag2 database, plain, compressed as a file and message by
# message, and to a ROS 1 bag, tracks all of them, and compares the tracks byte by byte.
#
#   tests/clients/check_containers.sh ../shared/data/logs/lab2-camera2.mcap [CONFIG] [TAGALONG]
#
# `rosbags` is installed into a virtual environment of its own, by default
# target/containers-venv (or the folder in TAGALONG_VENV).
set -eu

[ $# -ge 1 ] || { echo "usage: $0 LOG.mcap [CONFIG] [TAGALONG]" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
log=$1
config=${2:-depth-verified}
tagalong=${3:-$here/../../target/release/tagalong}
venv=${TAGALONG_VENV:-$here/../../target/containers-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -x "$venv/bin/rosbags-convert" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'rosbags==0.11.*'
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$venv/bin/rosbags-convert" --src "$log" --dst "$work/walk" --dst-storage sqlite3
"$venv/bin/rosbags-convert" --src "$work/walk" --dst "$work/walk.bag" --dst-typestore ros1_noetic
for mode in file message; do
    "$venv/bin/rosbags-convert" --src "$work/walk" --dst "$work/walk-$mode" --dst-storage sqlite3 \
        --compress zstd --compress-mode $mode
done

for container in "$log" "$work/walk" "$work/walk.bag" "$work/walk-file" "$work/walk-message"; do
    "$tagalong" run "$config" "$container" -o "$work/run" --overwrite 2> /dev/null > /dev/null
    cat "$work/run/tracks.csv" "$work/run/tracks-metres.csv" > "$work/now"
    [ -s "$work/now" ]
    [ -f "$work/first" ] || cp "$work/now" "$work/first"
    cmp "$work/first" "$work/now"
    echo "same tracks: $(basename "$container")"
done
