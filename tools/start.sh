#!/usr/bin/env bash
# From a fresh machine with a Rust toolchain to a picture: installs what is missing, builds, opens the
# window; without a display it renders an image. Arguments choose scene and settings:
# ./tools/start.sh scenes/phantom.toml --quality draft
set -eu
cd "$(dirname "$0")/.."
./tools/setup.sh run
cargo build --release --bin insonify
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  case ${1:-} in
  "") ./target/release/insonify ;;
  *) ./target/release/insonify view "$@" ;;
  esac
else
  echo "start: no display (neither DISPLAY nor WAYLAND_DISPLAY is set): rendering an image instead of opening the window" >&2
  [ $# -gt 0 ] || set -- scenes/abdomen.toml -o out/abdomen.png
  ./target/release/insonify render "$@"
fi
