#!/usr/bin/env bash
# From a fresh machine with a Rust toolchain to a picture: installs what is missing, builds, renders.
# Arguments replace the default scene and settings: ./tools/start.sh scenes/phantom.toml --quality draft
set -eu
cd "$(dirname "$0")/.."
./tools/setup.sh run
cargo build --release --bin insonify
[ $# -gt 0 ] || set -- scenes/abdomen.toml
./target/release/insonify render "$@"
