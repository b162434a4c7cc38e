// The acquired image and the simulated one, mixed by the blurred mask: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) restrict readonly buffer PixelBuffer { uint pixels[]; };
layout(std430, binding = 3) restrict readonly buffer BackgroundBuffer { float background[]; };
layout(std430, binding = 4) restrict readonly buffer SumBuffer { vec2 sums[]; };
layout(std430, binding = 5) restrict buffer FusedBuffer { uint fused[]; };
// The values that blending by bands adds to the acquired image; read only if blended by bands.
layout(std430, binding = 6) restrict readonly buffer ChangeBuffer { float change[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    uint at = j * frame.image_width + i;
    uint pixel = pixels[at];
    if ((pixel >> 24u) != 0u) {
        float v;
        if (fusion.blend == BLEND_MULTIBAND) {
            v = background[at] + change[at];
        } else {
            // Division may round; if the whole box is outside, the weight must be exactly 1.
            vec2 sum = sums[at];
            float m = sum.x >= sum.y ? 1.0 : sum.x / sum.y;
            if (fusion.blend == BLEND_SMOOTH) { m = m * m * (3.0 - 2.0 * m); }
            v = m * background[at] + (1.0 - m) * (float(pixel & 0xffu) / 255.0);
        }
        uint level = grey_level(v);
        pixel = 0xff000000u | (level * 0x010101u);
    }
    fused[at] = pixel;
}
