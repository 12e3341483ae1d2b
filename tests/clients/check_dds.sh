#!/bin/sh
# Lets an independent DDS (cyclonedds, as ROS 2 has it) play a robot before the ROS 2 bridge, and
# speaks to the bridge over HTTP; no ROS is needed:
#
#   tests/clients/check_dds.sh
#
# cyclonedds is installed into a virtual environment of its own, by default target/dds-venv (or the
# folder in TAGALONG_DDS_VENV). TAGALONG and TAGALONG_ROS2 name the programs, by default those that
# cargo builds. A failed check ends with 1; without Python or network it is skipped.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
venv=${TAGALONG_DDS_VENV:-$root/target/dds-venv}

if ! command -v python3 > /dev/null; then
    echo "skipped: python3 is not installed" >&2
    exit 0
fi
if [ ! -f "$venv/installed" ]; then
    if ! { python3 -m venv "$venv" && "$venv/bin/pip" install --quiet cyclonedds mcap; }; then
        echo "skipped: cyclonedds could not be installed (not fatal)" >&2
        exit 0
    fi
    touch "$venv/installed"
fi

tagalong() {
    if [ -n "${TAGALONG:-}" ]; then
        "$TAGALONG" "$@"
    else
        cargo run --quiet --manifest-path "$root/Cargo.toml" -- "$@"
    fi
}
if [ -z "${TAGALONG_ROS2:-}" ]; then
    export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$root/target}"
    cargo build --quiet --manifest-path "$root/Cargo.toml" -p tagalong-ros2
    TAGALONG_ROS2=$CARGO_TARGET_DIR/debug/tagalong-ros2
fi

made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
tagalong simulate "$here/robot.toml" -o "$made/robot.mcap" 2> /dev/null
# Domains and a port that no other run of this check is likely to use. The ports of a domain above 101
# are among those that Linux gives to any socket (32768 to 60999), as is a port of HTTP there.
domain=$((1 + $$ % 96))
port=$((20000 + $$ % 12000))

# check CHECK DOMAIN [OPTION ...]
check() {
    checks=$1
    domain=$2
    shift 2
    "$venv/bin/python" "$here/check_dds.py" "$checks" "$made/robot.mcap" "$domain" "$port" \
        "$TAGALONG_ROS2" "$root/bridges/ros2/tests/driven-by-others.toml" --domain "$domain" --wait 30 \
        --http "127.0.0.1:$port" --rmw rmw_cyclonedds_cpp "$@"
}
check all "$domain"
check camera $((domain + 1))
check camera $((domain + 2)) --clock arrival
check managed $((domain + 3)) --lifecycle
check nav2 $((domain + 4)) --follow-object
