// variants: bvh query(RAY_QUERY)
#version 460
// Labels: the mesh and the tissue at each sample, straight along the scanline in the middle of the slice; the anatomy
// without refraction. One work group is one scanline.
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
layout(std430, binding = 6) buffer CounterBuffer { Counters counters; };
layout(std430, binding = 7) readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 8) buffer LabelBuffer { uint labels[]; };

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

// The instance around the scanline up to each crossing, and behind the last.
shared uint around[MAX_CROSSINGS + 1u];

void main() {
    uint line = gl_WorkGroupID.x;
    vec3 o, d, lateral;
    probe_ray(line, 0u, o, d, lateral);
    o.y = 0.0;
    if (gl_LocalInvocationID.x == 0u) {
        follow_scanline(world_point(o), world_vector(d));
        for (uint i = 0u; i <= crossing_count; ++i) around[i] = instance_behind(i);
    }
    barrier();
    for (uint k = gl_LocalInvocationID.x; k < frame.samples; k += 64u) {
        float distance = float(k) * frame.sample_pitch;
        uint passed = 0u;
        while (passed < crossing_count && abs(crossings[passed]) <= distance) ++passed;
        uint instance = around[passed];
        uint at = 2u * (line * frame.samples + k);
        labels[at] = instance;
        labels[at + 1u] = frame.background;
        if (passed == 0u && frame.couplant != NONE) labels[at + 1u] = instances[frame.couplant].tissue;
        if (instance != NONE) labels[at + 1u] = instances[instance].tissue;
    }
}
