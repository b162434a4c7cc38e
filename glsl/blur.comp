// Box sums along one axis of the image, of the converted mask and of its weight: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) readonly buffer SourceBuffer { float source[]; };
layout(std430, binding = 3) buffer SumBuffer { float sums[]; };

layout(push_constant) uniform Push { uint down; };  // 0: along rows, 1: along columns

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    // An even box reaches one pixel farther to the left and up: half a pixel of shift.
    int first = -int(fusion.blur / 2u);
    int last = first + int(fusion.blur) - 1;
    vec2 sum = vec2(0.0);
    for (int tap = first; tap <= last; ++tap) {
        int x = down == 0u ? clamp(int(i) + tap, 0, int(frame.image_width) - 1) : int(i);
        int y = down == 0u ? int(j) : clamp(int(j) + tap, 0, int(frame.image_height) - 1);
        uint at = 2u * (uint(y) * frame.image_width + uint(x));
        sum += vec2(source[at], source[at + 1u]);
    }
    uint at = 2u * (j * frame.image_width + i);
    sums[at] = sum.x;
    sums[at + 1u] = sum.y;
}
