#!/bin/sh
# Holds 500 connections to the page of `tagalong run --serve` that send half a request each, and asks for the
# page by one whole request, which must be answered within a second.
#
#   tests/clients/check_slow.sh [LOG.mcap]
#
# Without an argument a scene is simulated. The program is the one in TAGALONG, by default
# target/release/tagalong.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
tagalong=${TAGALONG:-$root/target/release/tagalong}
[ -x "$tagalong" ] || { echo "$tagalong is missing: cargo build --release, or name it in TAGALONG" >&2; exit 2; }

home=$(mktemp -d)
trap 'rm -rf "$home"' EXIT
if [ $# -eq 0 ]; then
    "$tagalong" simulate "$root/configs/scenes/crossing.toml" --set duration_s=30 --set camera.width=160 \
        --set camera.height=120 -o "$home/a.mcap" > /dev/null
    set -- "$home/a.mcap"
fi

timeout 120 python3 "$here/check_slow.py" "$tagalong" "$1" "$home/run"
