// variants: bvh query(RAY_QUERY) count(COUNT)
// Intersects a list of rays: the tracers without the acoustics, for comparison with brute force.
#version 460
#extension GL_GOOGLE_include_directive : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif

#include "shared.glsl"

layout(local_size_x = 64) in;

struct Ray {
    vec4 origin;      // mm; t_min
    vec4 direction;   // t_max
    uvec4 skip;       // instance; mask bits that are shown; whether rows choose among their entries; unused
};

struct RayHit {
    vec4 position;    // from the barycentrics, mm; t
    vec4 geometric;   // outward normal; u
    vec4 shading;     // outward normal; v
    uint instance; uint primitive; uint node_visits; uint triangle_tests;
    uint top_visits; uint instances_reached; uint false_unions; uint false_boxes;
};

layout(std430, binding = 0) readonly buffer Instances { Instance instances[]; };
layout(std430, binding = 1) readonly buffer Vertices { float vertices[]; };
layout(std430, binding = 2) readonly buffer Normals { float normals[]; };
layout(std430, binding = 3) readonly buffer Triangles { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 4) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 4) readonly buffer Nodes { uvec4 nodes[]; };
#endif
layout(std430, binding = 5) readonly buffer Rays { Ray rays[]; };
layout(std430, binding = 6) buffer Hits { RayHit hits[]; };

#include "triangle.glsl"
#ifdef RAY_QUERY
uint ray_mask;
bool ray_slots;
#define RAY_MASK ray_mask
#define RAY_SLOTS ray_slots
#include "intersect_query.glsl"
#else
#include "intersect_bvh.glsl"
#endif
#include "surface.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= uint(rays.length())) return;
    vec4 origin = rays[i].origin;
    vec4 direction = rays[i].direction;
#ifdef RAY_QUERY
    ray_mask = rays[i].skip.y;
    ray_slots = rays[i].skip.z != 0u;
#endif
    Hit hit = closest_hit(origin.xyz, direction.xyz, origin.w, direction.w, rays[i].skip.x);

    vec3 position = vec3(0.0), geometric = vec3(0.0), shading = vec3(0.0);
    if (hit.instance != NONE) {
        position = surface_position(hit);
        geometric = surface_geometric_normal(hit);
        shading = surface_shading_normal(hit);
    }
    hits[i].position = vec4(position, hit.t);
    hits[i].geometric = vec4(geometric, hit.u);
    hits[i].shading = vec4(shading, hit.v);
    hits[i].instance = hit.instance;
    hits[i].primitive = hit.primitive;
#ifdef COUNT
    hits[i].node_visits = bvh_node_visits;
    hits[i].triangle_tests = bvh_triangle_tests;
    hits[i].top_visits = bvh_top_visits;
    hits[i].instances_reached = bvh_instances_reached;
    hits[i].false_unions = bvh_false_unions;
    hits[i].false_boxes = bvh_false_boxes;
#else
    hits[i].node_visits = 0u;
    hits[i].triangle_tests = 0u;
    hits[i].top_visits = 0u;
    hits[i].instances_reached = 0u;
    hits[i].false_unions = 0u;
    hits[i].false_boxes = 0u;
#endif
}
