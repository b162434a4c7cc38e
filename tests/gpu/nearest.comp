#version 460
#extension GL_EXT_ray_query : require
// For a ray per thread along +z: distance, custom index and triangle of the nearest hit.
layout(local_size_x = 64) in;
layout(binding = 0) uniform accelerationStructureEXT scene;
layout(std430, binding = 1) readonly buffer OriginBuffer { vec4 origins[]; };
layout(std430, binding = 2) writeonly buffer HitBuffer { vec4 hits[]; };
layout(push_constant) uniform Push { uint count; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xff, origins[i].xyz, 0.0,
                          vec3(0, 0, 1), 1e6);
    while (rayQueryProceedEXT(query)) {}
    vec4 hit = vec4(-1);
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        hit = vec4(rayQueryGetIntersectionTEXT(query, true),
                   rayQueryGetIntersectionInstanceCustomIndexEXT(query, true),
                   rayQueryGetIntersectionPrimitiveIndexEXT(query, true), 0);
    }
    hits[i] = hit;
}
