// Speckle reduction and edge enhancement of the log-compressed scanlines, in place: mean and variance of the neighbourhood,
// from the moments across the scanlines, and by how much more or less a sample differs from the mean.
//
// A thread computes AXIAL_SAMPLES neighbouring samples of a scanline: it reads moments once for all of them that it reaches.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer MomentBuffer { vec2 moments[]; };
layout(std430, binding = 2) restrict buffer LogBuffer { float log_image[]; };
layout(push_constant) uniform Push {
    float neighbourhood;       // its deviation, over that of the point-spread function
    float speckle_reduction;   // 0 to 1
    float edge_enhancement;    // 0: none
    float speckle;             // variance of fully developed speckle, squared levels
};

#include "smooth.glsl"

const float LEAST_VARIANCE = 1e-12;   // below what rounding makes of levels that are all alike

void main() {
    int samples = int(frame.samples);
    int first = int(gl_GlobalInvocationID.x) * AXIAL_SAMPLES;
    uint l = gl_GlobalInvocationID.y;
    if (first >= samples || l >= frame.scanlines) { return; }
    int line = int(l) * samples;

    float sigma = neighbourhood * frame.axial_sigma;
    int reach = reach_of(sigma, AXIAL_REACH);
    float falloff = falloff_of(sigma);
    vec2 sums[AXIAL_SAMPLES];
    float weights[AXIAL_SAMPLES];
    // tap[n] is the weight, in output sample first + n, of the moments that are being read.
    float tap[AXIAL_SAMPLES];
    for (int n = 0; n < AXIAL_SAMPLES; ++n) {
        sums[n] = vec2(0.0);
        weights[n] = 0.0;
        tap[n] = 0.0;
    }
    for (int j = -reach; j < AXIAL_SAMPLES + reach; ++j) {
        for (int n = AXIAL_SAMPLES - 1; n > 0; --n) { tap[n] = tap[n - 1]; }
        tap[0] = mix(0.0, exp(falloff * float(j * j)), abs(j) <= reach);
        int k = first + j;
        if (k < 0 || k >= samples) { continue; }
        vec2 read = moments[line + k];
        for (int n = 0; n < AXIAL_SAMPLES; ++n) {
            weights[n] += tap[n];
            sums[n] += tap[n] * read;
        }
    }
    for (int n = 0; n < AXIAL_SAMPLES; ++n) {
        int k = first + n;
        if (k >= samples) { break; }
        vec2 mean = sums[n] / weights[n];
        float variance = max(mean.y - mean.x * mean.x, LEAST_VARIANCE);
        float smoothed = speckle_reduction * min(speckle / variance, 1.0);
        float differs = (1.0 + edge_enhancement) * (1.0 - smoothed) * (log_image[line + k] - mean.x);
        log_image[line + k] = clamp(mean.x + differs, 0.0, 1.0);
    }
}
