#!/bin/sh
# Builds CapSense and runs a scene: scripts/run.sh [SCENE] [--out DIR] [--quiet].
# Without a scene, the built-in steel bar. Installs a C linker if there is none.
set -eu
root="$(cd "$(dirname "$0")/.." && pwd)"
. "$root/scripts/install.sh"
need_cargo
need_linker
exec cargo run --manifest-path "$root/Cargo.toml" --release --locked -- run "$@"
