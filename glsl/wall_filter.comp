// Takes off the pulses of each sample of a packet the polynomials over them that fit best, in place: what tissue makes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
// Orthonormal, one after the other, a value for each pulse.
layout(std430, binding = 0) restrict readonly buffer PolynomialBuffer { float polynomials[]; };
layout(std430, binding = 1) restrict buffer PulseBuffer { vec2 pulses[]; };
layout(push_constant) uniform Push {
    uint count;        // pulses
    uint lines;        // scanlines of each
    uint samples;      // samples of a scanline
    uint taken;        // polynomials
};

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= samples || l >= lines) { return; }
    uint each = lines * samples;
    uint at = l * samples + k;
    for (uint p = 0u; p < taken; ++p) {
        vec2 share = vec2(0.0);
        for (uint n = 0u; n < count; ++n) { share += polynomials[p * count + n] * pulses[n * each + at]; }
        for (uint n = 0u; n < count; ++n) { pulses[n * each + at] -= polynomials[p * count + n] * share; }
    }
}
