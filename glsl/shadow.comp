// variants: bvh query(RAY_QUERY)
#version 460
// Shadows: the loss of sound in the anatomy inside the mask beyond the loss that the tissue around the mask would
// cause. The level along the transmitted path of each line is written as pieces of straight lines.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) restrict readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 4) restrict readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 5) restrict readonly buffer SmoothedBuffer { uvec4 smoothed[]; };
layout(std430, binding = 6) restrict readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 7) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 7) restrict readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 8) restrict readonly buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 9) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 10) restrict buffer PieceBuffer { vec4 pieces[]; };
layout(std430, binding = 11) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };

#include "triangle.glsl"
#ifdef RAY_QUERY
#define RAY_MASK frame.ray_mask
#define RAY_SLOTS ((frame.flags & FLAG_SLOTS) != 0u)
#include "intersect_query.glsl"
#else
#include "intersect_bvh.glsl"
#endif
#include "surface.glsl"
#include "probe.glsl"
#include "transform.glsl"
#include "acoustics.glsl"
#include "footprint.glsl"
#include "media.glsl"
#include "path.glsl"
#include "wavefront.glsl"

// Level, in nepers of amplitude, that stands for no sound at all.
const float DARK = -200.0;
const float NOTHING = 1e-30;

Medium current_medium(inout Media media) {
    return medium_of(tissue_of(current_instance(media)));
}

// The middle of the beam: the path of `trace` before anything random.
void middle(uint line, out Path path, inout Media media) {
    start(line, 0u, path, media);
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    path.direction = world_vector(d);
    path.lateral = world_vector(lateral);
    path.origin = world_point(o) + path.time * frame.speed * path.direction;
    path.spread = vec3(0.0);
    path.lens = vec3(0.0);
}

// Transmits the path; returns the reflected part of its intensity, 1 if nothing is transmitted.
float pass(inout Path path, Met here, Medium t1, Medium t2) {
    Slope slope = slope_at(here, path, sample_at(frame.speed * path.time / frame.sample_pitch), 0.0);
    float reflected = reflectance_at(slope, path.direction, t1, t2);
    bool through = transmit_path(path, slope.refracting, slope.geometric, t1.speed, t2.speed) || slope.width > 0.0;
    return through ? reflected : 1.0;
}

void main() {
    uint line = gl_GlobalInvocationID.x;
    if (line >= frame.scanlines * frame.layers) return;
    Path path;
    Media media, after;
    middle(line, path, media);
    float time_end = frame.depth / frame.speed;
    uint limit = 64u + frame.max_interactions;
    uint next = line * MAX_PIECES;
    uint last = next + MAX_PIECES - 1u;
    float surrounding = tissues[frame.background].absorption;
    float level = 0.0;
    bool fresh = true;
    // True if no mask lies on the line, or nothing is transmitted at a surface.
    bool lost = path.weight <= 0.0;
    // True while the first of two coincident surfaces has been found and the ray searches for the other.
    bool pairing = false;
    Met first = surface_met(Hit(0.0, NONE, NONE, 0.0, 0.0));
    float close = 0.0;
    uint crossing = 0u;
    while (true) {
        Medium t1 = current_medium(media);
        bool heard = is_heard(media);
        // Around the mask sound travels at the speed assumed by the recording.
        Medium way = t1;
        if (!heard) {
            way.speed = frame.speed;
            surrounding = t1.absorption;
        }
        float excess = heard ? t1.absorption - surrounding : 0.0;
        bool ends = lost || crossing == limit || next + 1u == last;
        if (!pairing && (fresh || ends)) {
            float kappa = crossing == 0u ? 0.0 : frame.speed * path.time / frame.sample_pitch;
            float slope = ends ? 0.0 : excess * t1.speed * frame.sample_pitch / frame.speed;
            pieces[next] = vec4(kappa, level, slope, 0.0);
            next += 1u;
            fresh = false;
        }
        float t_end = (time_end - path.time) * way.speed;
        // With t_max = -1 the ray meets nothing.
        Hit hit = closest_hit(path.origin, path.direction, pairing ? max(first.hit.t - close, 0.0) : path.t_min,
            pairing ? first.hit.t + close : (ends ? -1.0 : t_end), pairing ? first.hit.instance : NONE);
        Met here = surface_met(hit);
        Met other = Met(Hit(hit.t, NONE, NONE, 0.0, 0.0), vec3(0.0), vec3(0.0));
        if (pairing) {
            other = here;
            here = first;
            pairing = false;
        } else if (hit.instance == NONE) {
            // Marks the end of the list; the last piece extends to the end of the line.
            pieces[next] = vec4(FAR_PIECE, 0.0, 0.0, 0.0);
            break;
        } else {
            close = clearance(here.position);
            if ((frame.flags & FLAG_COINCIDENT) != 0u) {
                first = here;
                pairing = true;
                continue;
            }
        }
        crossing += 1u;
        float past = here.hit.t + close;
        if (other.hit.instance != NONE) past = max(past, other.hit.t + close);
        if (other.hit.instance < here.hit.instance) {
            Met found = here;
            here = other;
            other = found;
        }
        copy_media(after, media);
        cross_interface(after, here.hit.instance, dot(path.direction, here.normal) < 0.0);
        if (other.hit.instance != NONE) cross_interface(after, other.hit.instance, dot(path.direction, other.normal) < 0.0);
        bool heard_after = is_heard(after);
        bool same = current_instance(after) == current_instance(media);
        if (same && heard == heard_after) {
            path.t_min = past;
            copy_media(media, after);
            continue;
        }
        advance(path, here.hit.t, way, here.position);
        level -= excess * here.hit.t;
        fresh = heard || heard_after;
        if (same || !fresh) {
            path.t_min = max(path.t_min, past - here.hit.t);
        } else {
            float reflected = pass(path, here, t1, current_medium(after));
            lost = reflected >= 1.0;
            level = lost ? DARK : level + log(max(1.0 - reflected, NOTHING));
        }
        copy_media(media, after);
    }
}
