// The autocorrelations of a packet averaged along the scanlines, over as many samples of the box as the gate reaches.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer LagBuffer { float lags[]; };
layout(std430, binding = 1) restrict buffer CorrelationBuffer { float correlations[]; };
layout(push_constant) uniform Push {
    uint lines;        // scanlines
    uint samples;      // samples of a scanline
    uint reach;        // samples of the gate on each side
};

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= samples || l >= lines) { return; }
    uint line = l * samples;
    uint begin = k - min(k, reach);
    uint end = min(k + reach + 1u, samples);
    vec3 sum = vec3(0.0);
    for (uint j = begin; j < end; ++j) {
        uint at = 3u * (line + j);
        sum += vec3(lags[at], lags[at + 1u], lags[at + 2u]);
    }
    sum /= float(end - begin);
    uint at = 3u * (line + k);
    correlations[at] = sum.x;
    correlations[at + 1u] = sum.y;
    correlations[at + 2u] = sum.z;
}
