// The mixed image with its acquired pixels coloured, by their share: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) readonly buffer FusedBuffer { uint fused[]; };
layout(std430, binding = 3) readonly buffer MaskBuffer { float mask[]; };
layout(std430, binding = 4) readonly buffer SumBuffer { vec2 sums[]; };
layout(std430, binding = 5) readonly buffer TileBuffer { uint tiles[]; };
layout(std430, binding = 6) buffer TintedBuffer { uint tinted[]; };

// Opacity of the colour over a pixel that is all acquired; the colour, red in the lowest byte.
layout(push_constant) uniform Push { float opacity; uint colour; };

#include "tiles.glsl"
#include "share.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    uint at = j * frame.image_width + i;
    uint pixel = fused[at];
    if ((pixel >> 24u) != 0u) {
        // Blended by bands, each has its own width of border; the mask is the middle of all.
        float m = fusion.blend == BLEND_MULTIBAND ? clamp(mask[2u * at], 0.0, 1.0)
            : acquired_share(tiles[tile_of(i, j)], at);
        float share = opacity * m;
        uint mixed = 0xff000000u;
        for (uint shift = 0u; shift < 24u; shift += 8u) {
            float grey = float((pixel >> shift) & 0xffu);
            float hue = float((colour >> shift) & 0xffu);
            mixed |= uint(floor(grey + share * (hue - grey) + 0.5)) << shift;
        }
        pixel = mixed;
    }
    tinted[at] = pixel;
}
