// variants: bvh query(RAY_QUERY)
#version 460
// Straight along each scanline through the masking geometry: the mask (1 outside) at each sample and the grey level of
// the acquired volume there, and what blocks of samples have. One work group is one scanline in the middle of the slice.
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
layout(std430, binding = 12) buffer BlockBuffer { uint mask_blocks[]; };

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

#include "crossings.glsl"

shared float depths[MAX_CROSSINGS];       // depth at which each crossing echoes, mm at the probe's speed
shared float rates[MAX_CROSSINGS + 1u];   // mm of distance per mm of depth, up to each crossing and behind the last

// Distance per depth behind the first `passed` crossings, from the speed of the masking instance there.
float rate_behind(uint passed) {
    if (fusion.mask_speed == MASK_SPEED_PROBE) return 1.0;
    uint around = instance_behind(passed);
    return around == NONE ? 1.0 : tissues[instances[around].tissue].speed / frame.speed;
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

// Linear filter by hand: the filters of many devices resolve only 256 positions between two texels.
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

// What the samples of a block have: TILE_ACQUIRED, TILE_SIMULATED.
uint block_has(uint block) {
    uint end = min((block + 1u) * MASK_BLOCK, frame.samples) - 1u;
    float first = float(block * MASK_BLOCK) * frame.sample_pitch;
    float last = float(end) * frame.sample_pitch;
    int around = enclosing;
    uint has = 0u;
    for (uint i = 0u; i <= crossing_count; ++i) {
        bool behind = i == crossing_count || depths[i] > first;
        if (behind) has |= around > 0 ? TILE_SIMULATED : TILE_ACQUIRED;
        if (i == crossing_count || depths[i] > last) break;
        around += crossings[i] > 0.0 ? 1 : -1;
    }
    return has;
}

// Starkov et al. 2019, II-C: the kernel that goes straight through the masking geometry and looks up the volume.
void main() {
    uint line = gl_WorkGroupID.x;
    vec3 o, d, lateral;
    probe_ray(line, 0u, o, d, lateral);
    o.y = 0.0;
    o = world_point(o);
    d = world_vector(d);
    if (gl_LocalInvocationID.x == 0u) {
        follow_scanline(o, d);
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
    uint blocks = (frame.samples + MASK_BLOCK - 1u) / MASK_BLOCK;
    for (uint block = gl_LocalInvocationID.x; block < blocks; block += 64u) {
        mask_blocks[line * blocks + block] = block_has(block);
    }
}
