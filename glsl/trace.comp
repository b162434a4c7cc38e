// variants: bvh query(RAY_QUERY) count(COUNT)
#version 460
// Paths of one (scanline, elevation layer) through the anatomy: surface echoes are deposited,
// the parts inside a medium are written as segments for scatter. docs/kernels.md has the steps.
//
// The main-path scheme has two dispatches: the first follows the transmitted path and records each of
// its interactions; the second lets every path echo at each of them and follows what is reflected there.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"
#include "random.glsl"

// Each worker takes one piece of work after the other: a path of a line; in the second
// dispatch an interaction and a block of paths. So all threads of a group stay busy.
layout(local_size_x = TRACE_GROUP) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer SurfaceBuffer { Surface surfaces[]; };
layout(std430, binding = 3) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 4) restrict readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 5) restrict readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 6) restrict readonly buffer SmoothedBuffer { uvec4 smoothed[]; };
layout(std430, binding = 7) restrict readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 8) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 8) restrict readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 9) restrict readonly buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 10) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 11) restrict buffer SurfaceEchoBuffer { int surface_echoes[]; };
layout(std430, binding = 12) restrict buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 13) restrict buffer SegmentCountBuffer { uint segment_count[]; };
layout(std430, binding = 14) restrict buffer CounterBuffer { Counters counters; };
layout(std430, binding = 15) restrict readonly buffer FieldBuffer { vec4 fields[]; };
layout(std430, binding = 16) restrict buffer InteractionBuffer { Interaction interactions[]; };
layout(std430, binding = 17) restrict buffer InteractionCountBuffer { uint interaction_count[]; };
layout(std430, binding = 18) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };

layout(std430, binding = 19) restrict buffer ApertureBuffer { Aperture apertures[]; };

// The role of the paths. Copied to a variable, as naga knows no operations on specialization constants.
layout(constant_id = 0) const uint ROLE = ROLE_WHOLE;
uint role = ROLE;

layout(push_constant) uniform Push {
    uint path_begin; uint path_count; uint line_begin; uint line_count;
    uint pieces;      // number of pieces of work; the line varies fastest
    uint most;        // most pieces that one worker takes
    uint turn;        // which of two counters deals them out; the other one is for the next dispatch
    uint block;       // paths that a worker takes one after the other at an interaction
    uint lanes;       // threads of a work group that are workers: fewer wait for the longest path of fewer
    uint again;       // 1: main paths are followed once more, for their interactions only
};

// True if everything but masks is transparent to rays.
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
#include "start.glsl"
#include "wavefront.glsl"
#include "count.glsl"

// The media that enclose the path, and those behind the surface that it has met.
Media media;
Media after;

uint row_of(float time) {
    return sample_at(frame.speed * time / frame.sample_pitch);
}

#include "aperture.glsl"
#include "emit.glsl"
#include "interface.glsl"
#include "branch.glsl"
#include "worker.glsl"

// Reflects a path at the transducer's face, a perfect mirror; the part that it sends
// straight back is an echo.
void bounce(inout Path path, inout Echo echo, uint line, uint n, bool heard) {
    vec3 side = world_vector(face_normal(probe_point(path.origin)));
    float cos_face = dot(path.direction, side);
    float retro = path.weight * path.share * beam_weight(off_axis(line, path.origin));
    if (cos_face < 0.0 && heard) {
        echo.waiting = 1u;
        echo.key = path.interactions + 32u * path.reflections;
        echo.time = path.time;
        echo.draw = n;
        echo.mean = false;
        echo.in_phase = retro * max(2.0 * cos_face * cos_face - 1.0, 0.0);
    }
    path.left_instance = NONE;
    reflect_path(path, side, SPECULAR, 0.0);
}

// Computes the media behind one or two surfaces that the path has met.
void toggle(Met here, Met other, vec3 direction, uint copies) {
    copy_media(after, media);
    // A loop, because drivers take time to compile each copy of the call.
    [[dont_unroll]] for (uint i = 0u; i < (other.hit.instance == NONE ? 1u : 2u); ++i) {
        bool enters = dot(direction, i == 0u ? here.normal : other.normal) < 0.0;
        bool fits = cross_interface(after, i == 0u ? here.hit.instance : other.hit.instance, enters);
        if (!fits && again == 0u) atomicAdd(counters.stack_overflow, copies);
    }
}

// Refracts the path at normal n into the next medium; under total reflection its weight becomes 0.
void transmit(inout Path path, inout Interface at, vec3 n) {
    if (goes_on_in_shadow() && (path.shadowed || at.reflectance > 1.0 - HARDLY_PASSED)) {
        path.shadowed = true;
        path.weight *= max(1.0 - at.reflectance, LEAST_PASSED);
        copy_media(media, after);
        return;
    }
    // If the middle of the beam is totally reflected but the rest is not, the path goes straight on.
    float c1 = tissues[at.before].speed, c2 = tissues[at.behind].speed;
    if (goes_on_in_shadow()) path.bent += ray_bending(path.direction, path.lateral, at.ray, c1, c2);
    if ((frame.flags & FLAG_WAVEFRONT) != 0u) {
        path.lens.z += rows[row_of(path.time)].aperture * bending(path.direction, path.lateral, n, at.turning, c1, c2);
    }
    vec3 direction = path.direction, lateral = path.lateral;
    bool through = transmit_path(path, n, at.geometric, c1, c2) || at.curved;
    path.strip = strip_behind(path.strip, direction, lateral, path.lateral, n, at.turning, c1, c2);
    if (role == ROLE_MAIN) {
        float passed = mix(0.0, 1.0 - at.reflectance, through && at.reflectance < 1.0);
        path.weight *= mix(passed, max(passed, LEAST_PASSED), goes_on_in_shadow());
    } else if (!through) {
        atomicAdd(counters.paths_lost, 1u);
        path.weight = 0.0;
    }
    copy_media(media, after);
}

// Starkov et al. 2019, II-A, figure 5: with SAMPLING_PLAIN one of the reflected and the refracted ray is drawn at every surface.
void main() {
    // Sets the other counter to zero for the next dispatch.
    if (gl_GlobalInvocationID.x == 0u) {
        if (turn == 0u) counters.taken_odd = 0u; else counters.taken_even = 0u;
    }
    if (gl_LocalInvocationID.x >= lanes) return;
    float time_end = frame.depth / frame.speed;
    uint limit = 64u + frame.max_interactions;
    uint rays = 0u, met = 0u, written = 0u;
    bool steady = goes_on_in_shadow();
    uint node = 0u;
    // Number of paths for which this main path stands.
    uint copies = role == ROLE_MAIN && paths_are_alike() ? frame.paths : 1u;
    // The piece of work: paths of a line from `next` on; a main path, and the place of its interactions.
    uint line = 0u, next = 0u, last = 0u, main_path = NONE, slot = 0u;
    Path path;
    Echo echo;
    echo.waiting = 0u;
    uint n = 0u;
    bool going = false;
    // True if a mask is known to lie ahead of a path that is outside of all masks.
    bool aimed = false;
    // True while the first of two coincident surfaces has been found and the ray searches for the other.
    bool pairing = false;
    Met first = surface_met(Hit(0.0, NONE, NONE, 0.0, 0.0));
    float close = 0.0;

    uint guards = 0u, quota = most;
    for (uint guard = 0u;; ++guard) {
        deposit_echo(echo, line);
        bool alive = going && path.interactions < frame.max_interactions && path.crossings < limit
            && (steady ? path.weight > 0.0 : path.weight * path.survival >= frame.min_weight) && path.time < time_end;
        bool recalled = false;
        bool mean = false;
        Interface at;
        if (!alive || guard == guards) {
            if (next >= last || guard == guards) {
                if (role == ROLE_MAIN && main_path != NONE) {
                    // None follows what a line sends back that is there only for its neighbours.
                    interaction_count[main_path] = echoes_wanted(line % frame.scanlines) ? written : 0u;
                    if (steady) write_losses(line, node, path, 0.0, FOREVER, path.weight > 0.0);
                }
                if (!take_next(quota, line, next, last, main_path, slot)) {
                    // Inside the loop: naga loses values that a loop carries when they are used after it.
                    if (rays > 0u) atomicAdd(counters.rays, rays);
                    report_counts();
                    if (met > 0u) atomicAdd(counters.interactions, met);
                    break;
                }
                written = 0u;
                node = 0u;
                pairing = false;
                // A crossing takes three rays at most.
                guard = 0u;
                guards = 4u * limit * (last - next + 1u);
            }
            n = next;
            next += 1u;
            going = true;
            if (role != ROLE_BRANCHES) {
                start(line, n, path, media);
                // If all paths of a line begin alike, origin has checked it.
                aimed = frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0;
                continue;
            }
            recall(slot, line, path, at);
            mean = echoes_in_the_mean();
            met += mean ? (n == 0u ? frame.paths : 0u) : 1u;
            if (loses_by_aperture() && path.weight < frame.min_weight) {
                if (mean) last = next;
                going = false;
                continue;
            }
            aimed = false;
            recalled = true;
        } else {
            uint before = current_instance(media);
            Medium way = medium_of(tissue_of(before));
            bool heard = is_heard(media);
            // The acquired image assumes the probe's speed, so the way to the mask has it too.
            if (!heard || is_passed_by(path, way.speed)) way.speed = frame.speed;
            float t_end = (time_end - path.time) * way.speed;
            float face = path.reflections > 0u ? face_distance(probe_point(path.origin), probe_vector(path.direction)) : -1.0;
            bool at_face = face > path.t_min && face < t_end;
            if (at_face) t_end = face;
            bool bounces = at_face && (frame.flags & FLAG_FACE_REFLECTION) != 0u && path.reflections < frame.max_reflections;

            masks_only = !heard && !aimed && !bounces && !pairing;
            Hit hit = closest_hit(path.origin, path.direction, mix(path.t_min, max(first.hit.t - close, 0.0), pairing),
                mix(t_end, first.hit.t + close, pairing), mix(NONE, first.hit.instance, pairing));
            rays += 1u;
            if (masks_only) {
                // A path that misses all masks gives no more echoes.
                if (hit.instance == NONE) {
                    if (steady) write_losses(line, node, path, 0.0, FOREVER, false);
                    path.weight = 0.0;
                }
                aimed = true;
                continue;
            }
            Met here = surface_met(hit);
            Met other = Met(Hit(hit.t, NONE, NONE, 0.0, 0.0), vec3(0.0), vec3(0.0));
            if (pairing) {
                other = here;
                here = first;
                pairing = false;
            } else {
                aimed = !heard;
                if (hit.instance == NONE) {
                    emit_segment(path, line, n, before, t_end);
                    if (steady) write_losses(line, node, path, way.absorption * way.speed, FOREVER, true);
                    if (!bounces) {
                        path.weight = 0.0;
                        continue;
                    }
                    aimed = false;
                    vec3 end = path.origin + t_end * path.direction;
                    advance(path, t_end, way, end);
                    path.interactions += 1u;
                    met += 1u;
                    bounce(path, echo, line, n, heard);
                    continue;
                }
                close = clearance(here.position);
                if (is_left(path, hit)) {
                    path.t_min = hit.t + close;
                    path.crossings += 1u;
                    continue;
                }
                if ((frame.flags & FLAG_COINCIDENT) != 0u) {
                    first = here;
                    pairing = true;
                    continue;
                }
            }
            float past = here.hit.t + close;
            if (other.hit.instance != NONE) past = max(past, other.hit.t + close);
            // Rounding decides which of the two is found first; it must not decide which one echoes.
            if (other.hit.instance < here.hit.instance) {
                Met found = here;
                here = other;
                other = found;
            }
            bool entering = dot(path.direction, here.normal) < 0.0;
            toggle(here, other, path.direction, copies);
            uint behind = current_instance(after);
            path.crossings += 1u;
            bool heard_after = is_heard(after);
            bool outside = !heard && !heard_after;
            bool passes = behind == before || outside;
            if (passes && heard_after == heard && behind == before) {
                path.t_min = past;
                copy_media(media, after);
                continue;
            }
            emit_segment(path, line, n, before, here.hit.t);
            float met_at = path.time + here.hit.t / way.speed;
            if (steady) write_losses(line, node, path, way.absorption * way.speed, met_at, true);
            advance(path, here.hit.t, way, here.position);
            if (steady) path.weight = max(path.weight, LEAST_MAIN);
            leave(path, here.hit);
            if (passes) {
                // The mask begins or ends within a medium: the segment is cut there. Outside the mask another
                // medium begins, and sound goes straight on.
                path.t_min = max(path.t_min, past - here.hit.t);
                if (behind != before) {
                    path.weight *= passed(tissues[tissue_of(before)].impedance, tissues[tissue_of(behind)].impedance);
                    path.interactions += 1u;
                }
                copy_media(media, after);
                continue;
            }
            aimed = false;
            path.interactions += 1u;
            meet(at, here, entering, path, tissue_of(before), tissue_of(behind));
            if (role == ROLE_MAIN) {
                // The far side of what throws the shadow is hidden from all of the aperture.
                bool hidden = path.shadowed && at.reflectance > 1.0 - HARDLY_PASSED;
                write_down(slot + written, path, n, at, mix(path.weight, 0.0, hidden));
                written += 1u;
            }
        }

        bool rough_through = (frame.flags & FLAG_ROUGH_TRANSMISSION) != 0u;
        uint key = path.interactions + 32u * path.reflections;
        vec3 arrived = vec3(path.weight, path.share, path.probability);
        bool follows = true;
        if (recalled) {
            uint wanted;
            follows = branch(path, line, n, key, at, wanted);
            if (mean) last = min(last, max(wanted, next));
        }
        vec3 m = at.shading;
        bool rough = false;
        if (role == ROLE_MAIN ? rough_through : !mean || follows) {
            rough = rough_normal(path.direction, at.shading, at.geometric, surfaces[at.surface].roughness, n, key,
                frame.seed, (frame.flags & FLAG_SOBOL) != 0u, m);
        }
        bool reflects = false;
        if (role != ROLE_MAIN) {
            if (!recalled) met += 1u;
            echo.key = key;
            bool echoes = mean ? n == 0u && is_mirrored(path.direction, at) : rough;
            if (echoes) make_echo(echo, path, arrived, line, n, at, mix(m, at.shading, bvec3(mean)), mean);
            bool can_reflect = rough && path.reflections < frame.max_reflections;
            if (recalled) {
                reflects = follows && can_reflect;
                going = reflects;
            } else {
                reflects = path.branch ? parts(path, line, n, key, at) : choose(path, n, key, at.reflectance);
                going = can_reflect || !reflects;
            }
        }
        if (!going) continue;
        if (reflects) {
            reflect_path(path, m, surfaces[at.surface].roughness, at.turn);
            continue;
        }
        transmit(path, at, mix(at.refracting, m, bvec3(rough && rough_through)));
    }
}
