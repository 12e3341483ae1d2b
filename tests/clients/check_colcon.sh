#!/bin/sh
# Builds the bridge with colcon as a ROS workspace does, and looks at what it installs; no ROS is needed:
#
#   tests/clients/check_colcon.sh
#
# colcon is installed into a virtual environment of its own, by default target/colcon-venv (or the folder
# in TAGALONG_COLCON_VENV). The workspace has a clone of the last commit in its folder src. The dev
# profile is built (TAGALONG_COLCON_TYPE=Release takes the one that a user gets, in some ten minutes), in
# CARGO_TARGET_DIR if that is set, and in target otherwise. A failed check ends with 1; without git,
# Python, make, cargo or network it is skipped.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
venv=${TAGALONG_COLCON_VENV:-$root/target/colcon-venv}
type=${TAGALONG_COLCON_TYPE:-Debug}

for program in git python3 make cargo; do
    if ! command -v "$program" > /dev/null; then
        echo "skipped: $program is not installed" >&2
        exit 0
    fi
done
if [ ! -f "$venv/installed" ]; then
    if ! { python3 -m venv "$venv" && "$venv/bin/pip" install --quiet colcon-common-extensions cmake; }; then
        echo "skipped: colcon and cmake could not be installed (not fatal)" >&2
        exit 0
    fi
    touch "$venv/installed"
fi

fail() {
    echo "colcon: failed: $*" >&2
    exit 1
}

workspace=$(mktemp -d)
trap 'rm -rf "$workspace"' EXIT
mkdir "$workspace/src"
git clone --quiet --local "$root" "$workspace/src/tagalong"
cd "$workspace"
export PATH="$venv/bin:$PATH"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$root/target}"
# Notifications of colcon would start programs of a desktop.
export COLCON_EXTENSION_BLOCKLIST=colcon_core.event_handler.desktop_notification

colcon() {
    "$venv/bin/colcon" --log-base "$workspace/log" "$@"
}
found=$(colcon list --names-only)
[ "$found" = tagalong_ros2 ] || fail "the packages of the clone are: $found"
echo "colcon finds the package: ok"

colcon build --packages-select tagalong_ros2 --cmake-args "-DCMAKE_BUILD_TYPE=$type"
for file in lib/tagalong_ros2/tagalong-ros2 share/tagalong_ros2/package.xml \
    share/tagalong_ros2/launch/follow.launch.py share/tagalong_ros2/configs/follow-depth.toml \
    share/tagalong_ros2/rviz/tagalong.rviz share/tagalong_ros2/foxglove/tagalong.json \
    share/ament_index/resource_index/packages/tagalong_ros2; do
    [ -e "install/tagalong_ros2/$file" ] || fail "$file is not installed"
done
echo "its files are installed: ok"

# `ros2 run` and `ros2 launch` look for packages below the folders of this variable.
prefix=$(sh -c '. install/setup.sh && echo "$AMENT_PREFIX_PATH"')
[ "$prefix" = "$workspace/install/tagalong_ros2" ] || fail "AMENT_PREFIX_PATH is '$prefix'"
install/tagalong_ros2/lib/tagalong_ros2/tagalong-ros2 --help > /dev/null
echo "setup.sh names its folder, and the program starts: ok"
