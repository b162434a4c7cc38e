// Scan conversion of the mask, where it is blurred, and of the acquired volume, where that image is wanted for itself:
// bilinear. One work group is one tile.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = TILE, local_size_y = 4) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TileBuffer { uint tiles[]; };
layout(std430, binding = 2) restrict readonly buffer PrescanBuffer { vec2 prescan[]; };
layout(std430, binding = 3) restrict buffer MaskBuffer { vec2 mask[]; };
layout(std430, binding = 4) restrict buffer BackgroundBuffer { float background[]; };

#include "sector.glsl"
#include "tiles.glsl"

vec2 bilinear(Around a) {
    vec2 near = mix(prescan[a.at.x], prescan[a.at.y], a.beyond.x);
    vec2 far = mix(prescan[a.at.z], prescan[a.at.w], a.beyond.x);
    return mix(near, far, a.beyond.y);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint top = gl_WorkGroupID.y * TILE;
    if (i >= frame.image_width) { return; }
    uint tile = tiles[tile_of(i, top)];
    if ((tile & (TILE_BLURRED | TILE_WHOLE)) == 0u) { return; }
    Raster of = raster();
    uint width = frame.image_width;
    uint end = min(top + TILE, frame.image_height);
    for (uint j = top + gl_LocalInvocationID.y; j < end; j += gl_WorkGroupSize.y) {
        vec2 at;
        bool inside = sector(of, i, j, at);
        vec2 v = vec2(0.0);
        if (inside) { v = bilinear(around(of, at)); }
        uint pixel = j * width + i;
        mask[pixel] = vec2(v.x, inside ? 1.0 : 0.0);
        if ((tile & TILE_WHOLE) != 0u) { background[pixel] = v.y; }
    }
}
