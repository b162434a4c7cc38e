#version 460
// Labels of the pixels from those of the samples: where display has the pixel. Indices are those of the nearest sample;
// quantities lie between the nearest four, where these are in one mesh. One thread is a pixel.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer LabelBuffer { Label labels[]; };
layout(std430, binding = 2) restrict buffer PixelLabelBuffer { Label pixel_labels[]; };

#include "sector.glsl"

// Most samples on either side of a pixel in which a surface is sought.
const int MOST_BESIDE = 32;

uint index_of(vec2 at) { return uint(whole(at.x)) * frame.samples + uint(whole(at.y)); }

// Incidence at the surface nearest to a place of a scanline within the pixel; below 0: none.
float incidence_near(uint column, float row, float beside) {
    float found = -1.0, nearest = 1e9;
    int first = max(int(ceil(row - beside)), 0), last = min(int(floor(row + beside)), int(frame.samples) - 1);
    last = min(last, first + 2 * MOST_BESIDE);
    for (int k = first; k <= last; ++k) {
        float here = labels[column * frame.samples + uint(k)].moved_incidence.w;
        bool better = here >= 0.0 && abs(float(k) - row) < nearest;
        found = mix(found, here, better);
        nearest = mix(nearest, abs(float(k) - row), better);
    }
    return found;
}

void main() {
    uint i = gl_GlobalInvocationID.x, j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) return;
    uint pixel = j * frame.image_width + i;
    uint true_tissue = NONE, true_instance = NONE, tissue = NONE, instance = NONE;
    vec4 place_loss = vec4(0.0), moved_incidence = vec4(0.0, 0.0, 0.0, -1.0);
    vec3 rest = vec3(0.0);
    vec2 at;
    if (sector(raster(), i, j, at)) {
        vec2 ends = vec2(float(frame.scanlines - 1u), float(frame.samples - 1u));
        vec2 p = clamp(at, vec2(0.0), ends);
        vec2 low = floor(p), high = min(low + 1.0, ends);
        vec2 near = min(floor(p + 0.5), ends);
        uint n = index_of(near);
        uint corners[4] = { index_of(low), index_of(vec2(high.x, low.y)), index_of(vec2(low.x, high.y)), index_of(high) };
        true_tissue = labels[n].true_tissue;
        true_instance = labels[n].true_instance;
        tissue = labels[n].tissue;
        instance = labels[n].instance;
        bool one = true;
        for (int c = 0; c < 4; ++c) {
            one = one && labels[corners[c]].tissue == tissue && labels[corners[c]].instance == instance;
        }
        vec2 f = p - low;
        vec4 shares = vec4((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
        vec3 moved = vec3(0.0);
        for (int c = 0; c < 4; ++c) {
            uint from = one ? corners[c] : n;
            place_loss += shares[c] * labels[from].place_loss;
            moved += shares[c] * labels[from].moved_incidence.xyz;
            rest += shares[c] * vec3(labels[from].contact, labels[from].level, labels[from].reverberation);
        }
        float beside = max(0.5 * frame.pixel_pitch / frame.sample_pitch, 0.5);
        moved_incidence = vec4(moved, incidence_near(uint(whole(near.x)), p.y, beside));
    }
    pixel_labels[pixel].true_tissue = true_tissue;
    pixel_labels[pixel].true_instance = true_instance;
    pixel_labels[pixel].tissue = tissue;
    pixel_labels[pixel].instance = instance;
    pixel_labels[pixel].place_loss = place_loss;
    pixel_labels[pixel].moved_incidence = moved_incidence;
    pixel_labels[pixel].contact = rest.x;
    pixel_labels[pixel].level = rest.y;
    pixel_labels[pixel].reverberation = rest.z;
    pixel_labels[pixel].unused = 0.0;
}
