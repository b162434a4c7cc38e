// Intersection of a ray with a triangle, computed alike for both tracers: the rest of a path depends on the
// last bits of every hit, so a device's own distance would change the image.
//
// The includer declares instances[], vertices[], triangles[].

struct ShearedRay {
    vec3 origin;
    vec3 shear;        // Woop, Benthin, Wald 2013, section 3.1
    uint axis;         // axis along which the direction is largest
};

// `edges`: edge functions of the three corners; they have equal signs, or are zero, where the ray passes inside.
// `sum`: their sum; 0 for a triangle seen edge on, where t, u and v are undefined.
struct TriangleHit {
    vec3 edges;
    float sum;
    float t;
    float u;
    float v;
};

vec3 sheared_permute(vec3 v, uint axis) {
    return mix(mix(v, v.zxy, bvec3(axis == 1u)), v.yzx, bvec3(axis == 0u));
}

ShearedRay sheared_ray(vec3 origin, vec3 direction) {
    vec3 size = abs(direction);
    uint axis = mix(mix(2u, 1u, size.y > size.z), mix(2u, 0u, size.x > size.z), size.x > size.y);
    vec3 d = sheared_permute(direction, axis);
    precise vec3 shear = vec3(d.x / d.z, d.y / d.z, 1.0 / d.z);
    return ShearedRay(origin, shear, axis);
}

vec3 object_point(uint instance, vec3 p) {
    vec4 x = instances[instance].object_from_world[0];
    vec4 y = instances[instance].object_from_world[1];
    vec4 z = instances[instance].object_from_world[2];
    precise vec3 q = vec3(x.x * p.x + x.y * p.y + x.z * p.z + x.w, y.x * p.x + y.y * p.y + y.z * p.z + y.w,
        z.x * p.x + z.y * p.y + z.z * p.z + z.w);
    return q;
}

vec3 object_direction(uint instance, vec3 d) {
    vec4 x = instances[instance].object_from_world[0];
    vec4 y = instances[instance].object_from_world[1];
    vec4 z = instances[instance].object_from_world[2];
    precise vec3 e = vec3(x.x * d.x + x.y * d.y + x.z * d.z, y.x * d.x + y.y * d.y + y.z * d.z,
        z.x * d.x + z.y * d.y + z.z * d.z);
    return e;
}

// The instance to which a triangle belongs, in the structure of `entered`, which several instances may share.
uint triangle_owner(uint entered, uint triangle) {
    uint list = instances[entered].owners;
    if (list == 0u) return entered;
    uint i = triangle - instances[entered].first_triangle;
    return triangles[list + i / 2u] >> (16u * (i & 1u)) & 0xffffu;
}

vec3 triangle_vertex(uint index) {
    return vec3(vertices[3u * index], vertices[3u * index + 1u], vertices[3u * index + 2u]);
}

// Watertight: products are rounded alike for both triangles of an edge (`precise`: no fused
// multiply-add), and rounding is monotonic, so that an edge function has its true sign or is zero;
// zero counts as inside for both.
TriangleHit triangle_hit(ShearedRay ray, uint triangle) {
    vec3 a = sheared_permute(triangle_vertex(triangles[3u * triangle]) - ray.origin, ray.axis);
    vec3 b = sheared_permute(triangle_vertex(triangles[3u * triangle + 1u]) - ray.origin, ray.axis);
    vec3 c = sheared_permute(triangle_vertex(triangles[3u * triangle + 2u]) - ray.origin, ray.axis);
    precise vec2 p = a.xy - ray.shear.xy * a.z;
    precise vec2 q = b.xy - ray.shear.xy * b.z;
    precise vec2 r = c.xy - ray.shear.xy * c.z;
    precise float u = r.x * q.y - r.y * q.x;
    precise float v = p.x * r.y - p.y * r.x;
    precise float w = q.x * p.y - q.y * p.x;
    precise float sum = u + v + w;
    precise float inverse = 1.0 / sum;
    precise float t = (u * a.z + v * b.z + w * c.z) * ray.shear.z * inverse;
    precise vec2 uv = vec2(v, w) * inverse;
    return TriangleHit(vec3(u, v, w), sum, t, uv.x, uv.y);
}
