#version 460
// Expected power of the echoes of each sample, and the share of it that was reflected on its way. One thread is a sample.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer ContactBuffer { float contact[]; };
layout(std430, binding = 3) restrict readonly buffer ExpectedBuffer { uvec4 expected[]; };
// The surfaces' echoes as samples of IQ: all, and those that came straight.
layout(std430, binding = 4) restrict readonly buffer SurfaceIqBuffer { vec2 surface_iq[]; };
layout(std430, binding = 5) restrict readonly buffer DirectIqBuffer { vec2 direct_iq[]; };
layout(std430, binding = 6) restrict buffer LabelBuffer { Label labels[]; };

#include "contact.glsl"

const float DECIBEL_PER_OCTAVE = 3.010299957; // 10 log10(2)
const float HIGH_WORD = 4294967296.0;

float power_of(uvec2 sum) { return (HIGH_WORD * float(sum.y) + float(sum.x)) / POWER_UNITS; }

void main() {
    int k = int(gl_GlobalInvocationID.x);
    uint l = gl_GlobalInvocationID.y;
    int samples = int(frame.samples);
    if (k >= samples || l >= frame.scanlines) return;
    int line = int(l) * samples;
    // The kernels across and along the lines sum amplitudes; of scatterers, whose phases are random, they sum powers.
    float sigma = frame.axial_sigma;
    int radius = int(min(ceil(4.0 * sigma), float(AXIAL_REACH)));
    vec2 speckle = vec2(0.0);
    float whole = 0.0;
    for (int j = -radius; j <= radius; ++j) {
        float tap = j == 0 ? 1.0 : exp(-float(j * j) / (sigma * sigma));
        whole += tap;
        int at = k + j;
        if (at < 0 || at >= samples) continue;
        float lines = rows[at].strip_lines;
        int reach = lines < 0.05 ? 0 : int(min(ceil(3.0 * lines), float(LATERAL_REACH)));
        vec2 across = vec2(0.0);
        float inside = 0.0;
        for (int i = -reach; i <= reach; ++i) {
            int beside = int(l) + i;
            if (beside < 0 || beside >= int(frame.scanlines)) continue;
            float share = i == 0 ? 1.0 : exp(-float(i * i) / (lines * lines));
            inside += share;
            uvec4 sums = expected[beside * samples + at];
            across += share * vec2(power_of(sums.xy), power_of(sums.zw));
        }
        speckle += tap * across / inside;
    }
    float coupled = coupling(l, rows[k].receive_reach);
    speckle *= coupled * coupled / whole;
    uint at = uint(line + k);
    vec2 all = surface_iq[at], direct = direct_iq[at];
    vec2 both = speckle + vec2(dot(direct, direct), dot(all - direct, all - direct));
    float sum = both.x + both.y;
    labels[at].level = DECIBEL_PER_OCTAVE * log2(max(speckle.x + speckle.y + dot(all, all), LEAST_POWER));
    labels[at].reverberation = sum > 0.0 ? both.y / sum : 0.0;
    labels[at].unused = 0.0;
}
