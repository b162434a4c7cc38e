// The finest level of the blend's pyramid: simulated minus acquired grey level, where simulated, with
// its weight and that of the sector. One thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer PixelBuffer { uint pixels[]; };
layout(std430, binding = 2) readonly buffer BackgroundBuffer { float background[]; };
layout(std430, binding = 3) readonly buffer MaskBuffer { float mask[]; };
layout(std430, binding = 4) buffer LevelBuffer { float level[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) { return; }
    uint at = j * frame.image_width + i;
    uint pixel = pixels[at];
    float sector = (pixel >> 24u) != 0u ? mask[2u * at + 1u] : 0.0;
    float inside = sector * (1.0 - mask[2u * at]);
    float acquired = not_a_number(background[at]) ? 0.0 : clamp(background[at], 0.0, 1.0);
    level[3u * at] = inside * (float(pixel & 0xffu) / 255.0 - acquired);
    level[3u * at + 1u] = inside;
    level[3u * at + 2u] = sector;
}
