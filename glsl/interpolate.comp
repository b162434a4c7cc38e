// Vertices, shading normals or displacements between keyframes: a weighted sum of up to four
// vectors, one thread per vector, within the one buffer that holds all keyframes. Averaged normals
// are packed, a word each.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 128) in;

const uint SUM = 0u;
const uint UNIT = 1u;
const uint PACKED = 2u;

layout(push_constant) uniform Push {
    uint count;        // vectors
    uint target;       // first vector written; overlaps no source that is read, or is that source
    uint kind;         // SUM; UNIT: results have length 1; PACKED: they too, and all are packed with their coherence
    uint stride;       // words from one vector to the next: 3, or 4 of which the last stays as it is; packed 1
    uvec4 sources;     // first vector of each keyframe
    vec4 weights;      // a keyframe of weight 0 is not read
} push;

layout(std430, binding = 0) buffer Values { uint values[]; };

#include "octahedron.glsl"

vec4 part(uint source, float weight, uint i) {
    if (weight == 0.0) return vec4(0.0);
    uint at = push.stride * (source + i);
    if (push.kind == PACKED) return weight * unpack_mean(values[at]);
    return vec4(weight * uintBitsToFloat(uvec3(values[at], values[at + 1u], values[at + 2u])), 0.0);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return;
    vec4 v = part(push.sources.x, push.weights.x, i) + part(push.sources.y, push.weights.y, i)
        + part(push.sources.z, push.weights.z, i) + part(push.sources.w, push.weights.w, i);
    if (push.kind == UNIT) {
        // Scaled first: the square of a short vector may be too small for a float.
        float size = max(max(abs(v.x), abs(v.y)), abs(v.z));
        if (size > 0.0) v.xyz = normalize(v.xyz / size);
    }
    uint at = push.stride * (push.target + i);
    if (push.kind == PACKED) {
        values[at] = pack_mean(v);
    } else {
        values[at] = floatBitsToUint(v.x);
        values[at + 1u] = floatBitsToUint(v.y);
        values[at + 2u] = floatBitsToUint(v.z);
    }
}
