// Scan conversion and grey map: bilinear in the log-compressed image. One work group is one tile.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = TILE, local_size_y = 4) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer LogBuffer { float log_image[]; };
layout(std430, binding = 2) restrict readonly buffer GreyBuffer { uint grey[256]; };
layout(std430, binding = 3) restrict buffer PixelBuffer { uint pixels[]; };

#include "sector.glsl"
#include "simulated.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint top = gl_WorkGroupID.y * TILE;
    uint width = frame.image_width;
    if (i >= width) { return; }
    Raster of = raster();
    uint end = min(top + TILE, frame.image_height);
    for (uint j = top + gl_LocalInvocationID.y; j < end; j += gl_WorkGroupSize.y) {
        vec2 at;
        uint pixel = 0u;
        if (sector(of, i, j, at)) { pixel = 0xff000000u | (simulated_grey(around(of, at)) * 0x010101u); }
        pixels[j * width + i] = pixel;
    }
}
