// variants: bvh query(RAY_QUERY) count(COUNT)
#version 460
// Which media enclose the start of each line: signed crossings along its ray to infinity.
#extension GL_GOOGLE_include_directive : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"

layout(local_size_x = 64) in;

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
layout(std430, binding = 6) buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 7) buffer CounterBuffer { Counters counters; };

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

void main() {
    uint line = gl_GlobalInvocationID.x;
    if (line >= frame.scanlines * frame.layers) return;
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    o = world_point(o);
    d = world_vector(d);
    float t_min = 0.0;
    for (uint order = 1u; order <= MAX_CROSSINGS; ++order) {
        Hit hit = closest_hit(o, d, t_min, 1e9, NONE);
        if (hit.instance == NONE) break;
        vec3 p = o + hit.t * d;
        float clearance = 4e-6 * max(max(abs(p.x), abs(p.y)), max(abs(p.z), 1.0));
        note_crossing(hit.instance, dot(d, surface_geometric_normal(hit)) < 0.0, 2u * order);
        t_min = hit.t + clearance;
        if ((frame.flags & FLAG_COINCIDENT) != 0u) {
            Hit twin = closest_hit(o, d, max(hit.t - clearance, 0.0), hit.t + clearance, hit.instance);
            if (twin.instance != NONE) {
                note_crossing(twin.instance, dot(d, surface_geometric_normal(twin)) < 0.0, 2u * order + 1u);
                t_min = max(t_min, twin.t + clearance);
            }
        }
    }
    report_counts();
    // The outermost first: it is left last.
    uint base = line * (MAX_STACK + 1u);
    uint count = 0u;
    uint last = NONE;
    for (uint i = 0u; i < open_count; ++i) {
        uint best = MAX_OPEN;
        for (uint j = 0u; j < open_count; ++j) {
            if (open_net[j] > 0 && open_order[j] < last && (best == MAX_OPEN || open_order[j] > open_order[best])) best = j;
        }
        if (best == MAX_OPEN) break;
        if (count == MAX_STACK) { atomicAdd(counters.stack_overflow, 1u); break; }
        stacks[base + 1u + count] = open_ids[best];
        count += 1u;
        last = open_order[best];
    }
    stacks[base] = count;
    for (uint i = count; i < MAX_STACK; ++i) stacks[base + 1u + i] = NONE;
}
