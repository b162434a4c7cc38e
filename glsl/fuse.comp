// The acquired image and the simulated one, each converted where it has a share, mixed by the blurred mask. One work
// group is one tile.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = TILE, local_size_y = 4) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) restrict readonly buffer LogBuffer { float log_image[]; };
layout(std430, binding = 3) restrict readonly buffer GreyBuffer { uint grey[256]; };
layout(std430, binding = 4) restrict readonly buffer PrescanBuffer { vec2 prescan[]; };
layout(std430, binding = 5) restrict readonly buffer TileBuffer { uint tiles[]; };
layout(std430, binding = 6) restrict readonly buffer SumBuffer { vec2 sums[]; };
layout(std430, binding = 7) restrict buffer FusedBuffer { uint fused[]; };
// The acquired image, and the values that blending by bands adds to it; read only if blended by bands.
layout(std430, binding = 8) restrict readonly buffer BackgroundBuffer { float background[]; };
layout(std430, binding = 9) restrict readonly buffer ChangeBuffer { float change[]; };

#include "sector.glsl"
#include "simulated.glsl"
#include "tiles.glsl"
#include "share.glsl"

float acquired_level(Around a) {
    float near = mix(prescan[a.at.x].y, prescan[a.at.y].y, a.beyond.x);
    float far = mix(prescan[a.at.z].y, prescan[a.at.w].y, a.beyond.x);
    return mix(near, far, a.beyond.y);
}

// Starkov et al. 2019, II-C: I(x) = M(x) I_b(x) + (1 - M(x)) I_f(x), with the blurred mask M, background I_b and foreground I_f.
float mixed_level(Raster of, vec2 column_row, uint tile, uint pixel) {
    if (fusion.blend == BLEND_MULTIBAND) { return background[pixel] + change[pixel]; }
    Around a = around(of, column_row);
    float m = acquired_share(tile, pixel);
    float v = 0.0;
    if (m > 0.0) { v = m * acquired_level(a); }
    if (m < 1.0) { v += (1.0 - m) * (float(simulated_grey(a)) / 255.0); }
    return v;
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint top = gl_WorkGroupID.y * TILE;
    if (i >= frame.image_width) { return; }
    uint tile = tiles[tile_of(i, top)];
    Raster of = raster();
    uint width = frame.image_width;
    uint end = min(top + TILE, frame.image_height);
    for (uint j = top + gl_LocalInvocationID.y; j < end; j += gl_WorkGroupSize.y) {
        uint at = j * width + i;
        vec2 column_row;
        uint pixel = 0u;
        // A tile with nothing of either lies beside the sector.
        if ((tile & (TILE_ACQUIRED | TILE_SIMULATED)) != 0u && sector(of, i, j, column_row)) {
            pixel = 0xff000000u | (grey_level(mixed_level(of, column_row, tile, at)) * 0x010101u);
        }
        fused[at] = pixel;
    }
}
