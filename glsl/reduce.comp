// A level of the blend's pyramid from the one below, of half its size: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer FineBuffer { float fine[]; };
layout(std430, binding = 1) buffer CoarseBuffer { float coarse[]; };

layout(push_constant) uniform Push { uint width; uint height; };  // of the level below, pixels

#include "pyramid.glsl"

void main() {
    uvec2 size = uvec2((width + 1u) / 2u, (height + 1u) / 2u);
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= size.x || j >= size.y) { return; }
    vec3 sum = vec3(0.0);
    for (int dy = -2; dy <= 2; ++dy) {
        int y = 2 * int(j) + dy;
        if (y < 0 || y >= int(height)) continue;
        for (int dx = -2; dx <= 2; ++dx) {
            int x = 2 * int(i) + dx;
            if (x < 0 || x >= int(width)) continue;
            uint at = 3u * (uint(y) * width + uint(x));
            sum += generating(dx) * generating(dy) * vec3(fine[at], fine[at + 1u], fine[at + 2u]);
        }
    }
    uint at = 3u * (j * size.x + i);
    coarse[at] = sum.x;
    coarse[at + 1u] = sum.y;
    coarse[at + 2u] = sum.z;
}
