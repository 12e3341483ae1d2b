#!/bin/sh
# Builds the program for aarch64 (Raspberry Pi, Jetson) and, where qemu is, runs it there on a simulated log:
# the tracks must be those of this machine within a millimetre and a pixel.
#
#   tests/clients/check_aarch64.sh
#
# Needs `rustup target add aarch64-unknown-linux-gnu` and the packages `gcc-aarch64-linux-gnu` and, to run it,
# `qemu-user`; says so and skips without the first two. The program of this machine is the one in TAGALONG, by
# default target/release/tagalong. PROFILE (dev) names the profile of the build.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=aarch64-unknown-linux-gnu
linker=aarch64-linux-gnu-gcc

if ! [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ] || ! command -v $linker > /dev/null; then
    echo "skipped: needs the Rust target $target and $linker" >&2
    exit 0
fi
cd "$root"
CC_aarch64_unknown_linux_gnu=$linker CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=$linker \
    cargo build --quiet --target $target --profile "${PROFILE:-dev}" --package tagalong-cli
folder=${PROFILE:-debug}
[ "$folder" != dev ] || folder=debug
built=${CARGO_TARGET_DIR:-$root/target}/$target/$folder/tagalong
echo "built: $(file -b "$built" 2> /dev/null || echo "$built")"

if ! command -v qemu-aarch64 > /dev/null || ! command -v python3 > /dev/null; then
    echo "not run: needs qemu-aarch64 and python3" >&2
    exit 0
fi
tagalong=${TAGALONG:-$root/target/release/tagalong}
[ -x "$tagalong" ] || { echo "$tagalong is missing: cargo build --release, or name it in TAGALONG" >&2; exit 2; }

home=$(mktemp -d)
trap 'rm -rf "$home"' EXIT
"$tagalong" simulate "$root/configs/scenes/crossing.toml" --set duration_s=2 --set camera.width=160 \
    --set camera.height=120 -o "$home/a.mcap" > /dev/null
"$tagalong" run depth-ekf "$home/a.mcap" -o "$home/here" > /dev/null
qemu-aarch64 -L /usr/aarch64-linux-gnu "$built" run depth-ekf "$home/a.mcap" -o "$home/there" > /dev/null
python3 "$here/check_aarch64.py" "$home/here" "$home/there"
