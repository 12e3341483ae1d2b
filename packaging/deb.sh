#!/bin/sh
# Builds the Debian package of the program, with manual pages, completions, configs and documents:
# target/debian/tagalong_VERSION_ARCHITECTURE.deb. Needs cargo-deb (`cargo install cargo-deb`).
#
#   packaging/deb.sh [--profile PROFILE]
#
# The profile is `release` unless another one is given; `dev` builds faster and is for trying.
set -eu
cd "$(dirname "$0")/.."

profile=release
[ "${1-}" != --profile ] || profile=$2
target=${CARGO_TARGET_DIR:-target}
folder=$profile
[ "$profile" != dev ] || folder=debug

cargo build --locked --profile "$profile" -p tagalong-cli --features train
program=$target/$folder/tagalong
# cargo-deb takes generated files from here, whatever the target folder is.
rm -rf target/deb
mkdir -p target/deb/completions
"$program" man -o target/deb/man
"$program" completions bash > target/deb/completions/tagalong
"$program" completions zsh > target/deb/completions/_tagalong
"$program" completions fish > target/deb/completions/tagalong.fish
cargo deb --locked --no-build --profile "$profile" -p tagalong-cli
