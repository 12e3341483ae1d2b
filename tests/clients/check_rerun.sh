#!/bin/sh
# Opens tracks.mcap in the web viewer of Rerun, in headless Chromium, and leaves a picture to look at;
# before that it checks that Rerun has points to draw for each person.
#
#   tests/clients/check_rerun.sh RUN_DIRECTORY PICTURE.png
#
# Needs what check_files.sh and check_view.sh install: the viewer is that of the wheel rerun-sdk, in
# target/clients-venv (or the folder in TAGALONG_VENV). The ports 9876 and 9090 must be free.
set -eu

[ $# -eq 2 ] || { echo "usage: $0 RUN_DIRECTORY PICTURE.png" >&2; exit 2; }
. "$(dirname "$0")/pages.sh"
venv=${TAGALONG_VENV:-$root/target/clients-venv}
[ -x "$venv/bin/rerun" ] || { echo "skipped: run check_files.sh first, which installs rerun" >&2; exit 0; }

timeout 120 "$venv/bin/rerun" mcap convert "$1/tracks.mcap" -o "$home/run.rrd" > "$home/convert" 2>&1
timeout 120 "$venv/bin/rerun" rrd print -vvv "$home/run.rrd" > "$home/printed" 2>&1
people=$(grep -ao 'entity_path: /people/person_[0-9]*/body' "$home/printed" | sort -u | wc -l)
grep -aq 'Points3D:positions' "$home/printed" && [ "$people" -gt 0 ] || { echo "rerun: no person to draw" >&2; exit 1; }
echo "rerun: points of $people people"

timeout 180 "$venv/bin/rerun" --serve-web --port 9876 --web-viewer-port 9090 "$home/run.rrd" > "$home/viewer" 2>&1 &
viewer=$!
trap 'kill "$viewer" 2> /dev/null; rm -rf "$home"' EXIT
sleep 5
visit "$here/check_rerun.cjs" 'http://127.0.0.1:9090/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9876%2Fproxy' "$2"
