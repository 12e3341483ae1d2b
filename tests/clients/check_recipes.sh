#!/bin/sh
# Runs the recipes of docs/benchmarks.md for xargs, Slurm and HyperQueue on the logs of a folder,
# and compares their results with those of one process:
#
#   tests/clients/check_recipes.sh LOGS_DIRECTORY [CONFIG...]
#
# HyperQueue is installed into a virtual environment of its own, by default
# target/hq-venv (or the folder in TAGALONG_HQ_VENV). Slurm has to be there (Debian: slurm-wlm);
# without it its recipe is skipped. TAGALONG names the program, by default target/release/tagalong.
set -eu

[ $# -ge 1 ] || { echo "usage: $0 LOGS_DIRECTORY [CONFIG...]" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
tagalong=$(realpath "${TAGALONG:-$root/target/release/tagalong}")
venv=${TAGALONG_HQ_VENV:-$root/target/hq-venv}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# What the recipes name: the program, the logs, and the default configs.
mkdir "$work/bin"
ln -s "$tagalong" "$work/bin/tagalong"
ln -s "$(realpath "$1")" "$work/logs"
shift
if [ $# -eq 0 ]; then
    ln -s "$root/configs" "$work/configs"
else
    mkdir "$work/configs"
    cp "$@" "$work/configs"
fi
PATH=$work/bin:$PATH:/usr/sbin
cd "$work"

# Prints the code of the page between two of its lines.
recipe() {
    sed -n "/$1/,/$2/p" "$root/docs/benchmarks.md" | sed -n '/^```sh$/,/^```$/{/^```/!p}'
}
# Runs commands that make the folder `bench`, and compares it.
same() {
    rm -rf bench
    "$@" > log 2>&1 || { cat log; exit 1; }
    diff -rq one/results bench/results
    cmp one/report.json bench/report.json
    cmp one/report.html bench/report.html
}

tagalong bench --logs-dir logs -o one > /dev/null 2>&1

recipe '^With .xargs' '^With Slurm' > xargs.sh
grep -q 'xargs' xargs.sh
same sh -e xargs.sh
echo "xargs: ok"

if command -v slurmctld > /dev/null; then
    recipe '^With Slurm' '^With .HyperQueue' > slurm.sh
    sed '/^tagalong bench plan/,$d' slurm.sh > bench.sbatch
    sed -n '/^tagalong bench plan/,$p' slurm.sh > submit.sh
    grep -q 'sbatch' submit.sh
    same "$here/slurm_node.sh" 2 sh -e submit.sh
    [ "$(find . -maxdepth 1 -name 'slurm-*.out' | wc -l)" -gt 1 ] # an array ran
    echo "slurm: ok"
else
    echo "slurm: skipped: slurmctld is not installed" >&2
fi

if ! command -v python3 > /dev/null; then
    echo "hyperqueue: skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -f "$venv/installed" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'hyperqueue==0.27.*'
    touch "$venv/installed"
fi
hyperqueue() {
    tagalong bench plan --logs-dir logs -o bench
    HOME=$work timeout 600 "$venv/bin/python" "$here/hyperqueue_bench.py" tagalong bench 2 4
    tagalong bench report -o bench
}
same hyperqueue
echo "hyperqueue: ok"
