// Tiles of the image, TILE pixels along each edge. The includer declares frame and tiles[].

uint tile_of(uint i, uint j) { return j / TILE * ((frame.image_width + TILE - 1u) / TILE) + i / TILE; }
