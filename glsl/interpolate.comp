// Vertices, shading normals or displacements between keyframes: a weighted sum of up to four
// vectors, one thread per vector, within the one buffer that holds all keyframes.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 128) in;

layout(push_constant) uniform Push {
    uint count;        // vectors
    uint target;       // first vector written; overlaps no source that is read, or is that source
    uint unit;         // 1: results are brought to length 1
    uint stride;       // floats from one vector to the next: 3, or 4 of which the last stays as it is
    uvec4 sources;     // first vector of each keyframe
    vec4 weights;      // a keyframe of weight 0 is not read
} push;

layout(std430, binding = 0) buffer Values { float values[]; };

vec3 part(uint source, float weight, uint i) {
    if (weight == 0.0) return vec3(0.0);
    uint at = push.stride * (source + i);
    return weight * vec3(values[at], values[at + 1u], values[at + 2u]);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return;
    vec3 v = part(push.sources.x, push.weights.x, i) + part(push.sources.y, push.weights.y, i)
        + part(push.sources.z, push.weights.z, i) + part(push.sources.w, push.weights.w, i);
    if (push.unit != 0u) {
        // The square of a short vector may be too small for a float.
        float size = max(max(abs(v.x), abs(v.y)), abs(v.z));
        if (size > 0.0) v = normalize(v / size);
    }
    uint at = push.stride * (push.target + i);
    values[at] = v.x;
    values[at + 1u] = v.y;
    values[at + 2u] = v.z;
}
