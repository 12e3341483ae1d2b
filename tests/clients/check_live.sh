#!/bin/sh
# Opens the page of `tagalong run --serve` while the run goes on: html-validate for the markup, axe in
# headless Chromium for accessibility (at 1280, 1920 and 390 px, light and dark), a watch on the browser for any
# request elsewhere, and a scripted visitor that sees frames arrive, pauses, scrubs, clicks, goes on,
# reads the state of lock and command, and sees the end by Ctrl-C, after which the files of the run are
# whole.
#
#   tests/clients/check_live.sh [CONFIG LOG.mcap]
#
# Without arguments a scene is simulated that a robot follows. pages.sh says where clients and browser
# are; the program is the one in TAGALONG, by default target/release/tagalong. With TAGALONG_PICTURES
# set to a folder, pictures of the page are left there to look at.
set -eu

. "$(dirname "$0")/pages.sh"

tagalong=${TAGALONG:-$root/target/release/tagalong}
[ -x "$tagalong" ] || { echo "$tagalong is missing: cargo build --release, or name it in TAGALONG" >&2; exit 2; }

if [ $# -eq 0 ]; then
    "$tagalong" simulate "$root/configs/scenes/crossing.toml" --set duration_s=40 -o "$home/a.mcap" > /dev/null
    set -- "$root/configs/follow-depth.toml" "$home/a.mcap"
fi

visit "$here/check_live.cjs" "$tagalong" "$1" "$2" "$home"
validate "$home/live.html"
"$tagalong" view "$home/run" -o "$home/view.html" > /dev/null
echo "view reads the run that was stopped: ok"
