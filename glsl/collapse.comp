// Adds one level of the blend's pyramid to the result of the coarser ones: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer FineBuffer { float fine[]; };
layout(std430, binding = 1) readonly buffer CoarseBuffer { float coarse[]; };
layout(std430, binding = 2) readonly buffer CoarseChangeBuffer { float coarse_change[]; };
layout(std430, binding = 3) buffer ChangeBuffer { float change[]; };

layout(push_constant) uniform Push {
    uint width; uint height;  // of the finer level, pixels
    uint coarsest;            // 1: there is no coarser level
};

#include "pyramid.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= width || j >= height) { return; }
    uint at = j * width + i;
    vec3 here = vec3(fine[3u * at], fine[3u * at + 1u], fine[3u * at + 2u]);
    // The coarser level, interpolated at this pixel: of the difference, where it has weight, and of
    // its blended value.
    vec2 difference = vec2(0.0);
    vec2 blended = vec2(0.0);
    if (coarsest == 0u) {
        ivec2 size = ivec2((width + 1u) / 2u, (height + 1u) / 2u);
        // The parents to which this pixel has contributed.
        for (int y = (int(j) + 3) / 2 - 2; y <= int(j) / 2 + 1; ++y) {
            if (y < 0 || y >= size.y) continue;
            for (int x = (int(i) + 3) / 2 - 2; x <= int(i) / 2 + 1; ++x) {
                if (x < 0 || x >= size.x) continue;
                float w = generating(int(i) - 2 * x) * generating(int(j) - 2 * y);
                uint parent = uint(y * size.x + x);
                difference += w * vec2(coarse[3u * parent], coarse[3u * parent + 1u]);
                blended += w * coarse[3u * parent + 2u] * vec2(coarse_change[parent], 1.0);
            }
        }
    }
    float own = here.y > 0.0 ? here.x / here.y : 0.0;
    float weight = here.z > 0.0 ? here.y / here.z : 0.0;
    float expected = difference.y > 0.0 ? difference.x / difference.y : 0.0;
    float carried = blended.y > 0.0 ? blended.x / blended.y : 0.0;
    change[at] = weight * (own - expected) + carried;
}
