// Box sums down the columns of the mask, an image of pairs of values, written with rows and columns exchanged:
// run twice, it sums over squares and the image stands upright again.
//
// A thread computes BLUR_SUMS neighbouring sums of a column: the pixels common to all of them are read and
// added once. Nothing is subtracted, so that NaN affects only the sums that include it. A work group lies within one
// tile, and does nothing where no pixel that mixes both images needs its sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = TILE) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) restrict readonly buffer MaskBuffer { vec2 mask[]; };
layout(std430, binding = 3) restrict buffer SumBuffer { vec2 sums[]; };
layout(std430, binding = 4) restrict readonly buffer TileBuffer { uint tiles[]; };

layout(push_constant) uniform Push { uint turned; };  // 1: the mask has rows and columns exchanged

#include "tiles.glsl"

// Beyond the image's edge its outermost pixels are repeated.
vec2 read(int x, int y, int width, int height) { return mask[clamp(y, 0, height - 1) * width + x]; }

void main() {
    int x = int(gl_GlobalInvocationID.x);
    int first = int(gl_GlobalInvocationID.y) * BLUR_SUMS;
    int width = int(turned == 0u ? frame.image_width : frame.image_height);
    int height = int(turned == 0u ? frame.image_height : frame.image_width);
    if (x >= width || first >= height) { return; }
    uint tile = turned == 0u ? tile_of(uint(x), uint(first)) : tile_of(uint(first), uint(x));
    uint wanted = turned == 0u ? TILE_BLURRED : TILE_ACQUIRED | TILE_SIMULATED;
    if ((tiles[tile] & wanted) != wanted) { return; }
    int taps = int(fusion.blur);
    // An even box reaches one pixel farther up than down, a shift by half a pixel.
    int top = first - taps / 2;
    vec2 sum[BLUR_SUMS];
    for (int n = 0; n < BLUR_SUMS; ++n) { sum[n] = vec2(0.0); }
    if (taps < BLUR_SUMS) {
        for (int n = 0; n < BLUR_SUMS; ++n) {
            for (int i = n; i < n + taps; ++i) { sum[n] += read(x, top + i, width, height); }
        }
    } else {
        // The last pixel of the first sum is the first one common to all. Each later sum lacks one more of the pixels
        // before it, and has one more of those after the end of the first sum.
        vec2 shared_sum = vec2(0.0);
        for (int i = BLUR_SUMS - 1; i < taps; ++i) { shared_sum += read(x, top + i, width, height); }
        vec2 before = vec2(0.0);
        sum[BLUR_SUMS - 1] = shared_sum;
        for (int n = BLUR_SUMS - 2; n >= 0; --n) {
            before += read(x, top + n, width, height);
            sum[n] = shared_sum + before;
        }
        vec2 behind = vec2(0.0);
        for (int n = 1; n < BLUR_SUMS; ++n) {
            behind += read(x, top + taps - 1 + n, width, height);
            sum[n] += behind;
        }
    }
    for (int n = 0; n < BLUR_SUMS; ++n) {
        if (first + n < height) { sums[x * height + first + n] = sum[n]; }
    }
}
