// Axial point-spread function: a real Gaussian along each line of the complex baseband.
//
// One thread per (line, sample); a workgroup stages its stretch of the line and the kernel's reach
// on both sides in shared memory, so that each sample is read once from memory.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 128) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer LateralBuffer { float lateral[]; };
layout(std430, binding = 2) buffer IqBuffer { float iq[]; };

const int THREADS = 128;
const int REACH = 32;
const int STAGED = THREADS + 2 * REACH;

shared float staged_re[STAGED];
shared float staged_im[STAGED];
shared float taps[REACH + 1];

void main() {
    int local = int(gl_LocalInvocationID.x);
    int first = int(gl_WorkGroupID.x) * THREADS - REACH;
    uint l = gl_GlobalInvocationID.y;
    int samples = int(frame.samples);
    bool inside = l < frame.scanlines;

    float sigma = frame.axial_sigma;
    int radius = int(min(ceil(4.0 * sigma), float(REACH)));
    if (local <= REACH) {
        taps[local] = local == 0 ? 1.0 : exp(-0.5 * float(local * local) / (sigma * sigma));
    }
    for (int i = local; i < STAGED; i += THREADS) {
        int k = first + i;
        bool held = inside && k >= 0 && k < samples;
        uint at = 2u * (l * frame.samples + uint(max(k, 0)));
        float re = 0.0;
        float im = 0.0;
        if (held) {
            re = lateral[at];
            im = lateral[at + 1u];
        }
        staged_re[i] = re;
        staged_im[i] = im;
    }
    barrier();

    int k = first + REACH + local;
    if (!inside || k >= samples) { return; }
    vec2 sum = vec2(0.0);
    for (int j = -radius; j <= radius; ++j) {
        int i = local + REACH + j;
        sum += taps[abs(j)] * vec2(staged_re[i], staged_im[i]);
    }
    uint at = 2u * (l * frame.samples + uint(k));
    iq[at] = sum.x;
    iq[at + 1u] = sum.y;
}
