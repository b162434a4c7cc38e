// Accumulators to complex samples: fixed point undone, lateral smoothing, contact, noise.
//
// One thread per (line, sample); neighbouring threads read neighbouring samples of the same line.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) readonly buffer SurfaceBuffer { int surface[]; };
layout(std430, binding = 3) readonly buffer VolumeBuffer { int volume[]; };
layout(std430, binding = 4) buffer CounterBuffer { Counters counters; };
layout(std430, binding = 5) buffer LateralBuffer { float lateral[]; };
// Per line the coupled share of the transmit aperture; from frame.scanlines on how many of the elements
// before each one are not coupled.
layout(std430, binding = 6) readonly buffer ContactBuffer { float contact[]; };

// Accumulators at and beyond this magnitude may have lost an echo.
const int HEADROOM = 1 << 30;

bool saturated(int v) { return v >= HEADROOM || v <= -HEADROOM; }

// Elements before the place `at` (in elements from the face's edge) that are not coupled.
float air_before(float at) {
    uint i = min(uint(at), frame.scanlines - 1u);
    float here = contact[frame.scanlines + i];
    return here + (at - float(i)) * (contact[frame.scanlines + i + 1u] - here);
}

// What is left of the echoes of line l at sample k: coupled shares of what sends and what receives.
float coupling(uint l, uint k) {
    float count = float(frame.scanlines);
    float middle = frame.kind == KIND_PHASED ? 0.5 * count : float(l) + 0.5;
    float left = max(middle - rows[k].receive_reach, 0.0);
    float right = min(middle + rows[k].receive_reach, count);
    return contact[l] * (1.0 - (air_before(right) - air_before(left)) / (right - left));
}

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= frame.samples || l >= frame.scanlines) { return; }
    uint own = l * frame.samples + k;
    if (saturated(surface[2u * own]) || saturated(surface[2u * own + 1u])
        || saturated(volume[2u * own]) || saturated(volume[2u * own + 1u])) {
        atomicAdd(counters.saturated, 1u);
    }

    float sigma = rows[k].lateral_lines;
    int radius = sigma < 0.05 ? 0 : int(min(ceil(3.0 * sigma), 16.0));
    // Without smoothing the exponent of the only tap, j = 0, is 0 whatever this is.
    float falloff = -0.5 / max(sigma * sigma, 0.0025);
    bool voxel = (frame.flags & FLAG_VOXEL) != 0u;

    vec2 s = vec2(0.0);
    vec2 v = vec2(0.0);
    float weights = 0.0;
    float energy_here = 0.0;
    float energy_full = 0.0;
    for (int j = -radius; j <= radius; ++j) {
        float w = exp(falloff * float(j * j));
        energy_full += w * w;
        int line = int(l) + j;
        if (line < 0 || line >= int(frame.scanlines)) { continue; }
        uint i = 2u * (uint(line) * frame.samples + k);
        weights += w;
        energy_here += w * w;
        s += w * vec2(float(surface[i]), float(surface[i + 1u]));
        if (voxel) { v += w * vec2(float(volume[i]), float(volume[i + 1u])); }
    }
    // Speckle adds in power, surface echoes in amplitude: each keeps its level at the edges.
    if (voxel) {
        v *= sqrt(energy_full / energy_here);
    } else {
        v = vec2(float(volume[2u * own]), float(volume[2u * own + 1u]));
    }
    vec2 iq = (s * (rows[k].surface_undo / weights) + v * rows[k].volume_undo) * coupling(l, k);

    if (frame.noise > 0.0) {
        uvec4 bits = pcg4d(uvec4(l, k, frame.frame_index, frame.seed));
        iq += frame.noise * vec2(gaussian(bits.x), gaussian(bits.y));
    }
    lateral[2u * own] = iq.x;
    lateral[2u * own + 1u] = iq.y;
}
