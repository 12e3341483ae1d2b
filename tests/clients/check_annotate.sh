#!/bin/sh
# Opens the page of `tagalong annotate` with programs that others wrote: html-validate for the markup,
# axe in headless Chromium for accessibility (at 1280, 1920 and 390 px, light and dark), a watch on the browser for
# any request to the network, and a scripted visitor that corrects proposed tracks, adds a person,
# numbers, interpolates, takes back, kills the program, goes on, finishes, and reads the file after
# each step.
#
#   tests/clients/check_annotate.sh [LOG.mcap]
#
# Without an argument a scene is simulated. pages.sh says where clients and browser are; the program
# is the one in TAGALONG, by default target/release/tagalong. With TAGALONG_PICTURES set to a folder,
# pictures of the page are left there to look at.
set -eu

. "$(dirname "$0")/pages.sh"

tagalong=${TAGALONG:-$root/target/release/tagalong}
[ -x "$tagalong" ] || { echo "$tagalong is missing: cargo build --release, or name it in TAGALONG" >&2; exit 2; }

if [ $# -eq 0 ]; then
    "$tagalong" simulate "$root/configs/scenes/crossing.toml" -o "$home/walk.mcap" > /dev/null
    set -- "$home/walk.mcap"
fi

validate "$root/crates/annotate/src/page/page.html"
visit "$here/check_annotate.cjs" "$tagalong" "$1" "$home/walk.people.csv"
"$tagalong" run "$1" -o "$home/run" > /dev/null
"$tagalong" eval --truth "$home/walk.people.csv" --tracks "$home/run" > /dev/null
echo "eval reads the file: ok"
