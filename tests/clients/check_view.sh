#!/bin/sh
# Opens the page of `tagalong view` with programs that others wrote: html-validate for the markup,
# axe in headless Chromium for accessibility (at 1280, 1920 and 390 px, light and dark), a watch on the browser
# for any request to the network, and a scripted visitor that clicks, scrubs, plays and reads back.
#
#   tests/clients/check_view.sh runs/robot-depth-verified/view.html
#
# Without an argument a scene is simulated, and pages of one run, of two, of a ride and of the list of
# rides are checked. pages.sh says
# where clients and browser are; the program is `cargo run` (or the one in TAGALONG). With
# TAGALONG_PICTURES set to a folder, pictures of the page are left there to look at.
set -eu

. "$(dirname "$0")/pages.sh"

tagalong() {
    if [ -n "${TAGALONG:-}" ]; then "$TAGALONG" "$@"; else (cd "$root" && cargo run --quiet -- "$@"); fi
}

if [ $# -eq 0 ]; then
    tagalong simulate "$root/configs/scenes/crossing.toml" -o "$home/a.mcap" > /dev/null
    tagalong run depth-ekf "$home/a.mcap" -o "$home/one" > /dev/null
    tagalong run depth-alone "$home/a.mcap" -o "$home/two" > /dev/null
    tagalong view "$home/one" -o "$home/one.html"
    tagalong view "$home/one" "$home/two" -o "$home/both.html"
    tagalong follow "$root/configs/follow-depth.toml" "$root/configs/scenes/follow-passing.toml" \
        "$root/configs/scenes/follow-turns.toml" -o "$home/rides" --format json > /dev/null
    tagalong view "$home/rides"
    set -- "$home/one.html" "$home/both.html" "$home"/rides/follow-passing-*/view.html
    validate "$home/rides/index.html"
    # Links lead to the pages beside the list, which is not where the copy is.
    TAGALONG_PAGE=rides visit "$here/check_report.cjs" "$home/page.html"
fi

for page in "$@"; do
    validate "$page"
    name=$(basename "$page" .html)
    # The page in the folder of a run or a ride is named by the folder.
    [ "$name" != view ] || name=$(basename "$(dirname "$page")")
    TAGALONG_PAGE=$name visit "$here/check_view.cjs" "$home/page.html"
done
