#!/bin/sh
# Opens a benchmark's page with programs that others wrote: html-validate for the
# markup, axe in headless Chromium for accessibility (light and dark, folded and
# unfolded), and a watch on the browser for any request to the network.
#
#   tests/clients/check_report.sh runs/bench/report.html
#
# Without an argument a sample is made and checked. The clients are installed
# into target/clients-node (or the folder in TAGALONG_NODE); the browser is
# /usr/bin/chromium (or the one in TAGALONG_CHROMIUM). With TAGALONG_PICTURES set
# to a folder, pictures of the page are left there to look at.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
node=${TAGALONG_NODE:-$root/target/clients-node}
chromium=${TAGALONG_CHROMIUM:-/usr/bin/chromium}

for program in node npm "$chromium"; do
    if ! command -v "$program" > /dev/null; then
        echo "skipped: $program is not installed" >&2
        exit 0
    fi
done

if [ $# -eq 0 ]; then
    (cd "$root" && cargo run --quiet -p tagalong-report --example sample -- target/sample-report)
    set -- "$root/target/sample-report/report.html"
fi
[ $# -eq 1 ] || { echo "usage: $0 [REPORT.html]" >&2; exit 2; }

if [ ! -d "$node/node_modules/axe-core" ]; then
    mkdir -p "$node"
    (cd "$node" && timeout 300 npm install --silent --no-save --no-audit --no-fund --prefix . \
        html-validate@9.7.1 axe-core@4.10 playwright-core@1.55)
fi

# The pages are made by a program, so the style of writing HTML is not checked.
rules=$(mktemp -d)
trap 'rm -rf "$rules"' EXIT
cat > "$rules/.htmlvalidate.json" << 'END'
{ "root": true, "extends": ["html-validate:recommended"], "rules": { "long-title": "error" } }
END
cp "$1" "$rules/report.html"
(cd "$rules" && timeout 60 "$node/node_modules/.bin/html-validate" report.html)
echo "html-validate: ok"

NODE_PATH="$node/node_modules" TAGALONG_CHROMIUM="$chromium" \
    timeout 120 node "$here/check_report.cjs" "$rules/report.html"
