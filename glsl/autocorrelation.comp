// The autocorrelation of each sample of a packet from pulse to pulse, and its power.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer PulseBuffer { vec2 pulses[]; };
// Three floats for each sample.
layout(std430, binding = 1) restrict buffer LagBuffer { float lags[]; };
layout(push_constant) uniform Push {
    uint count;        // pulses
    uint lines;        // scanlines of each
    uint samples;      // samples of a scanline
};

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= samples || l >= lines) { return; }
    uint each = lines * samples;
    uint at = l * samples + k;
    vec2 before = pulses[at];
    float power = dot(before, before);
    vec2 next = vec2(0.0);
    for (uint n = 1u; n < count; ++n) {
        vec2 s = pulses[n * each + at];
        power += dot(s, s);
        next += vec2(s.x * before.x + s.y * before.y, s.y * before.x - s.x * before.y);
        before = s;
    }
    next /= float(max(count, 2u) - 1u);
    lags[3u * at] = next.x;
    lags[3u * at + 1u] = next.y;
    lags[3u * at + 2u] = power / float(count);
}
