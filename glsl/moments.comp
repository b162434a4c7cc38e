// Mean and mean square of the log-compressed scanlines beside each sample, across the scanlines; `enhance` goes on along them.
//
// A thread computes one sample of BEAM_LINES neighbouring scanlines: it reads a level once for all of them that it reaches.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer LogBuffer { float log_image[]; };
layout(std430, binding = 3) restrict buffer MomentBuffer { vec2 moments[]; };
layout(push_constant) uniform Push {
    float neighbourhood;   // its deviation, over that of the point-spread function
};

#include "smooth.glsl"

void main() {
    uint k = gl_GlobalInvocationID.x;
    int first = int(gl_WorkGroupID.y) * BEAM_LINES;
    int samples = int(frame.samples);
    int scanlines = int(frame.scanlines);
    if (k >= frame.samples) { return; }

    float sigma = neighbourhood * rows[k].lateral_lines;
    int reach = reach_of(sigma, LATERAL_REACH);
    float falloff = falloff_of(sigma);
    vec2 sums[BEAM_LINES];
    float weights[BEAM_LINES];
    // tap[n] is the weight, in output scanline first + n, of the scanline that is being read.
    float tap[BEAM_LINES];
    for (int n = 0; n < BEAM_LINES; ++n) {
        sums[n] = vec2(0.0);
        weights[n] = 0.0;
        tap[n] = 0.0;
    }
    for (int j = -reach; j < BEAM_LINES + reach; ++j) {
        for (int n = BEAM_LINES - 1; n > 0; --n) { tap[n] = tap[n - 1]; }
        tap[0] = mix(0.0, exp(falloff * float(j * j)), abs(j) <= reach);
        int line = first + j;
        if (line < 0 || line >= scanlines) { continue; }
        float level = log_image[uint(line * samples) + k];
        vec2 powers = vec2(level, level * level);
        for (int n = 0; n < BEAM_LINES; ++n) {
            weights[n] += tap[n];
            sums[n] += tap[n] * powers;
        }
    }
    for (int n = 0; n < BEAM_LINES; ++n) {
        uint l = uint(first + n);
        if (l >= frame.scanlines) { break; }
        moments[l * frame.samples + k] = sums[n] / weights[n];
    }
}
