// The position of a pixel of the image among the scanlines. The including kernel declares
// `readonly buffer FrameBuffer { Frame frame; }` first.

#include "angles.glsl"

// Column (scanline) and row (axial sample) of the centre of pixel (i, j); false outside the sector.
bool sector(uint i, uint j, out vec2 column_row) {
    if ((frame.flags & FLAG_LINE) != 0u) {
        column_row = vec2(frame.image_left, (float(j) + 0.5) * frame.pixel_pitch / frame.sample_pitch);
        return true;
    }
    float x = frame.image_left + (float(i) + 0.5) * frame.pixel_pitch;
    float z = frame.image_top + (float(j) + 0.5) * frame.pixel_pitch;
    float rho = z;
    float across;    // -1/2 .. 1/2 over the face
    if (frame.kind == KIND_LINEAR) {
        across = x / frame.width;
    } else {
        rho = length(vec2(x, z + frame.radius)) - frame.radius;
        across = arc(x, z + frame.radius) / frame.field_of_view;
    }
    column_row = vec2((across + 0.5) * float(frame.scanlines) - 0.5, rho / frame.sample_pitch);
    return abs(across) <= 0.5 && rho >= 0.0 && rho < frame.depth;
}
