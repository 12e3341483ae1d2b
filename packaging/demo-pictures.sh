#!/bin/sh
# Makes docs/demo.gif and docs/demo.png, the pictures at the head of README.md, from a simulated crowd.
# TAGALONG names another program than the one that cargo builds.
set -eu
cd "$(dirname "$0")/.."
tagalong=${TAGALONG:-"cargo run --release --"}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
$tagalong simulate configs/scenes/crowd.toml -o "$work/crowd.mcap"
$tagalong run configs/depth-verified.toml "$work/crowd.mcap" -o "$work/run" --overlay
$tagalong view "$work/run" --from 11.7 --to 15.7 --animation docs/demo.gif --width 600 --fps 6 --overwrite
cp "$work/run/overlay/000120.png" docs/demo.png
for picture in docs/demo.gif docs/demo.png; do
  bytes=$(wc -c < "$picture")
  if [ "$bytes" -ge 1000000 ]; then
    echo "$picture has $bytes bytes; shorten the animation: README.md must load at once" >&2
    exit 1
  fi
done
