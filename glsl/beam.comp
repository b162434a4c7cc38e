// From accumulators to complex samples: fixed point to float, lateral smoothing, contact, noise.
//
// Surfaces' echoes are smoothed to the width of the beam; those of scatterers, each heard by the lines in whose strips it
// lies, by what the strip lacks of it. Point targets are as wide as the beam already.
//
// A thread computes one sample of BEAM_LINES neighbouring scanlines: it reads an echo once for all of
// them that it reaches. Neighbouring threads read neighbouring samples of the same scanline.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer SurfaceBuffer { ivec2 surface_echoes[]; };
layout(std430, binding = 3) restrict readonly buffer VolumeBuffer { ivec2 volume_echoes[]; };
layout(std430, binding = 4) restrict buffer CounterBuffer { Counters counters; };
layout(std430, binding = 5) restrict buffer LateralBuffer { vec2 lateral[]; };
// For each scanline of the face the coupled share of the transmit aperture; then, for each element, the
// number of elements before it that are not coupled.
layout(std430, binding = 6) restrict readonly buffer ContactBuffer { float contact[]; };
layout(std430, binding = 7) restrict readonly buffer PointBuffer { ivec2 point_echoes[]; };   // where there are point targets

const int HEADROOM = int(ECHO_LIMIT);

bool saturated(ivec2 v) { return any(greaterThanEqual(v, ivec2(HEADROOM))) || any(lessThanEqual(v, ivec2(-HEADROOM))); }

#include "contact.glsl"
#include "smooth.glsl"

void main() {
    uint k = frame.first_sample + gl_GlobalInvocationID.x;
    int first = int(frame.beam_first) + int(gl_WorkGroupID.y) * BEAM_LINES;
    int samples = int(frame.samples);
    int scanlines = int(frame.scanlines);
    if (k >= frame.samples) { return; }

    // Of surfaces, and of scatterers.
    int surface_reach = reach_of(rows[k].lateral_lines, LATERAL_REACH);
    int volume_reach = reach_of(rows[k].strip_lines, LATERAL_REACH);
    vec2 falloff = vec2(falloff_of(rows[k].lateral_lines), falloff_of(rows[k].strip_lines));
    int reach_both = max(surface_reach, volume_reach);

    vec2 s[BEAM_LINES];
    vec2 v[BEAM_LINES];
    float weights[BEAM_LINES];
    float energies[BEAM_LINES];
    // tap[n] are the weights, in output scanline first + n, of the scanline that is being read.
    vec2 tap[BEAM_LINES];
    for (int n = 0; n < BEAM_LINES; ++n) {
        s[n] = vec2(0.0);
        v[n] = vec2(0.0);
        weights[n] = 0.0;
        energies[n] = 0.0;
        tap[n] = vec2(0.0);
    }
    float energy_full = 0.0;
    uint full = 0u;
    for (int j = -reach_both; j < BEAM_LINES + reach_both; ++j) {
        for (int n = BEAM_LINES - 1; n > 0; --n) { tap[n] = tap[n - 1]; }
        tap[0] = mix(vec2(0.0), exp(falloff * float(j * j)), lessThanEqual(ivec2(abs(j)), ivec2(surface_reach, volume_reach)));
        energy_full += tap[0].y * tap[0].y;
        int line = first + j;
        if (line < 0 || line >= scanlines) { continue; }
        uint at = uint(line * samples) + k;
        ivec2 echo = surface_echoes[at];
        if (j >= 0 && j < BEAM_LINES && saturated(echo)) { full |= 1u << uint(j); }
        vec2 e = vec2(echo);
        for (int n = 0; n < BEAM_LINES; ++n) {
            weights[n] += tap[n].x;
            s[n] += tap[n].x * e;
        }
        echo = volume_echoes[at];
        if (j >= 0 && j < BEAM_LINES && saturated(echo)) { full |= 1u << uint(j); }
        e = vec2(echo);
        for (int n = 0; n < BEAM_LINES; ++n) {
            energies[n] += tap[n].y * tap[n].y;
            v[n] += tap[n].y * e;
        }
    }
    float surface_undo = rows[k].surface_undo;
    float volume_undo = rows[k].volume_undo;
    float reach = rows[k].receive_reach;
    for (int n = 0; n < BEAM_LINES; ++n) {
        uint l = uint(first + n);
        if (l >= frame.beam_first + frame.beam_lines) { break; }
        uint own = l * frame.samples + k;
        // Speckle adds in power, surface echoes add in amplitude; each is normalised to keep its level at the edges.
        vec2 scatterers = v[n] * sqrt(energy_full / energies[n]);
        if (frame.points > 0u) {
            ivec2 points = point_echoes[own];
            if (saturated(points)) { full |= 1u << uint(n); }
            scatterers += vec2(points);
        }
        vec2 iq = (s[n] * (surface_undo / weights[n]) + scatterers * volume_undo) * coupling(l, reach);
        if (frame.noise > 0.0) {
            uvec4 bits = pcg4d(uvec4(frame.first_line + l, k, frame.frame_index, frame.seed));
            iq += frame.noise * vec2(gaussian(bits.x), gaussian(bits.y));
        }
        lateral[own] = iq;
    }
    if (full != 0u) { atomicAdd(counters.saturated, uint(bitCount(full))); }
}
