// Scan conversion and grey map: one thread per pixel, bilinear in the log-compressed image.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer LogBuffer { float log_image[]; };
layout(std430, binding = 2) restrict readonly buffer GreyBuffer { uint grey[256]; };
layout(std430, binding = 3) restrict buffer PixelBuffer { uint pixels[]; };

#include "sector.glsl"

float bilinear(float column, float row) {
    float c = clamp(column, 0.0, float(frame.scanlines - 1u));
    float r = clamp(row, 0.0, float(frame.samples - 1u));
    uint c0 = uint(whole(floor(c)));
    uint r0 = uint(whole(floor(r)));
    uint c1 = min(c0 + 1u, frame.scanlines - 1u);
    uint r1 = min(r0 + 1u, frame.samples - 1u);
    float near = mix(log_image[c0 * frame.samples + r0], log_image[c1 * frame.samples + r0], c - float(c0));
    float far = mix(log_image[c0 * frame.samples + r1], log_image[c1 * frame.samples + r1], c - float(c0));
    return mix(near, far, r - float(r0));
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    vec2 at;
    uint pixel = 0u;
    if (sector(i, j, at)) {
        float v = bilinear(at.x, at.y);
        uint level = grey_level(v);
        pixel = 0xff000000u | (grey[level] * 0x010101u);
    }
    pixels[j * frame.image_width + i] = pixel;
}
