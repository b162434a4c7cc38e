// Where a ray met a surface. The includer declares instances[], vertices[], normals[], triangles[].

// A vector scaled by a power of two at most once more than needed, so that its square neither
// overflows nor vanishes for triangles of any size.
vec3 surface_normalize(vec3 v) {
    float size = max(max(abs(v.x), abs(v.y)), abs(v.z));
    return size > 0.0 ? normalize(v / size) : vec3(0.0);
}

vec3 surface_vertex(uint index) {
    return vec3(vertices[3u * index], vertices[3u * index + 1u], vertices[3u * index + 2u]);
}

// Normals are covectors: the inverse transpose keeps outward outward in mirrored instances too.
vec3 surface_to_world(uint instance, vec3 normal) {
    return surface_normalize(normal.x * instances[instance].object_from_world[0].xyz
        + normal.y * instances[instance].object_from_world[1].xyz
        + normal.z * instances[instance].object_from_world[2].xyz);
}

// World position from the barycentrics, mm: on the triangle to rounding of its coordinates, where
// origin + t direction also carries the rounding of t.
vec3 surface_position(Hit hit) {
    vec3 a = surface_vertex(triangles[3u * hit.primitive]);
    vec3 b = surface_vertex(triangles[3u * hit.primitive + 1u]);
    vec3 c = surface_vertex(triangles[3u * hit.primitive + 2u]);
    vec4 p = vec4(a + hit.u * (b - a) + hit.v * (c - a), 1.0);
    return vec3(dot(instances[hit.instance].world_from_object[0], p),
        dot(instances[hit.instance].world_from_object[1], p),
        dot(instances[hit.instance].world_from_object[2], p));
}

// Unit outward normal of the triangle, world space.
vec3 surface_geometric_normal(Hit hit) {
    vec3 a = surface_vertex(triangles[3u * hit.primitive]);
    vec3 b = surface_vertex(triangles[3u * hit.primitive + 1u]);
    vec3 c = surface_vertex(triangles[3u * hit.primitive + 2u]);
    return surface_to_world(hit.instance, surface_normalize(cross(b - a, c - a)));
}

// Unit outward normal interpolated from the vertices, world space; the zero vector where they cancel.
vec3 surface_shading_normal(Hit hit) {
    uint a = 3u * triangles[3u * hit.primitive];
    uint b = 3u * triangles[3u * hit.primitive + 1u];
    uint c = 3u * triangles[3u * hit.primitive + 2u];
    vec3 n = (1.0 - hit.u - hit.v) * vec3(normals[a], normals[a + 1u], normals[a + 2u])
        + hit.u * vec3(normals[b], normals[b + 1u], normals[b + 2u])
        + hit.v * vec3(normals[c], normals[c + 1u], normals[c + 2u]);
    return surface_to_world(hit.instance, n);
}
