// variants: bvh query(RAY_QUERY)
#version 460
// Along each scanline, straight through the masking geometry: is the sample outside, and what does
// the acquired volume show there? One work group is one scanline in the middle of the slice.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require
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
layout(std430, binding = 6) readonly buffer FusionBuffer { Fusion fusion; };
layout(binding = 7) uniform texture3D acquired;
layout(std430, binding = 8) buffer CounterBuffer { Counters counters; };
layout(std430, binding = 9) buffer PrescanBuffer { float prescan[]; };
layout(std430, binding = 10) readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 11) readonly buffer TissueBuffer { Tissue tissues[]; };

#define RAY_SKIPS(i) (instances[i].masks == 0u)
#define RAY_SELECTS true
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

const uint MAX_CROSSINGS = 64u;

// Distances at which the scanline goes into a masking instance; negative where it comes out.
shared float crossings[MAX_CROSSINGS];
shared uint crossed[MAX_CROSSINGS];       // which
shared float depths[MAX_CROSSINGS];       // mm at the probe's speed at which the sound that is there echoes,
shared float rates[MAX_CROSSINGS + 1u];   // and mm of distance per mm of that depth: up to there, and behind the last
shared uint crossing_count;
// Masking instances around the scanline's start: those that it leaves more often than it enters.
shared int enclosing;

void note_crossing(Hit hit, vec3 d) {
    bool entering = dot(d, surface_geometric_normal(hit)) < 0.0;
    if (crossing_count < MAX_CROSSINGS) {
        crossings[crossing_count] = entering ? hit.t : -hit.t;
        crossed[crossing_count] = hit.instance;
        crossing_count += 1u;
        enclosing += entering ? -1 : 1;
    } else {
        atomicAdd(counters.stack_overflow, 1u);
    }
}

void cross_masks(vec3 o, vec3 d) {
    crossing_count = 0u;
    enclosing = 0;
    float t_min = 0.0;
    for (uint order = 0u; order <= MAX_CROSSINGS; ++order) {
        Hit hit = closest_hit(o, d, t_min, 1e9, NONE);
        if (hit.instance == NONE) break;
        note_crossing(hit, d);
        vec3 p = o + hit.t * d;
        float clearance = 4e-6 * max(max(abs(p.x), abs(p.y)), max(abs(p.z), 1.0));
        t_min = hit.t + clearance;
        if ((frame.flags & FLAG_COINCIDENT) != 0u) {
            Hit twin = closest_hit(o, d, max(hit.t - clearance, 0.0), hit.t + clearance, hit.instance);
            if (twin.instance != NONE) {
                note_crossing(twin, d);
                t_min = max(t_min, twin.t + clearance);
            }
        }
    }
}

// Whether `instance` is around the scanline behind its first `passed` crossings: it then comes out more often
// than it goes in. Last: the crossing by which it went in, 1 for the first; 0 where it was around the start.
bool is_around(uint instance, uint passed, out uint entered) {
    int net = 0;
    entered = 0u;
    for (uint i = 0u; i < crossing_count; ++i) {
        if (crossed[i] != instance) continue;
        bool enters = crossings[i] > 0.0;
        if (i >= passed) net += enters ? -1 : 1;
        else if (enters) entered = i + 1u;
    }
    return net > 0;
}

// Distance per depth behind the first `passed` crossings: by the speed of the masking instance of the highest
// priority there, of equals the one entered last.
float rate_behind(uint passed) {
    if (fusion.mask_speed == MASK_SPEED_PROBE) return 1.0;
    uint best = NONE, best_entered = 0u;
    for (uint i = passed; i < crossing_count; ++i) {
        uint entered;
        if (!is_around(crossed[i], passed, entered)) continue;
        int ahead = best == NONE ? 1 : instances[crossed[i]].priority - instances[best].priority;
        if (ahead > 0 || ahead == 0 && entered > best_entered) {
            best = crossed[i];
            best_entered = entered;
        }
    }
    return best == NONE ? 1.0 : tissues[instances[best].tissue].speed / frame.speed;
}

void time_crossings() {
    float distance = 0.0, depth = 0.0;
    for (uint i = 0u; i <= crossing_count; ++i) {
        rates[i] = rate_behind(i);
        if (i == crossing_count) break;
        depth += (abs(crossings[i]) - distance) / rates[i];
        distance = abs(crossings[i]);
        depths[i] = depth;
    }
}

// By hand: the filters of many devices know only 256 places between two texels.
float acquired_level(vec3 voxel) {
    vec3 size = vec3(float(fusion.size_x), float(fusion.size_y), float(fusion.size_z));
    bool inside = all(greaterThanEqual(voxel, vec3(-0.5))) && all(lessThanEqual(voxel, size - 0.5));
    if (!inside) return 0.0;
    vec3 p = clamp(voxel, vec3(0.0), size - 1.0);
    ivec3 a = ivec3(p);
    ivec3 b = min(a + 1, ivec3(size) - 1);
    vec3 f = p - vec3(a);
    float near = mix(
        mix(texelFetch(acquired, a, 0).x, texelFetch(acquired, ivec3(b.x, a.y, a.z), 0).x, f.x),
        mix(texelFetch(acquired, ivec3(a.x, b.y, a.z), 0).x, texelFetch(acquired, ivec3(b.x, b.y, a.z), 0).x, f.x), f.y);
    float far = mix(
        mix(texelFetch(acquired, ivec3(a.x, a.y, b.z), 0).x, texelFetch(acquired, ivec3(b.x, a.y, b.z), 0).x, f.x),
        mix(texelFetch(acquired, ivec3(a.x, b.y, b.z), 0).x, texelFetch(acquired, b, 0).x, f.x), f.y);
    return clamp(mix(near, far, f.z) * fusion.slope + fusion.intercept, 0.0, 1.0);
}

void main() {
    uint line = gl_WorkGroupID.x;
    vec3 o, d, lateral;
    probe_ray(line, 0u, o, d, lateral);
    o.y = 0.0;
    o = world_point(o);
    d = world_vector(d);
    if (gl_LocalInvocationID.x == 0u) {
        cross_masks(o, d);
        time_crossings();
    }
    barrier();
    vec3 start = apply_point(fusion.voxel_from_world, o);
    vec3 along = apply_vector(fusion.voxel_from_world, d);
    for (uint k = gl_LocalInvocationID.x; k < frame.samples; k += 64u) {
        float depth = float(k) * frame.sample_pitch;
        int around = enclosing;
        float t = rates[0] * depth;
        for (uint i = 0u; i < crossing_count && depths[i] <= depth; ++i) {
            around += crossings[i] > 0.0 ? 1 : -1;
            t = abs(crossings[i]) + rates[i + 1u] * (depth - depths[i]);
        }
        uint at = 2u * (line * frame.samples + k);
        prescan[at] = around > 0 ? 0.0 : 1.0;
        prescan[at + 1u] = acquired_level(start + t * along);
    }
}
