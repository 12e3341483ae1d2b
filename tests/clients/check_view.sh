#!/bin/sh
# Opens the page of `tagalong view` with programs that others wrote: html-validate for the markup,
# axe in headless Chromium for accessibility (light, dark and phone width), a watch on the browser
# for any request to the network, and a scripted visitor that clicks, scrubs, plays and reads back.
#
#   tests/clients/check_view.sh runs/robot-depth-verified/view.html
#
# Without an argument a scene is simulated, and pages of one run and of two are checked. The clients
# are installed into target/clients-node (or the folder in TAGALONG_NODE); the browser is
# /usr/bin/chromium (or the one in TAGALONG_CHROMIUM), the program `cargo run` (or the one in
# TAGALONG). With TAGALONG_PICTURES set to a folder, pictures of the page are left there to look at.
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

tagalong() {
    if [ -n "${TAGALONG:-}" ]; then "$TAGALONG" "$@"; else (cd "$root" && cargo run --quiet -- "$@"); fi
}

home=$(mktemp -d)
trap 'rm -rf "$home"' EXIT

if [ $# -eq 0 ]; then
    tagalong simulate "$root/configs/scenes/crossing.toml" -o "$home/a.mcap" > /dev/null
    tagalong run depth-ekf "$home/a.mcap" -o "$home/one" > /dev/null
    tagalong run depth-alone "$home/a.mcap" -o "$home/two" > /dev/null
    tagalong view "$home/one" -o "$home/one.html"
    tagalong view "$home/one" "$home/two" -o "$home/both.html"
    set -- "$home/one.html" "$home/both.html"
fi

if [ ! -d "$node/node_modules/axe-core" ]; then
    mkdir -p "$node"
    (cd "$node" && timeout 300 npm install --silent --no-save --no-audit --no-fund --prefix . \
        html-validate@9.7.1 axe-core@4.10 playwright-core@1.55)
fi

# The pages are made by a program, so the style of writing HTML is not checked.
cat > "$home/.htmlvalidate.json" << 'END'
{ "root": true, "extends": ["html-validate:recommended"], "rules": { "long-title": "error" } }
END

for page in "$@"; do
    cp "$page" "$home/page.html"
    (cd "$home" && timeout 120 "$node/node_modules/.bin/html-validate" page.html)
    echo "html-validate: ok"
    NODE_PATH="$node/node_modules" TAGALONG_CHROMIUM="$chromium" TAGALONG_PAGE=$(basename "$page" .html) \
        timeout 300 node "$here/check_view.cjs" "$home/page.html"
done
