// The finished image with what flows in the colour box in colours: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer CorrelationBuffer { float correlations[]; };
// COLOUR_ROWS rows of COLOUR_COLUMNS, red in the lowest byte.
layout(std430, binding = 3) restrict readonly buffer ColourMapBuffer { uint colour_map[]; };
layout(std430, binding = 4) restrict readonly buffer PixelBuffer { uint pixels[]; };
layout(std430, binding = 5) restrict buffer ColouredBuffer { uint coloured[]; };
layout(push_constant) uniform Push {
    uint first_line;       // of the box
    uint lines;            // how many
    uint first_sample;
    uint samples;
    uint shows_power;      // 1: power, 0: velocity
    uint priority;         // grey level of the image from which on it stands in front
    float least;           // power from which on there is colour
    float gain;            // factor on powers
    float baseline;        // velocity in the middle of those that are told apart, over Nyquist's
};

#include "sector.glsl"

const float LOUDEST = 1e30;   // power that no echo has
const float FAINTEST = 1e-30;

// True if the pixel is in the box; its column and row among the scanlines.
bool boxed(Raster of, uint i, uint j, out vec2 at) {
    if (i >= frame.image_width || j >= frame.image_height) { return false; }
    bool inside = sector(of, i, j, at);
    vec2 from = vec2(float(first_line), float(first_sample)) - 0.5;
    vec2 to = from + vec2(float(lines), float(samples));
    return inside && all(greaterThanEqual(at, from)) && all(lessThan(at, to));
}

vec3 correlation(uint line, uint sample_) {
    uint at = 3u * (line * samples + sample_);
    return vec3(correlations[at], correlations[at + 1u], correlations[at + 2u]);
}

// A number in 0..1 as one of `count` equal parts of that.
uint part(float share, uint count) { return uint(clamp(whole(floor(share * float(count))), 0, int(count) - 1)); }

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    Raster of = raster();
    uint to = j * frame.image_width + i;
    uint pixel = pixels[to];
    coloured[to] = pixel;
    vec2 at;
    if (!boxed(of, i, j, at)) { return; }
    uint within = 0u;
    for (uint side = 0u; side < 4u; ++side) {
        uint by = 1u - (side & 2u);
        vec2 there;
        bool across = (side & 1u) == 0u;
        within += uint(boxed(of, mix(i, i + by, across), mix(j + by, j, across), there));
    }
    if (within < 4u) {
        coloured[to] = 0xff000000u | (BOX_GREY * 0x010101u);
        return;
    }
    if ((pixel & 0xffu) >= priority) { return; }

    // Bilinear: of the sums, whose phases do not fold over as their angles do.
    vec2 last = vec2(float(lines - 1u), float(samples - 1u));
    vec2 p = clamp(at - vec2(float(first_line), float(first_sample)), vec2(0.0), last);
    vec2 f = floor(p);
    vec2 n = min(f + 1.0, last);
    vec2 w = p - f;
    uint l0 = uint(whole(f.x)), l1 = uint(whole(n.x)), k0 = uint(whole(f.y)), k1 = uint(whole(n.y));
    vec3 near = mix(correlation(l0, k0), correlation(l1, k0), w.x);
    vec3 far = mix(correlation(l0, k1), correlation(l1, k1), w.x);
    vec3 mean = mix(near, far, w.y);
    float power = mean.z;
    if (!(power >= least && power < LOUDEST)) { return; }
    float tgc = mix(rows[first_sample + k0].tgc, rows[first_sample + k1].tgc, w.y) * frame.inverse_reference;
    float level = log2(max(power * gain * tgc * tgc, FAINTEST)) * 3.01029996;   // dB
    float bright = 1.0 + level * frame.inverse_range;
    if (!(bright > 0.0)) { return; }

    // Velocity towards the probe, over Nyquist's, folded into -1 .. 1 about the baseline; from there 0 .. 1.
    float share = 0.5 * (arc(mean.y, mean.x) * 0.318309886 - baseline + 1.0);
    share -= floor(share);
    bool towards = 2.0 * share - 1.0 + baseline >= 0.0;
    float varied = clamp(1.0 - length(mean.xy) / power, 0.0, 1.0);
    bool is_power = shows_power != 0u;
    uint column = part(mix(share, min(bright, 1.0), is_power), COLOUR_COLUMNS);
    uint row = part(mix(varied, float(towards), is_power), COLOUR_ROWS);
    coloured[to] = 0xff000000u | colour_map[row * COLOUR_COLUMNS + column];
}
