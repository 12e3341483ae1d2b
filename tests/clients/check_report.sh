#!/bin/sh
# Opens a benchmark's page with programs that others wrote: html-validate for the
# markup, axe in headless Chromium for accessibility (at 1280, 1920 and 390 px, light
# and dark), and a watch on the browser for any request to the network.
#
#   tests/clients/check_report.sh runs/bench/report.html
#
# Without an argument a sample is made and checked; pages.sh says where clients and
# browser are. With TAGALONG_PICTURES set to a folder, pictures of the page are left
# there to look at.
set -eu

. "$(dirname "$0")/pages.sh"

if [ $# -eq 0 ]; then
    (cd "$root" && cargo run --quiet -p tagalong-report --example sample -- target/sample-report)
    set -- "$root/target/sample-report/report.html"
fi
[ $# -eq 1 ] || { echo "usage: $0 [REPORT.html]" >&2; exit 2; }

validate "$1"
visit "$here/check_report.cjs" "$home/page.html"
