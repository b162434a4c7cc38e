#!/usr/bin/env bash
# Pictures of the scenes that ship, for the window's gallery: scenes/pictures/NAME.png. To be run after a change in a
# scene that is seen. A new scene needs a picture before the program can be built: any, to begin with.
set -eu
cd "$(dirname "$0")/.."
for scene in scenes/*.toml; do
  name=$(basename "$scene" .toml)
  cargo run --quiet --release --bin insonify -- render "$scene" --set imaging.image_height=200 -o "scenes/pictures/$name.png"
  rm "scenes/pictures/$name.json" # what it says is in the picture, too
done
