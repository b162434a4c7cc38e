// The finished image with the tissues that are seen in their colours: one thread per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 16, local_size_y = 8) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer PixelBuffer { uint pixels[]; };
layout(std430, binding = 2) restrict readonly buffer PixelLabelBuffer { Label pixel_labels[]; };
// Of each tissue, red in the lowest byte.
layout(std430, binding = 3) restrict readonly buffer ColourBuffer { uint colours[]; };
layout(std430, binding = 4) restrict buffer PaintedBuffer { uint painted[]; };

layout(push_constant) uniform Push { float opacity; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= frame.image_width || j >= frame.image_height) return;
    uint at = j * frame.image_width + i;
    uint pixel = pixels[at];
    uint tissue = pixel_labels[at].tissue;
    if ((pixel >> 24u) != 0u && tissue != NONE) {
        uint colour = colours[tissue];
        uint mixed = 0xff000000u;
        for (uint shift = 0u; shift < 24u; shift += 8u) {
            float grey = float((pixel >> shift) & 0xffu);
            float hue = float((colour >> shift) & 0xffu);
            mixed |= uint(floor(grey + opacity * (hue - grey) + 0.5)) << shift;
        }
        pixel = mixed;
    }
    painted[at] = pixel;
}
