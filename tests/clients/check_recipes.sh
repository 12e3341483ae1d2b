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
trap 'rm -rf "$work"' EXIT

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
if [ ! -f "$venv/installed" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'hyperqueue==0.27.*'
    touch "$venv/installed"
fi
plan "$work/hyperqueue" > /dev/null
HOME=$work timeout 300 "$venv/bin/python" "$here/hyperqueue_bench.py" \
    "$tagalong" "$work/hyperqueue" 2 > "$work/hyperqueue.log" 2>&1 || {
    cat "$work/hyperqueue.log"
    exit 1
}
same hyperqueue
