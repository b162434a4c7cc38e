// Axial point-spread function, a real Gaussian along each scanline of the complex baseband, and detection:
// time-gain compensation, envelope, logarithm.
//
// A thread computes AXIAL_SAMPLES neighbouring samples of a scanline: it reads a sample once for all of them
// that it reaches.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer LateralBuffer { vec2 lateral[]; };
layout(std430, binding = 3) restrict buffer IqBuffer { vec2 iq[]; };
layout(std430, binding = 4) restrict buffer LogBuffer { float log_image[]; };

const float DECIBEL_PER_OCTAVE = 6.020599913; // 20 log10(2)

// Starkov et al. 2019, II-A, image formation: the axial part of a separable point-spread function, and the envelope of the sum of surface
// and scatterer echoes.
void main() {
    int samples = int(frame.samples);
    int first = int(frame.first_sample + gl_GlobalInvocationID.x * uint(AXIAL_SAMPLES));
    uint l = frame.beam_first + gl_GlobalInvocationID.y;
    if (first >= samples || l >= frame.beam_first + frame.beam_lines) { return; }
    int line = int(l) * samples;

    float sigma = frame.axial_sigma;
    int radius = int(min(ceil(4.0 * sigma), float(AXIAL_REACH)));
    vec2 sums[AXIAL_SAMPLES];
    // tap[n] is the weight, in output sample first + n, of the sample that is being read.
    float tap[AXIAL_SAMPLES];
    for (int n = 0; n < AXIAL_SAMPLES; ++n) {
        sums[n] = vec2(0.0);
        tap[n] = 0.0;
    }
    for (int j = -radius; j < AXIAL_SAMPLES + radius; ++j) {
        for (int n = AXIAL_SAMPLES - 1; n > 0; --n) { tap[n] = tap[n - 1]; }
        tap[0] = j == 0 ? 1.0 : exp(-0.5 * float(j * j) / (sigma * sigma));
        int k = first + j;
        if (k < 0 || k >= samples) { continue; }
        vec2 heard = lateral[line + k];
        for (int n = 0; n < AXIAL_SAMPLES; ++n) {
            // Beyond the reach there is no tap, not even one of weight 0, so that NaN and infinity do not spread.
            if (abs(j - n) <= radius) { sums[n] += tap[n] * heard; }
        }
    }
    for (int n = 0; n < AXIAL_SAMPLES; ++n) {
        int k = first + n;
        if (k >= samples) { break; }
        iq[line + k] = sums[n];
        float envelope = length(sums[n]) * rows[k].tgc;
        float level = DECIBEL_PER_OCTAVE * log2(max(envelope, 1e-20) * frame.inverse_reference);
        float v = clamp(1.0 + level * frame.inverse_range, 0.0, 1.0);
        log_image[line + k] = not_a_number(envelope) ? 0.0 : v;
    }
}
