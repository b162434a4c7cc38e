// The share of the acquired image in a pixel, from 0 to 1: the mask, blurred, through the blend's curve. The includer
// declares fusion and sums[], and includes tiles.glsl.

// Starkov et al. 2019, II-C, figure 10: the scan-converted mask blurred by a box.
float acquired_share(uint tile, uint pixel) {
    uint seen = tile & (TILE_ACQUIRED | TILE_SIMULATED);
    if (seen == TILE_ACQUIRED) return 1.0;
    if (seen == TILE_SIMULATED) return 0.0;
    // Division may round; if the whole box is outside, the share must be exactly 1.
    vec2 sum = sums[pixel];
    float m = sum.x >= sum.y ? 1.0 : sum.x / sum.y;
    if (fusion.blend == BLEND_SMOOTH) { m = m * m * (3.0 - 2.0 * m); }
    return m;
}
