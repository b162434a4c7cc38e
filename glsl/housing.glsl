// The housing of the transducer, in probe space: a head that ends in the face and a handle of
// elliptic section. The includer declares `frame` and `view3d`.

struct HousingHit {
    float t;         // BEYOND: missed
    vec3 normal;     // unit, outward, probe space
    vec3 colour;
};

// The part of a ray inside a convex body, and the normal where it enters.
struct Stretch {
    float enter;
    float leave;
    vec3 normal;
};

// Cuts a stretch to low <= from[axis] + t to[axis] <= high.
Stretch between(Stretch s, float from, float to, float low, float high, vec3 axis) {
    if (to == 0.0) {
        if (from < low || from > high) s.leave = -1.0;
        return s;
    }
    float a = (low - from) / to;
    float b = (high - from) / to;
    if (min(a, b) > s.enter) {
        s.enter = min(a, b);
        s.normal = to > 0.0 ? -axis : axis;
    }
    s.leave = min(s.leave, max(a, b));
    return s;
}

// Cuts a stretch to the inside of the unit circle, in the plane of `from` and `to`; `scale` are the
// lengths of its half axes along x and `across`.
Stretch within(Stretch s, vec2 from, vec2 to, vec2 scale, vec3 across) {
    float a = dot(to, to);
    float b = dot(from, to);
    float c = dot(from, from) - 1.0;
    float root = b * b - a * c;
    if (root <= 0.0 || a == 0.0) {
        if (c > 0.0) s.leave = -1.0;
        return s;
    }
    root = sqrt(root);
    float enter = (-b - root) / a;
    if (enter > s.enter) {
        s.enter = enter;
        vec2 n = (from + enter * to) / scale;
        s.normal = normalize(n.x * vec3(1.0, 0.0, 0.0) + n.y * across);
    }
    s.leave = min(s.leave, (root - b) / a);
    return s;
}

vec3 head_colour(vec3 p, vec3 normal) {
    float half_width = view3d.housing.x;
    float height = view3d.housing.z;
    vec3 mark = vec3(0.36, 0.69, 0.77);
    // The orientation mark, at the side of the first scanline: a rib, and a dot on both faces.
    bool rib = normal.x < -0.9 && abs(p.y) < 0.4 * view3d.housing.y && abs(p.z + 0.6 * height) < 0.25 * height;
    bool dot_ = abs(normal.y) > 0.9 && length(vec2(p.x + 0.78 * half_width, p.z + 0.65 * height)) < 2.5;
    if (rib || dot_) return mark;
    return normal.z > 0.5 ? vec3(0.22, 0.23, 0.26) : vec3(0.8, 0.82, 0.85);
}

HousingHit housing_hit(vec3 from, vec3 to) {
    HousingHit hit = HousingHit(BEYOND, vec3(0.0), vec3(0.0));
    float half_width = view3d.housing.x;
    float half_thickness = view3d.housing.y;
    vec3 x = vec3(1.0, 0.0, 0.0), y = vec3(0.0, 1.0, 0.0), z = vec3(0.0, 0.0, 1.0);
    Stretch head = Stretch(0.0, BEYOND, z);
    head = between(head, from.x, to.x, -half_width, half_width, x);
    head = between(head, from.y, to.y, -half_thickness, half_thickness, y);
    head = between(head, from.z, to.z, -view3d.housing.z, 0.0, z);
    // Only for large radii: the cylinder of a small array would end within the head.
    if (frame.kind == KIND_CONVEX && frame.radius > view3d.housing.z) {
        float r = frame.radius;
        head = within(head, vec2(from.x, from.z + r) / r, vec2(to.x, to.z) / r, vec2(1.0), z);
    }
    if (head.enter > 0.0 && head.enter < head.leave) {
        vec3 p = from + head.enter * to;
        hit = HousingHit(head.enter, head.normal, head_colour(p, head.normal));
    }
    vec2 grip = vec2(min(0.7 * half_width, 15.0), half_thickness);
    Stretch handle = Stretch(0.0, BEYOND, z);
    handle = between(handle, from.z, to.z, -view3d.housing.w, -view3d.housing.z, z);
    handle = within(handle, from.xy / grip, to.xy / grip, grip, y);
    if (handle.enter > 0.0 && handle.enter < handle.leave && handle.enter < hit.t) {
        hit = HousingHit(handle.enter, handle.normal, vec3(0.42, 0.44, 0.48));
    }
    return hit;
}
