// Scan conversion of the mask and of the acquired volume: one thread per pixel, bilinear.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer PrescanBuffer { vec2 prescan[]; };
layout(std430, binding = 2) restrict buffer MaskBuffer { vec2 mask[]; };
layout(std430, binding = 3) restrict buffer BackgroundBuffer { float background[]; };

#include "sector.glsl"

vec2 pair(uint column, uint row) { return prescan[column * frame.samples + row]; }

vec2 bilinear(vec2 at) {
    vec2 p = clamp(at, vec2(0.0), vec2(float(frame.scanlines - 1u), float(frame.samples - 1u)));
    uint c0 = uint(whole(floor(p.x)));
    uint r0 = uint(whole(floor(p.y)));
    uint c1 = min(c0 + 1u, frame.scanlines - 1u);
    uint r1 = min(r0 + 1u, frame.samples - 1u);
    float f = p.x - float(c0);
    return mix(mix(pair(c0, r0), pair(c1, r0), f), mix(pair(c0, r1), pair(c1, r1), f), p.y - float(r0));
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    vec2 at;
    bool inside = sector(i, j, at);
    vec2 v = vec2(0.0);
    if (inside) { v = bilinear(at); }
    uint pixel = j * frame.image_width + i;
    mask[pixel] = vec2(v.x, inside ? 1.0 : 0.0);
    background[pixel] = v.y;
}
