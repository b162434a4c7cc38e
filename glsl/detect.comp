// Complex samples to log-compressed brightness 0..1: time-gain compensation, envelope, logarithm.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) readonly buffer IqBuffer { float iq[]; };
layout(std430, binding = 3) buffer LogBuffer { float log_image[]; };

const float DECIBEL_PER_OCTAVE = 6.020599913; // 20 log10(2)

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= frame.samples || l >= frame.scanlines) { return; }
    uint i = l * frame.samples + k;
    float envelope = length(vec2(iq[2u * i], iq[2u * i + 1u])) * rows[k].tgc;
    float level = DECIBEL_PER_OCTAVE * log2(max(envelope, 1e-20) * frame.inverse_reference);
    float v = clamp(1.0 + level * frame.inverse_range, 0.0, 1.0);
    log_image[i] = not_a_number(envelope) ? 0.0 : v;
}
