// Place and normals of a hit. The includer declares instances[], vertices[], normals[], triangles[].

// A vector scaled by a power of two at most once more than needed, so that its square neither
// overflows nor vanishes for triangles of any size.
vec3 surface_normalize(vec3 v) {
    float size = max(max(abs(v.x), abs(v.y)), abs(v.z));
    return mix(vec3(0.0), normalize(v / size), bvec3(size > 0.0));
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

// A hit, and the triangle there: world position, mm, and unit outward normal, both zero where there is no hit.
struct Met { Hit hit; vec3 position; vec3 normal; };

Met surface_met(Hit hit) {
    Met met = Met(hit, vec3(0.0), vec3(0.0));
    if (hit.instance != NONE) {
        met.position = surface_position(hit);
        met.normal = surface_geometric_normal(hit);
    }
    return met;
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

// Change of the normal over the way `along` (world, mm). `corners`: normals of the triangle's corners, object space,
// any length.
vec3 surface_turning(Hit hit, vec3 along, vec3 corners[3]) {
    uint i = triangles[3u * hit.primitive];
    uint j = triangles[3u * hit.primitive + 1u];
    uint k = triangles[3u * hit.primitive + 2u];
    vec3 corner = surface_vertex(i);
    vec4 to_j = vec4(surface_vertex(j) - corner, 0.0);
    vec4 to_k = vec4(surface_vertex(k) - corner, 0.0);
    vec3 u, v;
    for (int row = 0; row < 3; ++row) {
        u[row] = dot(instances[hit.instance].world_from_object[row], to_j);
        v[row] = dot(instances[hit.instance].world_from_object[row], to_k);
    }
    vec3 n = surface_to_world(hit.instance, corners[0]);
    vec3 n_u = surface_to_world(hit.instance, corners[1]) - n;
    vec3 n_v = surface_to_world(hit.instance, corners[2]) - n;
    vec3 across = cross(u, v);
    float area2 = dot(across, across);
    if (!(area2 > 0.0)) return vec3(0.0);
    // `along`, projected into the triangle, in coordinates of its edges.
    float a = dot(cross(along, v), across) / area2;
    float b = dot(cross(u, along), across) / area2;
    return a * n_u + b * n_v;
}

// Rotation of the normal along the direction `along` (world, any length): radians per mm, unsigned. `corners` as above.
float surface_curvature(Hit hit, vec3 along, vec3 corners[3]) {
    float size = dot(along, along);
    if (!(size > 0.0)) return 0.0;
    return abs(dot(surface_turning(hit, along, corners), along)) / size;
}
