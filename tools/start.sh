#!/usr/bin/env bash
# From a fresh machine with a Rust toolchain to a picture: installs what is missing, builds, opens the
# window; without a display it renders an image. Arguments replace the default scene and settings:
# ./tools/start.sh scenes/phantom.toml --quality draft
set -eu
cd "$(dirname "$0")/.."
./tools/setup.sh run
cargo build --release --bin insonify
[ $# -gt 0 ] || set -- scenes/abdomen.toml
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  ./target/release/insonify view "$@"
else
  echo "start: no display (neither DISPLAY nor WAYLAND_DISPLAY is set): rendering an image instead of opening the window" >&2
  ./target/release/insonify render "$@"
fi
