#version 460
// Expected power of the scatterers' echoes in each sample, from the segments of its scanline. One work group is a block
// of samples of a scanline, one thread a sample.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 4) restrict readonly buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 5) restrict readonly buffer SegmentCountBuffer { uint segment_count[]; };
layout(std430, binding = 6) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };
// Of each sample, for each layer, the power of speckle of 0 dB that nothing weakens.
layout(std430, binding = 7) restrict readonly buffer SpeckleBuffer { float speckle[]; };
// Power that came straight, and power that was reflected before: 64 bits each, the lower half first.
layout(std430, binding = 8) restrict buffer ExpectedBuffer { uvec4 expected[]; };

layout(std430, binding = 9) restrict readonly buffer ApertureBuffer { Aperture apertures[]; };

#include "transform.glsl"
#include "probe.glsl"
#include "stretch.glsl"

const uint BLOCK = 64u;
const float HIGH_WORD = 4294967296.0;

// Some segments of a line that reach the block.
shared uint reaching[BLOCK];
shared uint reaching_count;

// The sum of whole numbers does not depend on the order of the segments, which is any.
uvec2 add(uvec2 sum, float power) {
    float units = min(power * POWER_UNITS, 1e19);
    float high = floor(units / HIGH_WORD);
    uint low = uint(units - HIGH_WORD * high);
    uint added = sum.x + low;
    return uvec2(added, sum.y + uint(high) + (added < low ? 1u : 0u));
}

// Power of the echoes of a segment in sample k: it has the scatterers that lie nearer to this sample than to others.
float power_of(Stretch s, uint k, uint layer) {
    float from = max(kappa_at(s, 0.0), float(k) - 0.5), to = min(kappa_at(s, s.extent), float(k) + 0.5);
    if (!(to > from)) return 0.0;
    float x = distance_at(s, 0.5 * (from + to));
    float amplitude = s.weight * thinning(s, x, k) * exp(-s.absorption * x) * exp2(tissues[s.tissue].level);
    float power = amplitude * amplitude;
    // In faster tissue a sample is longer and holds more scatterers.
    if ((frame.flags & FLAG_VOXEL) == 0u) {
        float level = scattered(s, x, k);
        power *= s.speed / frame.speed * level * level;
    }
    return power * (to - from) * speckle[k * frame.layers + layer];
}

void main() {
    uint scanline = gl_WorkGroupID.x;
    uint thread = gl_LocalInvocationID.x;
    uint begin = gl_WorkGroupID.y * BLOCK;
    uint k = begin + thread;
    uvec2 direct = uvec2(0u), reflected = uvec2(0u);
    for (uint layer = 0u; layer < frame.layers; ++layer) {
        uint line = layer * frame.scanlines + scanline;
        uint count = min(segment_count[line], frame.segment_capacity);
        uint first = line * frame.segment_capacity;
        for (uint batch = 0u; batch < count; batch += BLOCK) {
            barrier();
            if (thread == 0u) reaching_count = 0u;
            barrier();
            if (batch + thread < count) {
                Stretch s = world_stretch(first + batch + thread);
                bool reaches = kappa_at(s, s.extent) > float(begin) - 1.0 && kappa_at(s, 0.0) < float(begin + BLOCK);
                if (reaches && sounds(s)) reaching[atomicAdd(reaching_count, 1u)] = first + batch + thread;
            }
            barrier();
            uint found = reaching_count;
            for (uint i = 0u; i < found && k < frame.samples; ++i) {
                Stretch s = world_stretch(reaching[i]);
                float power = power_of(s, k, layer);
                if (s.reflected) reflected = add(reflected, power); else direct = add(direct, power);
            }
        }
    }
    if (k >= frame.samples) return;
    uint at = scanline * frame.samples + k;
    uvec4 before = expected[at];
    // Of the paths that were traced before these.
    direct = uvec2(direct.x + before.x, direct.y + before.y + (direct.x + before.x < before.x ? 1u : 0u));
    reflected = uvec2(reflected.x + before.z, reflected.y + before.w + (reflected.x + before.z < before.z ? 1u : 0u));
    expected[at] = uvec4(direct, reflected);
}
