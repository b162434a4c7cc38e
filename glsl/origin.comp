// variants: bvh query(RAY_QUERY) count(COUNT)
#version 460
// The media that enclose the start of each line, from signed crossings along its ray to infinity, or along the ray the other
// way where their order does not matter and no surface is at the start. If only echoes from inside a mask are wanted, the way to it
// is the same for all paths of a line, which then begin at its last surface.
#extension GL_GOOGLE_include_directive : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"

// Few lines, each on a way of its own: eight to a group, so that they wait for few others, and more of a GPU has work.
layout(local_size_x = 8) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 2) restrict readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 3) restrict readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 4) restrict readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 5) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 5) restrict readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 6) restrict buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 7) restrict buffer CounterBuffer { Counters counters; };
layout(std430, binding = 8) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 9) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };

#include "triangle.glsl"

const uint ALL = 0u;
const uint BEHIND = 1u;         // instances that may enclose the line's start, those whose box does; away from the line
const uint AROUND = 2u;         // the same instances, along the line
const uint MASKS = 3u;
uint wanted = ALL;              // the instances that rays meet
vec3 line_start;

bool skips(uint instance) {
    if (wanted == MASKS) return instances[instance].masks == 0u;
    if (wanted == ALL) return false;
    vec3 low = instances[instance].low.xyz, high = instances[instance].high.xyz;
    vec3 margin = 1e-5 * max(abs(low), abs(high));
    vec3 p = object_point(instance, line_start);
    return any(lessThan(p, low - margin)) || any(greaterThan(p, high + margin));
}
#define RAY_SKIPS(i) skips(i)
#define RAY_SELECTS (wanted != ALL)
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
#include "media.glsl"
#include "count.glsl"

const uint MAX_OPEN = 32u;      // instances that may be entered or left on the way
const uint MAX_CROSSINGS = 64u;
// Net exits per instance; an instance whose entries and exits balance frees its slot.
uint open_count = 0u;
uint open_ids[MAX_OPEN];
int open_net[MAX_OPEN];
uint open_order[MAX_OPEN];

void note_crossing(uint instance, bool entering, uint order) {
    uint at = open_count;
    for (uint i = 0u; i < open_count; ++i) {
        if (open_ids[i] == instance) at = i;
    }
    if (at == open_count) {
        if (open_count == MAX_OPEN) { atomicAdd(counters.stack_overflow, 1u); return; }
        open_ids[at] = instance;
        open_net[at] = 0;
        open_order[at] = 0u;
        open_count += 1u;
    }
    open_net[at] += entering ? -1 : 1;
    if (!entering) open_order[at] = order;
    if (open_net[at] == 0) {
        open_count -= 1u;
        open_ids[at] = open_ids[open_count];
        open_net[at] = open_net[open_count];
        open_order[at] = open_order[open_count];
    }
}

// Distance below which two surfaces at a place are at the same one.
float closeness(vec3 p) { return 4e-6 * max(max(abs(p.x), abs(p.y)), max(abs(p.z), 1.0)); }

bool enters(vec3 d, Hit hit) { return dot(d, surface_geometric_normal(hit)) < 0.0; }

// True if of the instances that enclose the start no two have the same priority, and all fit into a stack: it is the same
// then in which order they are left.
bool is_ordered() {
    uint count = 0u;
    for (uint i = 0u; i < open_count; ++i) {
        if (open_net[i] <= 0) continue;
        count += 1u;
        for (uint j = 0u; j < i; ++j) {
            if (open_net[j] > 0 && instances[open_ids[j]].priority == instances[open_ids[i]].priority) return false;
        }
    }
    return count <= MAX_STACK;
}

// The media that enclose the start, once all crossings are noted; the outermost first, as it is left last.
void enclose(inout Media media) {
    media.count = 0u;
    uint last = NONE;
    for (uint i = 0u; i < open_count; ++i) {
        uint best = MAX_OPEN;
        for (uint j = 0u; j < open_count; ++j) {
            if (open_net[j] > 0 && open_order[j] < last && (best == MAX_OPEN || open_order[j] > open_order[best])) best = j;
        }
        if (best == MAX_OPEN) break;
        if (media.count == MAX_STACK) { atomicAdd(counters.stack_overflow, 1u); break; }
        media.ids[media.count] = open_ids[best];
        media.count += 1u;
        last = open_order[best];
    }
    if (media.count == 0u && frame.couplant != NONE) {
        media.ids[0] = frame.couplant;
        media.count = 1u;
    }
}

// Starkov et al. 2019, II-C, figure 11: what lies in front of the outermost anatomy costs depth and energy alone.
void write_start(uint line, inout Media media, float travelled, float weight, uint interactions) {
    uint base = line * START_WORDS;
    stacks[base] = media.count;
    for (uint i = 0u; i < MAX_STACK; ++i) stacks[base + 1u + i] = i < media.count ? media.ids[i] : NONE;
    stacks[base + MAX_STACK + 1u] = floatBitsToUint(travelled);
    stacks[base + MAX_STACK + 2u] = floatBitsToUint(weight);
    stacks[base + MAX_STACK + 3u] = interactions;
}

void main() {
    uint line = gl_GlobalInvocationID.x;
    if (line >= frame.scanlines * frame.layers) return;
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    o = world_point(o);
    d = world_vector(d);
    line_start = o;
    Media media, after;
    media.count = 0u;
    // Paths with a random start or direction each have a way of their own.
    bool masked = (frame.flags & FLAG_MASKED) != 0u && frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0;
    float mask_t = 0.0, travelled = 0.0, weight = 1.0;
    uint interactions = 0u;
    // Three tasks: whether a mask is ahead; the media around the start, looked for away from the line first, as a probe lies on
    // the body and there is little of it behind; the way to the mask, straight on as long as no echo is wanted. One loop for
    // all, so that the kernel contains the traversal once.
    wanted = masked ? MASKS : BEHIND;
    float t_min = 0.0;
    uint order = 0u;
    // A surface at the start is inside or outside as the line's own ray finds it, which paths follow, too. So the other ray begins
    // as far in front of the start, and is not used if it meets one as near as that behind it.
    float at_start = closeness(o);
    // The first of two surfaces that coincide was found; the ray looks for the other.
    bool pairing = false;
    Hit first = Hit(0.0, NONE, NONE, 0.0, 0.0);
    float close = 0.0;
    bool done = false;
    while (true) {
        vec3 way = wanted == BEHIND ? -d : d, from = wanted == BEHIND ? o + at_start * d : o;
        Hit hit = closest_hit(from, way, pairing ? max(first.t - close, 0.0) : t_min,
            pairing ? first.t + close : (wanted == ALL ? frame.depth : 1e9), pairing ? first.instance : NONE);
        if (wanted == MASKS) {
            // Outside of all masks, and none is ahead.
            if (hit.instance == NONE) { weight = 0.0; done = true; }
            mask_t = hit.t;
            wanted = BEHIND;
        } else if (!pairing && hit.instance != NONE && (frame.flags & FLAG_COINCIDENT) != 0u) {
            first = hit;
            pairing = true;
            close = closeness(from + hit.t * way);
        } else {
            Hit twin = Hit(hit.t, NONE, NONE, 0.0, 0.0);
            if (pairing) {
                twin = hit;
                hit = first;
                pairing = false;
            } else {
                close = closeness(from + hit.t * way);
            }
            bool met = hit.instance != NONE;
            uint surfaces = met ? (twin.instance != NONE ? 2u : 1u) : 0u;
            order += 1u;
            t_min = hit.t + close;
            if (twin.instance != NONE) t_min = max(t_min, twin.t + close);
            if (wanted == ALL) copy_media(after, media);
            // As in trace, the instance with the lower number first.
            bool turned = wanted == ALL && twin.instance < hit.instance;
            for (uint i = 0u; i < surfaces; ++i) {
                Hit each = hit;
                if ((i == 0u) == turned) each = twin;
                bool entering = enters(way, each);
                if (wanted != ALL) note_crossing(each.instance, entering, 2u * order + i);
                else if (!cross_interface(after, each.instance, entering)) atomicAdd(counters.stack_overflow, 1u);
            }
            if (wanted != ALL) {
                bool ends = !met || order == MAX_CROSSINGS;
                bool unsure = met && order == 1u && hit.t < 2.0 * at_start;
                if (wanted == BEHIND && (unsure || (ends && (met || !is_ordered())))) {
                    open_count = 0u;
                    wanted = AROUND;
                    ends = true;
                } else if (ends) {
                    enclose(media);
                    done = !masked || is_heard(media);
                    if (!done && mask_t >= frame.depth) { weight = 0.0; done = true; }
                    wanted = ALL;
                }
                if (ends) {
                    t_min = 0.0;
                    order = 0u;
                }
            } else {
                done = !met || is_heard(after);
                if (!done) {
                    uint before = current_instance(media), behind = current_instance(after);
                    uint t1 = tissue_of(before), t2 = tissue_of(behind);
                    float t = twin.instance == NONE ? hit.t : max(hit.t, twin.t);
                    weight *= exp(-tissues[t1].absorption * (t - travelled));
                    if (before != behind) {
                        weight *= passed(tissues[t1].impedance, tissues[t2].impedance);
                        interactions += 1u;
                    }
                    travelled = t;
                    copy_media(media, after);
                    done = order == MAX_CROSSINGS;
                }
            }
        }
        if (done) {
            // Inside the loop: naga loses values that a loop carries when they are used after it.
            report_counts();
            write_start(line, media, travelled, weight, interactions);
            break;
        }
    }
}
