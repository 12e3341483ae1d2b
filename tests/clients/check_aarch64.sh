#!/bin/sh
# Builds the programs for aarch64, the processor of Raspberry Pi and Jetson, and lets one of them track a simulated log by
# an emulator, beside the program of this machine.
#
#   tests/clients/check_aarch64.sh
#
# It needs the target (rustup target add aarch64-unknown-linux-gnu) and a C compiler for it (Debian:
# gcc-aarch64-linux-gnu, libc6-dev-arm64-cross), and says that it skips without them; without qemu-aarch64
# (qemu-user) the programs are built and not run. TAGALONG names the program of this machine, by default
# target/debug/tagalong.
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
target=aarch64-unknown-linux-gnu

if ! rustc --print target-libdir --target "$target" 2> /dev/null | xargs test -d; then
    echo "skipped: the target $target is not installed" >&2
    exit 0
fi
if ! command -v aarch64-linux-gnu-gcc > /dev/null; then
    echo "skipped: no aarch64-linux-gnu-gcc" >&2
    exit 0
fi
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$root/target}"
CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_DIR CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER
cargo build --quiet --manifest-path "$root/Cargo.toml" --target "$target" -p tagalong-cli -p tagalong-ros2

if ! command -v qemu-aarch64 > /dev/null; then
    echo "built, and not run: no qemu-aarch64" >&2
    exit 0
fi
built=$CARGO_TARGET_DIR/$target/debug
here_program=${TAGALONG:-$CARGO_TARGET_DIR/debug/tagalong}
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
emulated() {
    qemu-aarch64 -L /usr/aarch64-linux-gnu "$@"
}
emulated "$built/tagalong-ros2" --version
"$here_program" simulate "$root/configs/scenes/sample.toml" --set duration_s=3 -o "$made/scene.mcap" > /dev/null
for config in depth-verified follow-depth; do
    "$here_program" run "$config" "$made/scene.mcap" -o "$made/here" --overwrite > /dev/null
    emulated "$built/tagalong" run "$config" "$made/scene.mcap" -o "$made/there" --overwrite > /dev/null
    cmp "$made/here/tracks.csv" "$made/there/tracks.csv"
    echo "$config: the same tracks as on this machine, $(wc -l < "$made/here/tracks.csv") lines"
done
