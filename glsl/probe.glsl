// Transducer geometry in probe space: x lateral, y elevation, z depth, mm; the face's centre is at 0.
// The including kernel declares `readonly buffer FrameBuffer { Frame frame; }` and
// `readonly buffer ScanlineBuffer { Scanline scanlines[]; }` first.

#include "numbers.glsl"

// Elevation offset of layer e (cell-centred), mm.
float elevation(uint e) {
    return frame.slice_thickness * ((float(e) + 0.5) / float(frame.layers) - 0.5);
}

// Scanlines of the whole face; the frame may be made of some of them.
uint face_lines() { return frame.scanlines + frame.lines_beside; }

// True if a scanline of the frame echoes; others say only what sound loses there.
bool echoes_wanted(uint l) { return l - frame.echo_first < frame.echo_lines; }

// Start, unit direction and unit lateral axis (in the scanline plane, perpendicular to the ray) of
// scanline l in layer e.
void probe_ray(uint l, uint e, out vec3 origin, out vec3 direction, out vec3 lateral) {
    Scanline at = scanlines[frame.first_line + l];
    origin = vec3(at.x, elevation(e), at.z);
    direction = vec3(at.sine, 0.0, at.cosine);
    lateral = vec3(direction.z, 0.0, -direction.x);
}

// Distance between neighbouring scanlines where sound leaves the face, mm, and its growth per mm of depth.
vec2 line_pitch() {
    vec2 of_all = frame.kind == KIND_LINEAR ? vec2(frame.width, 0.0) : vec2(frame.radius, 1.0) * frame.field_of_view;
    return of_all / float(face_lines());
}

// Axial sample at `kappa` pitches along a line, limited to the ends; 0 for NaN.
uint sample_at(float kappa) {
    return uint(whole(floor(clamp(mix(0.0, kappa, kappa > 0.0), 0.0, float(frame.samples - 1u)))));
}

// Amplitude factor of an echo `off` mm beside the geometric scanline.
float beam_weight(float off) {
    if (frame.beam_width <= 0.0) return 1.0;
    float q = off / frame.beam_width;
    return exp(-0.5 * q * q);
}

// A ray leaving the face must not meet it again at its own start.
const float FACE_T_MIN = 1e-3;

// Distance along the ray (o, d) to the transducer's face, met from the body's side; -1 is a miss.
// A phased array's face is a point and is never met.
float face_distance(vec3 o, vec3 d) {
    float t;
    if (frame.kind == KIND_LINEAR) {
        if (d.z >= 0.0) { return -1.0; }
        t = -o.z / d.z;
        if (abs(o.x + t * d.x) > scanlines[face_lines()].x) { return -1.0; }
    } else if (frame.kind == KIND_CONVEX) {
        vec2 q = vec2(o.x, o.z + frame.radius);
        vec2 v = vec2(d.x, d.z);
        float a = dot(v, v);
        float b = dot(q, v);
        float area = q.x * v.y - q.y * v.x;
        // b^2 - a c, with Lagrange's identity so that nothing cancels far from the face.
        float discriminant = a * frame.radius * frame.radius - area * area;
        if (b >= 0.0 || discriminant <= 0.0) { return -1.0; }
        float distance_to_axis = length(q);
        float c = (distance_to_axis - frame.radius) * (distance_to_axis + frame.radius);
        t = c / (sqrt(discriminant) - b);
        vec2 p = q + t * v;
        // Beyond the edge if the sine of the angle between the two is positive.
        Scanline edge = scanlines[face_lines()];
        if (abs(p.x) * edge.cosine > p.y * edge.sine) { return -1.0; }
    } else {
        return -1.0;
    }
    // NaN, too, is a miss.
    return t >= FACE_T_MIN && abs(o.y + t * d.y) <= 0.5 * frame.face_height ? t : -1.0;
}

// Unit normal of the face at p, towards the body.
vec3 face_normal(vec3 p) {
    if (frame.kind == KIND_CONVEX) { return normalize(vec3(p.x, 0.0, p.z + frame.radius)); }
    return vec3(0.0, 0.0, 1.0);
}
