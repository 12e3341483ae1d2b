# Sourced by the scripts that open a page in a browser: finds node and Chromium, or ends the script
# as skipped, and installs the clients into target/clients-node (or the folder in TAGALONG_NODE). The
# browser is /usr/bin/chromium (or the one in TAGALONG_CHROMIUM).

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

if [ ! -d "$node/node_modules/axe-core" ]; then
    # Beside its place first: another script may begin meanwhile, and must not find a half of it.
    mkdir -p "$node"
    part=$(mktemp -d "$node/part.XXXXXX")
    (cd "$part" && timeout 300 npm install --silent --no-save --no-audit --no-fund --prefix . \
        html-validate@9.7.1 axe-core@4.10 playwright-core@1.55)
    [ -d "$node/node_modules" ] || mv "$part/node_modules" "$node/"
    rm -rf "$part"
fi

home=$(mktemp -d)
trap 'rm -rf "$home"' EXIT

# The pages are made by a program, so the style of writing HTML is not checked.
cat > "$home/.htmlvalidate.json" << 'END'
{ "root": true, "extends": ["html-validate:recommended"], "rules": { "long-title": "error" } }
END

# Copies a page to $home/page.html and validates its markup.
validate() {
    cp "$1" "$home/page.html"
    (cd "$home" && timeout 120 "$node/node_modules/.bin/html-validate" page.html)
    echo "html-validate: ok"
}

# Runs a script with the clients, for at most ten minutes.
visit() {
    NODE_PATH="$node/node_modules" TAGALONG_CHROMIUM="$chromium" timeout 600 node "$@"
}
