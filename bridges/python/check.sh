#!/bin/sh
# Builds the wheel, installs it into a virtual environment of its own, and runs its tests. Not optimised:
# its crates have other features than those of the workspace's tests, and are built for this alone.
set -eu
cd "$(dirname "$0")"

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../../target}"
venv=${TAGALONG_WHEEL_VENV:-$CARGO_TARGET_DIR/wheel-venv}
if ! { command -v python3 && python3 -c 'import ensurepip, venv'; } > /dev/null 2>&1; then
    echo "==> the wheel: skipped, needs python3 with venv and pip" >&2
    exit 0
fi
if [ ! -x "$venv/bin/maturin" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet 'maturin>=1.9,<2' numpy pytest
fi
export CARGO_PROFILE_DEV_OPT_LEVEL=0
wheels=$(mktemp -d)
trap 'rm -rf "$wheels"' EXIT
"$venv/bin/maturin" build --quiet --profile dev --strip --auditwheel skip \
    --interpreter "$venv/bin/python" --out "$wheels"
"$venv/bin/pip" install --quiet --force-reinstall --no-deps "$wheels"/*.whl
"$venv/bin/python" -m pytest -q -p no:cacheprovider
