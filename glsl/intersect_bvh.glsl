// Closest hit by a walk down a two-level bounding volume hierarchy.
//
// The includer declares: instances[], vertices[], triangles[] and
// `uvec4 nodes[]`, four of them per node: 0 holds the reference of the top level's root in .x.
// A node has both children's boxes (Aila and Laine 2009):
//   (lo.x, hi.x, lo.y, hi.y) of child 0, the same of child 1, (lo.z, hi.z) of 0 and 1,
//   (reference 0, reference 1, -, -).
// A reference is a node's index, or BVH_LEAF with: an instance (top level), or count - 1 and the
// first triangle.

const uint BVH_STACK = 64u;            // the builder refuses deeper trees
const uint BVH_LEAF = 0x80000000u;
const uint BVH_COUNT_SHIFT = 27u;
const uint BVH_FIRST_MASK = 0x07ffffffu;

// Exceeds 1 + 2 gamma_3 (Ize 2013) by the rounding of the sheared vertices below, which is a few
// ulps of the same distances: a box never misses what the triangle test would hit.
const float BVH_SLACK = 1.0000012;

#ifdef COUNT
uint bvh_node_visits = 0u;
uint bvh_triangle_tests = 0u;
#endif

struct BvhRay {
    vec3 origin;
    vec3 above;        // origin, moved up and down along the axes where the direction is zero:
    vec3 below;        // there a box is met exactly when it contains the origin
    vec3 inverse;
    vec3 shear;        // Woop, Benthin, Wald 2013, section 3.1
    uint axis;         // along which the direction is largest
};

vec3 bvh_permute(vec3 v, uint axis) {
    return axis == 0u ? v.yzx : (axis == 1u ? v.zxy : v);
}

BvhRay bvh_ray(vec3 origin, vec3 direction) {
    vec3 size = abs(direction);
    bvec3 zero = lessThan(size, vec3(1e-30));
    vec3 margin = max(abs(origin) * 5e-7, vec3(1e-18));
    BvhRay ray;
    ray.origin = origin;
    ray.above = mix(origin, origin + margin, zero);
    ray.below = mix(origin, origin - margin, zero);
    ray.inverse = 1.0 / mix(direction, vec3(1e-30), zero);
    ray.axis = size.x > size.y ? (size.x > size.z ? 0u : 2u) : (size.y > size.z ? 1u : 2u);
    vec3 d = bvh_permute(direction, ray.axis);
    ray.shear = vec3(d.x / d.z, d.y / d.z, 1.0 / d.z);
    return ray;
}

// Distance at which the box is entered; more than t_max: it is missed.
float bvh_box(BvhRay ray, vec3 lo, vec3 hi, float t_min, float t_max) {
    vec3 a = (lo - ray.above) * ray.inverse;
    vec3 b = (hi - ray.below) * ray.inverse;
    vec3 near = min(a, b);
    vec3 far = max(a, b);
    float enter = max(max(near.x, near.y), max(near.z, t_min));
    float leave = min(min(far.x, far.y), far.z) * BVH_SLACK;
    return enter <= min(leave, t_max) ? enter : 3.4e38;
}

vec3 bvh_vertex(uint index) {
    return vec3(vertices[3u * index], vertices[3u * index + 1u], vertices[3u * index + 2u]);
}

// Watertight: products are rounded alike for both triangles of an edge (`precise`: no fused
// multiply-add), and rounding is monotonic, so that an edge function has its true sign or is zero;
// zero counts as inside for both.
void bvh_triangle(BvhRay ray, uint instance, uint triangle, float t_min, inout Hit hit) {
    vec3 a = bvh_permute(bvh_vertex(triangles[3u * triangle]) - ray.origin, ray.axis);
    vec3 b = bvh_permute(bvh_vertex(triangles[3u * triangle + 1u]) - ray.origin, ray.axis);
    vec3 c = bvh_permute(bvh_vertex(triangles[3u * triangle + 2u]) - ray.origin, ray.axis);
    precise vec2 p = a.xy - ray.shear.xy * a.z;
    precise vec2 q = b.xy - ray.shear.xy * b.z;
    precise vec2 r = c.xy - ray.shear.xy * c.z;
    precise float u = r.x * q.y - r.y * q.x;
    precise float v = p.x * r.y - p.y * r.x;
    precise float w = q.x * p.y - q.y * p.x;
    if (min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0) return;
    float determinant = u + v + w;
    if (determinant == 0.0) return;
    float inverse = 1.0 / determinant;
    float t = (u * a.z + v * b.z + w * c.z) * ray.shear.z * inverse;
    if (t > t_min && t < hit.t) hit = Hit(t, instance, triangle, v * inverse, w * inverse);
}

// The first surface with t_min < t < t_max along origin + t direction, world space; direction need
// not be a unit vector. All of `skip_instance` is transparent; NONE: nothing is.
// Miss: instance NONE, t = t_max. Input that is not finite misses.
Hit closest_hit(vec3 origin, vec3 direction, float t_min, float t_max, uint skip_instance) {
    Hit hit = Hit(t_max, NONE, NONE, 0.0, 0.0);
    uint reference = nodes[0].x;
    float size = max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
    bool finite = all(lessThan(abs(origin), vec3(1e18))) && all(lessThan(abs(direction), vec3(1e18)));
    if (reference == NONE || !finite || !(size > 1e-18)) return hit;

    uint stack[BVH_STACK];
    uint depth = 0u;
    uint instance = NONE;     // whose triangles are walked; NONE: the top level
    uint base = 0u;           // depth of the stack below which the top level lies
    BvhRay ray = bvh_ray(origin, direction);
    while (true) {
        if ((reference & BVH_LEAF) == 0u) {
#ifdef COUNT
            bvh_node_visits += 1u;
#endif
            uint n = 4u * reference;
            vec4 first = uintBitsToFloat(nodes[n]);
            vec4 second = uintBitsToFloat(nodes[n + 1u]);
            vec4 both = uintBitsToFloat(nodes[n + 2u]);
            uvec4 children = nodes[n + 3u];
            float t0 = bvh_box(ray, vec3(first.xz, both.x), vec3(first.yw, both.y), t_min, hit.t);
            float t1 = bvh_box(ray, vec3(second.xz, both.z), vec3(second.yw, both.w), t_min, hit.t);
            bool swap = t1 < t0;
            if (min(t0, t1) < 3e38) {
                reference = swap ? children.y : children.x;
                if (max(t0, t1) < 3e38 && depth < BVH_STACK) {
                    stack[depth] = swap ? children.x : children.y;
                    depth += 1u;
                }
                continue;
            }
        } else if (instance == NONE) {
            uint entered = reference & ~BVH_LEAF;
            if (entered != skip_instance) {
                instance = entered;
                base = depth;
                vec4 x = instances[instance].object_from_world[0];
                vec4 y = instances[instance].object_from_world[1];
                vec4 z = instances[instance].object_from_world[2];
                ray = bvh_ray(
                    vec3(dot(x.xyz, origin) + x.w, dot(y.xyz, origin) + y.w, dot(z.xyz, origin) + z.w),
                    vec3(dot(x.xyz, direction), dot(y.xyz, direction), dot(z.xyz, direction)));
                reference = instances[instance].bvh_root;
                continue;
            }
        } else {
            uint begin = reference & BVH_FIRST_MASK;
            uint count = ((reference & ~BVH_LEAF) >> BVH_COUNT_SHIFT) + 1u;
            for (uint i = 0u; i < count; i++) {
#ifdef COUNT
                bvh_triangle_tests += 1u;
#endif
                bvh_triangle(ray, instance, begin + i, t_min, hit);
            }
        }
        if (depth == base && instance != NONE) {
            instance = NONE;
            base = 0u;
            ray = bvh_ray(origin, direction);
        }
        if (depth == 0u) break;
        depth -= 1u;
        reference = stack[depth];
    }
    return hit;
}
