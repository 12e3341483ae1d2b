#!/bin/sh
# Runs the recipes of docs/benchmarks.md for xargs and HyperQueue on the logs of
# a folder, and compares their results with those of one process:
#
#   tests/clients/check_recipes.sh LOGS_DIRECTORY
#
# HyperQueue is installed into a virtual environment of its own, by default
# target/hq-venv (or the folder in TAGALONG_HQ_VENV). TAGALONG names the program,
# by default target/release/tagalong.
set -eu

[ $# -eq 1 ] || { echo "usage: $0 LOGS_DIRECTORY" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
root=$here/../..
tagalong=${TAGALONG:-$root/target/release/tagalong}
venv=${TAGALONG_HQ_VENV:-$root/target/hq-venv}
logs=$1
work=$(mktemp -d)
HQ_SERVER_DIR=$work/hq-server
export HQ_SERVER_DIR
hq=

finish() {
    if [ -n "$hq" ]; then "$hq" server stop > /dev/null 2>&1 || true; fi
    rm -rf "$work"
}
trap finish EXIT

plan() {
    "$tagalong" bench plan --configs "$root"/configs/*.toml --logs-dir "$logs" -o "$1" 2> /dev/null
}
same() {
    "$tagalong" bench report -o "$work/$1" > /dev/null
    diff -r "$work/one/results" "$work/$1/results"
    cmp "$work/one/report.json" "$work/$1/report.json"
    cmp "$work/one/report.html" "$work/$1/report.html"
    echo "$1: ok"
}

count=$(plan "$work/one" | wc -l)
"$tagalong" bench run -o "$work/one" 2> /dev/null
"$tagalong" bench report -o "$work/one" > /dev/null

plan "$work/xargs" > /dev/null
seq "$count" | xargs -P 2 -I K "$tagalong" bench run -o "$work/xargs" --task K 2> /dev/null
same xargs

if ! command -v python3 > /dev/null; then
    echo "hyperqueue: skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -x "$venv/bin/hq" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'hyperqueue==0.27.*'
fi
hq=$venv/bin/hq
plan "$work/hyperqueue" > /dev/null
"$hq" server start > "$work/server.log" 2>&1 &
for _ in 1 2 3 4 5 6 7 8 9 10; do
    if "$hq" server info > /dev/null 2>&1; then break; fi
    sleep 1
done
"$hq" worker start --cpus 2 > "$work/worker.log" 2>&1 &
TAGALONG=$tagalong; BENCH=$work/hyperqueue
timeout 300 "$hq" submit --wait --array "1-$count" --cwd "$PWD" \
    --stdout none --stderr none --env "TAGALONG=$TAGALONG" --env "BENCH=$BENCH" \
    sh -c '"$TAGALONG" bench run -o "$BENCH" --task $HQ_TASK_ID' > "$work/submit.log"
same hyperqueue
