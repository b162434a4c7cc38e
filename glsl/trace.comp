// variants: bvh query(RAY_QUERY) count(COUNT)
#version 460
// Paths of one (scanline, elevation layer) through the anatomy: surface echoes are deposited,
// stretches inside a medium are written out as segments for scatter. docs/kernels.md has the steps.
#extension GL_GOOGLE_include_directive : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"
#include "random.glsl"

// One thread is one path: x runs over lines, y over paths.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) readonly buffer SurfaceBuffer { Surface surfaces[]; };
layout(std430, binding = 3) readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 4) readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 5) readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 6) readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 7) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 7) readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 8) readonly buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 9) readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 10) buffer SurfaceEchoBuffer { int surface_echoes[]; };
layout(std430, binding = 11) buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 12) buffer SegmentCountBuffer { uint segment_count[]; };
layout(std430, binding = 13) buffer CounterBuffer { Counters counters; };
layout(std430, binding = 14) readonly buffer FieldBuffer { float fields[]; };
layout(std430, binding = 15) readonly buffer ScanlineBuffer { Scanline scanlines[]; };

layout(push_constant) uniform Push { uint path_begin; uint path_count; };

// Whether everything but masks is transparent to rays.
bool masks_only = false;
#define RAY_SKIPS(i) (masks_only && instances[i].masks == 0u)
#define RAY_SELECTS masks_only

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
#include "field.glsl"
#include "acoustics.glsl"
#include "footprint.glsl"
#include "media.glsl"
#include "deposit.glsl"
#include "path.glsl"
#include "count.glsl"

uint row_of(float time) {
    return sample_at(frame.speed * time / frame.sample_pitch);
}

// Each of N paths deposits an N-th: rounded alike, faint echoes would vanish as N grows. The dither
// belongs to the interaction.
uvec4 dither_words(uint line, uint n, uint key) {
    return pcg4d(uvec4(line, n, key, frame.seed ^ 0x51ed270bu));
}

void deposit_surface(uint line, float time, vec2 amplitude, bool incoherent, uvec4 dither) {
    uint l = line % frame.scanlines;
    float y = elevation(line / frame.scanlines);
    float kappa = frame.speed * time / frame.sample_pitch;
    float base = floor(kappa);
    vec2 q = carrier(time);
    q = vec2(amplitude.x * q.x - amplitude.y * q.y, amplitude.x * q.y + amplitude.y * q.x);
    for (int i = 0; i < 2; ++i) {
        float at = base + float(i);
        if (!(at >= 0.0 && at < float(frame.samples))) continue;
        uint k = uint(at);
        float sigma = rows[k].sigma_elevation;
        float gain = rows[k].surface_gain * exp(-0.5 * y * y / (sigma * sigma));
        if (incoherent) gain *= rows[k].incoherent_gain;
        vec2 v = q * gain * (i == 0 ? 1.0 - (kappa - base) : kappa - base);
        uint slot = 2u * (l * frame.samples + k);
        int re = to_fixed(v.x, frame.surface_scale, unit(dither[2 * i]));
        int im = to_fixed(v.y, frame.surface_scale, unit(dither[2 * i + 1]));
        if (re != 0) atomicAdd(surface_echoes[slot], re);
        if (im != 0) atomicAdd(surface_echoes[slot + 1u], im);
    }
}

// Which part of the volume this path stands for, and how many paths average down its echoes.
void emit_segment(Path path, uint line, uint n, uint instance, float extent) {
    bool alike = frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0
        && (frame.flags & FLAG_ROUGH_TRANSMISSION) == 0u;
    bool whole = alike && (frame.sampling == SAMPLING_MAIN_PATH
        || (frame.sampling == SAMPLING_SHARED_PRIMARY && path.interactions == 0u));
    if (whole && n != 0u) return;
    if (!is_heard(path.media)) return;
    uint tissue = tissue_of(instance);
    if (!(extent > 0.0) || (tissues[tissue].presence <= 0.0 && frame.points == 0u)) return;
    if (path.branch && path.weight * rows[row_of(path.time)].compensation < frame.volume_floor) return;
    uint slot = atomicAdd(segment_count[line], 1u);
    if (slot >= frame.segment_capacity) {
        atomicAdd(counters.segments_dropped, 1u);
        return;
    }
    uint at = line * frame.segment_capacity + slot;
    float weight = whole ? path.weight : path.weight * path.share;
    float share = whole ? 1.0 : max(1.0, path.probability / path.share);
    segments[at].origin_length = vec4(path.origin, extent);
    segments[at].direction_time = vec4(path.direction, path.time);
    segments[at].lateral_weight = vec4(path.lateral, weight);
    segments[at].spread = vec4(path.spread, share);
    segments[at].tissue = tissue;
    segments[at].instance = instance;
    segments[at].line = line;
    segments[at].handedness = path.handedness;
}

Tissue load_tissue(uint i) {
    Tissue t;
    t.speed = tissues[i].speed;
    t.impedance = tissues[i].impedance;
    t.absorption = tissues[i].absorption;
    return t;
}

Surface load_surface(uint i) {
    Surface s;
    s.roughness = surfaces[i].roughness;
    s.thickness = surfaces[i].thickness;
    s.specularity = surfaces[i].specularity;
    s.gain = surfaces[i].gain;
    s.coherence = surfaces[i].coherence;
    return s;
}

// Distance of a point from the geometric scanline in the image plane, mm.
float off_axis(uint line, vec3 position) {
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    return dot(probe_point(position) - o, lateral);
}

// The echo of one interface by one path; m is the sampled micro-normal.
void echo(Path path, uint line, uint n, uint key, uint instance, Surface s, Tissue t1, Tissue t2, vec3 m) {
    float cos_m = -dot(path.direction, m);
    float r = reflection(t1.impedance, t1.speed, t2.impedance, t2.speed, cos_m);
    float facing = 2.0 * cos_m * cos_m - 1.0; // -d . v_r
    if (facing <= 0.0) return;
    float amplitude = path.weight * r * pow(facing, s.specularity) * s.gain * beam_weight(off_axis(line, path.origin));
    uvec4 words = draw(n, key, PURPOSE_THICKNESS);
    float q = s.thickness * abs(gaussian(words.x & 0xffff0000u | words.y >> 16u));
    float late = path.time + q / t1.speed;
    float behind = amplitude * exp(-t1.absorption * q);
    uvec4 dither = dither_words(line, n, key);
    if ((frame.flags & FLAG_COHERENT) != 0u) {
        deposit_surface(line, late, vec2(path.share * behind, 0.0), false, dither);
        return;
    }
    deposit_surface(line, path.time, vec2(s.coherence * path.share * amplitude, 0.0), false, dither);
    if (s.coherence >= 1.0) return;
    // Off the round numbers at which flat faces are modelled: on a cell's border the rounding of a
    // tracer would choose the phase.
    vec3 p = tissue_point(instance, path.origin) * 2.0 + 0.381966;
    uvec3 cell = uvec3(ivec3(floor(p)));
    vec2 phase = phasor(unit(pcg4d(uvec4(cell, n * 0x9e3779b9u + frame.seed)).w));
    float incoherent = sqrt((1.0 - s.coherence * s.coherence) * path.share * path.probability) * behind;
    deposit_surface(line, late, incoherent * phase, true, dither);
}

void main() {
    uint line = gl_GlobalInvocationID.x;
    uint n = path_begin + gl_GlobalInvocationID.y;
    if (line >= frame.scanlines * frame.layers || gl_GlobalInvocationID.y >= path_count) return;

    Path path = start(line, n);
    Path main_path = path;
    bool resume = false;
    float time_end = frame.depth / frame.speed;
    uint limit = 64u + frame.max_interactions;
    uint rays = 0u, interactions = 0u;
    // Whether a mask is known to lie ahead of a path that is outside of all. Where all paths of a
    // line begin alike, origin has looked.
    bool aimed = frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0;

    // A main path spawns at most one branch per interaction, and a branch spawns none.
    uint guards = limit * (frame.max_interactions + 2u);
    for (uint guard = 0u;; ++guard) {
        bool alive = path.interactions < frame.max_interactions && path.crossings < limit
            && path.weight >= frame.min_weight && path.time < time_end;
        if (!alive || guard == guards) {
            if (!resume || guard == guards) {
                // Inside the loop: naga loses values that a loop carries when they are used after it.
                atomicAdd(counters.rays, rays);
                report_counts();
                if (interactions > 0u) atomicAdd(counters.interactions, interactions);
                break;
            }
            resume = false;
            aimed = false;
            path = main_path;
            continue;
        }
        uint before = current_instance(path.media);
        Tissue t1 = load_tissue(tissue_of(before));
        bool heard = is_heard(path.media);
        // An acquired image is laid out at the probe's speed: so is the way to the mask.
        Tissue way = t1;
        if (!heard) way.speed = frame.speed;
        float t_end = (time_end - path.time) * way.speed;
        float face = path.reflections > 0u ? face_distance(probe_point(path.origin), probe_vector(path.direction)) : -1.0;
        bool at_face = face > path.t_min && face < t_end;
        if (at_face) t_end = face;
        bool bounces = at_face && (frame.flags & FLAG_FACE_REFLECTION) != 0u && path.reflections < frame.max_reflections;
        if (!heard && !aimed && !bounces) {
            // Nothing more is heard of what flies past all masks.
            masks_only = true;
            Hit mask = closest_hit(path.origin, path.direction, path.t_min, t_end, NONE);
            masks_only = false;
            rays += 1u;
            if (mask.instance == NONE) {
                path.weight = 0.0;
                continue;
            }
        }
        aimed = !heard;
        Hit hit = closest_hit(path.origin, path.direction, path.t_min, t_end, NONE);
        rays += 1u;

        if (hit.instance == NONE) {
            emit_segment(path, line, n, before, t_end);
            vec3 end = path.origin + t_end * path.direction;
            if (bounces) {
                aimed = false;
                advance(path, t_end, way, end);
                path.interactions += 1u;
                interactions += 1u;
                vec3 normal = world_vector(face_normal(probe_point(end)));
                float cos_face = dot(path.direction, normal);
                float retro = path.weight * path.share * beam_weight(off_axis(line, end));
                if (cos_face < 0.0 && heard) {
                    uvec4 dither = dither_words(line, n, path.interactions + 32u * path.reflections);
                    deposit_surface(line, path.time, vec2(retro * max(2.0 * cos_face * cos_face - 1.0, 0.0), 0.0), false, dither);
                }
                path.left_instance = NONE;
                reflect_path(path, normal, SPECULAR, 0.0);
            } else {
                path.weight = 0.0;
            }
            continue;
        }

        float past = hit.t + clearance(surface_position(hit));
        if (is_left(path, hit)) {
            path.t_min = past;
            path.crossings += 1u;
            continue;
        }
        Hit other = Hit(hit.t, NONE, NONE, 0.0, 0.0);
        if ((frame.flags & FLAG_COINCIDENT) != 0u) {
            float from = max(hit.t - clearance(surface_position(hit)), 0.0);
            other = closest_hit(path.origin, path.direction, from, past, hit.instance);
            rays += 1u;
            if (other.instance != NONE) past = max(past, other.t + clearance(surface_position(hit)));
            // Rounding chooses which of the two is found first; it must not choose whose echo it is.
            if (other.instance < hit.instance) {
                Hit found = hit;
                hit = other;
                other = found;
            }
        }
        vec3 position = surface_position(hit);
        vec3 n_geometric = surface_geometric_normal(hit);
        bool entering = dot(path.direction, n_geometric) < 0.0;
        Media media = path.media;
        if (!cross_interface(media, hit.instance, entering)) atomicAdd(counters.stack_overflow, 1u);
        if (other.instance != NONE
            && !cross_interface(media, other.instance, dot(path.direction, surface_geometric_normal(other)) < 0.0)) {
            atomicAdd(counters.stack_overflow, 1u);
        }
        uint after = current_instance(media);
        path.crossings += 1u;
        bool heard_after = is_heard(media);
        bool outside = !heard && !heard_after;
        if (after == before || outside) {
            if (heard_after != heard || after != before) {
                // The mask begins or ends within a medium: the stretch is cut there. Outside another
                // medium begins, and sound goes straight on.
                emit_segment(path, line, n, before, hit.t);
                advance(path, hit.t, way, position);
                leave(path, hit);
                path.t_min = max(path.t_min, past - hit.t);
                if (after != before) {
                    path.weight *= passed(t1.impedance, tissues[tissue_of(after)].impedance);
                    path.interactions += 1u;
                }
            } else {
                path.t_min = past;
            }
            path.media = media;
            continue;
        }

        emit_segment(path, line, n, before, hit.t);
        advance(path, hit.t, way, position);
        leave(path, hit);
        aimed = false;
        path.interactions += 1u;
        interactions += 1u;
        uint key = path.interactions + 32u * path.reflections;
        vec3 n_shading = surface_shading_normal(hit);
        if (!entering) { n_geometric = -n_geometric; n_shading = -n_shading; }
        if (!(dot(path.direction, n_shading) < 0.0)) n_shading = n_geometric;
        Tissue t2 = load_tissue(tissue_of(after));
        Surface s = load_surface(entering ? instances[hit.instance].surface_outside : instances[hit.instance].surface_inside);

        float cos_i = -dot(path.direction, n_shading);
        float width = 0.0;
        if ((frame.flags & FLAG_FOOTPRINT) != 0u) {
            float sigma = rows[row_of(path.time)].sigma_lateral;
            // In the plane of incidence; along the image where there is none.
            vec3 along = path.direction + cos_i * n_shading + 0.01 * path.lateral;
            width = surface_curvature(hit, along) * sqrt(sigma * sigma + path.spread.x);
        }
        float reflected = footprint_reflectance(t1.impedance, t1.speed, t2.impedance, t2.speed, cos_i, width);
        float turn = 2.0 * width / max(cos_i, 1e-3);
        vec3 m;
        bool rough = rough_normal(path.direction, n_shading, n_geometric, s.roughness, n, key, frame.seed, (frame.flags & FLAG_SOBOL) != 0u, m);
        if (rough) echo(path, line, n, key, hit.instance, s, t1, t2, m);

        bool can_reflect = rough && path.reflections < frame.max_reflections;
        bool splits = frame.sampling == SAMPLING_MAIN_PATH && !path.branch;
        bool reflects;
        if (splits) {
            float wanted = clamp(ceil(float(frame.paths) * reflected), 1.0, float(frame.paths));
            reflects = can_reflect && float(n) < wanted;
            main_path = path;
            if (reflects) {
                path.branch = true;
                path.weight *= reflected;
                path.share = 1.0 / wanted;
            }
            // The main path goes on behind the interface, now or after its branch.
            vec3 refracting = rough && (frame.flags & FLAG_ROUGH_TRANSMISSION) != 0u ? m : n_shading;
            bool through = reflected < 1.0
                && (transmit_path(main_path, refracting, n_geometric, t1.speed, t2.speed) || width > 0.0);
            main_path.weight = through ? main_path.weight * (1.0 - reflected) : 0.0;
            main_path.media = media;
            if (reflects) {
                resume = true;
                reflect_path(path, m, s.roughness, turn);
            } else {
                path = main_path;
            }
            continue;
        }
        float choice = unit(draw(n, key, PURPOSE_CHOICE).x);
        if (path.interactions == 1u && !path.branch) choice = (float(n) + choice) / float(frame.paths);
        reflects = choice < reflected;
        path.probability *= reflects ? reflected : 1.0 - reflected;
        if (reflects) {
            if (can_reflect) reflect_path(path, m, s.roughness, turn);
            else path.weight = 0.0;
        } else {
            vec3 refracting = rough && (frame.flags & FLAG_ROUGH_TRANSMISSION) != 0u ? m : n_shading;
            path.media = media;
            // The middle of the beam may be totally reflected where the rest is not: it goes straight on.
            if (!transmit_path(path, refracting, n_geometric, t1.speed, t2.speed) && !(width > 0.0)) {
                atomicAdd(counters.paths_lost, 1u);
                path.weight = 0.0;
            }
        }
    }
}
