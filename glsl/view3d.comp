// variants: bvh query(RAY_QUERY)
#version 460
// The anatomy from outside, with the probe and the B-mode image in it: one thread per pixel, a ray
// through the structures that sound is traced with.
#extension GL_GOOGLE_include_directive : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 2) readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 3) readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 4) readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 5) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 5) readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 6) readonly buffer View3dBuffer { View3d view3d; };
// Colour and opacity of each instance; opacity 0: invisible.
layout(std430, binding = 7) readonly buffer LookBuffer { vec4 looks[]; };
layout(std430, binding = 8) readonly buffer PixelBuffer { uint pixels[]; };
layout(std430, binding = 9) buffer PictureBuffer { uint picture[]; };

const uint MAX_LAYERS = 24u;
const float BEYOND = 1e9;
// Instances whose first surface behind the section has been met, one bit each; and the lowest priority that
// still matters there.
const uint SEEN_WORDS = 8u;
const int LEAST = -2147483647;
uint seen[SEEN_WORDS];
int least;
// The instance that encloses the point at which a cut anatomy begins.
uint filled;

bool view3d_skips(uint i) {
    bool known = i < 32u * SEEN_WORDS && (seen[min(i / 32u, SEEN_WORDS - 1u)] >> (i % 32u) & 1u) != 0u;
    return known || instances[i].priority < least || looks[i].w <= 0.0;
}

#define RAY_SKIPS(i) view3d_skips(i)
#define RAY_SELECTS ((view3d.flags & (VIEW3D_CUT | VIEW3D_SOME_HIDDEN)) != 0u)
#include "triangle.glsl"
#ifdef RAY_QUERY
#define RAY_MASK frame.ray_mask
#define RAY_SLOTS ((frame.flags & FLAG_SLOTS) != 0u)
#include "intersect_query.glsl"
#else
#include "intersect_bvh.glsl"
#endif
#include "surface.glsl"
#include "transform.glsl"
#include "housing.glsl"

// Colour accumulated along the ray, and the transparency of what is in front.
vec3 colour;
float clear;

void lay(vec3 shade, float opacity) {
    colour += clear * opacity * shade;
    clear *= 1.0 - opacity;
}

// Two-sided shading: one light at the eye, one from above left; `n` is a unit vector and may face away.
vec3 lit(vec3 base, vec3 n, vec3 d) {
    float side = dot(n, d) > 0.0 ? -1.0 : 1.0;
    vec3 towards = side * n;
    vec3 key = normalize(-view3d.forward.xyz
        - 0.45 * normalize(view3d.right.xyz) - 0.7 * normalize(view3d.down.xyz));
    float facing = -dot(towards, d);
    float spot = max(dot(towards, normalize(key - d)), 0.0);
    float spot4 = spot * spot * spot * spot;
    float spot16 = spot4 * spot4 * spot4 * spot4;
    float level = 0.16 + 0.5 * facing + 0.42 * max(dot(towards, key), 0.0);
    return base * level + 0.14 * spot16;
}

// The grey of pixel (i, j) and whether it is in the sector.
vec2 grey(float i, float j) {
    if (i < 0.0 || j < 0.0 || i >= float(frame.image_width) || j >= float(frame.image_height)) return vec2(0.0);
    uint pixel = pixels[uint(j) * frame.image_width + uint(i)];
    return pixel >> 24u == 0u ? vec2(0.0) : vec2(float(pixel & 0xffu) / 255.0, 1.0);
}

// The image at a position, in pixels, averaged over a square of `wide` pixels; false outside the sector.
bool image_at(vec2 place, float wide, out float level) {
    level = 0.0;
    vec2 middle = floor(place);
    if (grey(middle.x, middle.y).y == 0.0) return false;
    float taps = clamp(ceil(wide), 1.0, 4.0);
    vec2 sum = vec2(0.0);
    for (float b = 0.0; b < taps; b += 1.0) {
        for (float a = 0.0; a < taps; a += 1.0) {
            vec2 at = place + ((vec2(a, b) + 0.5) / taps - 0.5) * wide - 0.5;
            vec2 low = floor(at);
            vec2 f = at - low;
            sum += mix(mix(grey(low.x, low.y), grey(low.x + 1.0, low.y), f.x),
                mix(grey(low.x, low.y + 1.0), grey(low.x + 1.0, low.y + 1.0), f.x), f.y);
        }
    }
    level = sum.x / max(sum.y, 1e-6);
    return true;
}

float past(vec3 o, vec3 d, float t) {
    vec3 p = abs(o) + t * abs(d);
    return t + 4e-6 * max(max(p.x, p.y), max(p.z, 1.0));
}

// Adds the surface at `hit` of a ray along `d`.
void lay_surface(Hit hit, vec3 d) {
    vec3 n = surface_shading_normal(hit);
    if (dot(n, n) == 0.0) n = surface_geometric_normal(hit);
    vec4 look = looks[hit.instance];
    float away = 1.0 - abs(dot(n, d));
    // A thin wall seen edge on is more opaque, so that outlines show as well as what is inside.
    float opacity = look.w >= 1.0 ? 1.0 : look.w + (1.0 - look.w) * 0.75 * away * away * away;
    lay(lit(look.xyz, n, d), opacity);
}

// Adds the cut face of the instance that encloses the point at which the anatomy begins.
void lay_section() {
    if (filled == NONE) return;
    vec4 look = looks[filled];
    lay(0.85 * look.xyz, look.w >= 1.0 ? 1.0 : 0.7 * look.w);
}

// Adds the anatomy between `begin` and `end`. Where it is cut, first the instance that encloses the point at
// `begin`: surfaces are closed, so the first one of an instance that the ray meets behind the point
// shows whether it encloses the point; of those that do, the one of highest priority counts. One
// loop for both, so that the kernel contains the traversal once.
void anatomy(vec3 o, vec3 d, float begin, float end, bool cut) {
    bool filling = cut;
    float t = begin;
    uint layers = 0u;
    for (uint step_ = 0u; step_ < 128u; ++step_) {
        Hit hit = closest_hit(o, d, t, filling ? BEYOND : end, NONE);
        if (filling) {
            if (hit.instance == NONE) {
                lay_section();
                for (uint i = 0u; i < SEEN_WORDS; ++i) seen[i] = 0u;
                least = LEAST;
                filling = false;
                t = begin;
                if (clear <= 0.01) break;
                continue;
            }
            if (dot(d, surface_geometric_normal(hit)) > 0.0) {
                filled = hit.instance;
                least = instances[filled].priority + 1;
            }
            if (hit.instance < 32u * SEEN_WORDS) {
                seen[hit.instance / 32u] |= 1u << (hit.instance % 32u);
            } else {
                t = past(o, d, hit.t);
            }
            continue;
        }
        if (hit.instance == NONE) break;
        lay_surface(hit, d);
        layers += 1u;
        if (layers == MAX_LAYERS || clear <= 0.01) break;
        t = past(o, d, hit.t);
    }
}

// Draws what a ray from the eye meets; `wide`: width of a pixel at distance 1.
void look(vec3 o, vec3 d, float wide, vec3 background) {
    vec3 from = probe_point(o);
    vec3 to = probe_vector(d);
    float plane = from.y * to.y < 0.0 ? -from.y / to.y : BEYOND;
    bool cut = (view3d.flags & VIEW3D_CUT) != 0u;
    float begin = cut ? plane : 0.0;
    float end = BEYOND;
    vec3 last = background;
    if ((view3d.flags & VIEW3D_IMAGE) != 0u && plane < BEYOND) {
        vec3 on = from + plane * to;
        vec2 place = (on.xz - vec2(frame.image_left, frame.image_top)) / frame.pixel_pitch;
        float level;
        if (image_at(place, plane * wide / frame.pixel_pitch, level)) {
            end = plane;
            last = vec3(level);
        }
    }
    HousingHit probe = housing_hit(from, to);
    if (probe.t < end) {
        end = probe.t;
        last = lit(probe.colour, world_vector(probe.normal), d);
    }
    if (begin < end) {
        anatomy(o, d, begin, end, cut);
    }
    lay(last, 1.0);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint j = gl_GlobalInvocationID.y;
    if (i >= view3d.width || j >= view3d.height) return;
    for (uint word = 0u; word < SEEN_WORDS; ++word) seen[word] = 0u;
    least = LEAST;
    filled = NONE;
    colour = vec3(0.0);
    clear = 1.0;
    vec2 off = vec2(float(i), float(j)) + 0.5 - 0.5 * vec2(float(view3d.width), float(view3d.height));
    vec3 o = view3d.eye.xyz;
    vec3 d = view3d.forward.xyz + off.x * view3d.right.xyz + off.y * view3d.down.xyz;
    float size = length(d);
    d /= size;
    float down = (float(j) + 0.5) / float(view3d.height);
    vec3 background = mix(vec3(0.075, 0.085, 0.1), vec3(0.02, 0.022, 0.027), down);
    // NaN is no ray either.
    bool is_ray = all(lessThan(abs(o), vec3(1e6))) && all(lessThan(abs(d), vec3(2.0)))
        && all(lessThan(abs(probe_point(o)), vec3(1e7))) && all(lessThan(abs(probe_vector(d)), vec3(2.0)));
    if (is_ray) look(o, d, length(view3d.right.xyz) / size, background);
    else lay(background, 1.0);
    uvec3 bytes = uvec3(clamp(colour, 0.0, 1.0) * 255.0 + 0.5);
    picture[j * view3d.width + i] = 0xff000000u | (bytes.z << 16u) | (bytes.y << 8u) | bytes.x;
}
