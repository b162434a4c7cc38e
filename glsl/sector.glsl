// The position of a pixel of the image among the scanlines. The including kernel declares
// `readonly buffer FrameBuffer { Frame frame; }` first.

#include "angles.glsl"

// What of the frame says where its pixels lie, read once for many pixels.
struct Raster {
    bool is_line;
    bool is_linear;
    vec2 corner;          // left and upper edge, mm
    float pitch;
    float radius;
    float extent;         // of the face: mm, or radians
    float columns;
    float sample_pitch;
    float depth;
    uint samples;
    vec2 last;            // scanline and sample
};

Raster raster() {
    bool is_linear = frame.kind == KIND_LINEAR;
    return Raster((frame.flags & FLAG_LINE) != 0u, is_linear, vec2(frame.image_left, frame.image_top), frame.pixel_pitch,
        frame.radius, is_linear ? frame.width : frame.field_of_view, float(frame.scanlines), frame.sample_pitch,
        frame.depth, frame.samples, vec2(float(frame.scanlines - 1u), float(frame.samples - 1u)));
}

// Column (scanline) and row (axial sample) of the centre of pixel (i, j); false outside the sector.
bool sector(Raster of, uint i, uint j, out vec2 column_row) {
    if (of.is_line) {
        column_row = vec2(of.corner.x, (float(j) + 0.5) * of.pitch / of.sample_pitch);
        return true;
    }
    float x = of.corner.x + (float(i) + 0.5) * of.pitch;
    float z = of.corner.y + (float(j) + 0.5) * of.pitch;
    float rho = z;
    float across;    // -1/2 .. 1/2 over the face
    if (of.is_linear) {
        across = x / of.extent;
    } else {
        rho = length(vec2(x, z + of.radius)) - of.radius;
        across = arc(x, z + of.radius) / of.extent;
    }
    column_row = vec2((across + 0.5) * of.columns - 0.5, rho / of.sample_pitch);
    return abs(across) <= 0.5 && rho >= 0.0 && rho < of.depth;
}

// The samples around a place among the scanlines, clamped at their ends, and how far it lies behind the first.
struct Around {
    uvec4 at;      // this scanline and the next at one sample, both at the next sample
    vec2 beyond;   // columns, rows
};

Around around(Raster of, vec2 column_row) {
    vec2 p = clamp(column_row, vec2(0.0), of.last);
    vec2 f = floor(p);
    vec2 n = min(f + 1.0, of.last);
    uvec2 c = of.samples * uvec2(whole(f.x), whole(n.x));
    return Around(uvec4(c + uint(whole(f.y)), c + uint(whole(n.y))), p - f);
}
