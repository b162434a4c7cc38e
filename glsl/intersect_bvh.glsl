// Closest hit by traversal of a two-level, eight-wide bounding volume hierarchy.
//
// The includer includes triangle.glsl and declares `uvec4 nodes[]`, five of them per node, the format
// of Ylitie, Karras, Laine 2017 with each axis' planes together:
//   corner p (3 floats), exponents of the quantum e per axis and mask of inner children (4 bytes);
//   first inner child, first primitive, kind of each of 8 children (8 bytes);
//   per axis x, y, z: lower planes of the 8 children (8 bytes), upper planes (8 bytes): p + e byte.
// A child is 0 (none), 001 and 24 + its slot (inner), or the unary count of its primitives and their
// offset. Primitives are triangles, or in the top level places in a table of instances, which
// begins at the node nodes[0].y; of an instance's places rays enter the one that its row's `slot` names.
// If several instances share a structure, the table has one of them, and for each triangle its instance is
// looked up, so that rays pass those that are transparent or not shown.
// The top level's root is the node nodes[0].x; NONE: nothing is placed. nodes[0].z: 1 if some instances that share
// a structure are not shown.

// RAY_SKIPS(i): true if instance i is transparent besides `skip_instance`. RAY_SELECTS: true if any may be.
#ifndef RAY_SKIPS
#define RAY_SKIPS(i) false
#define RAY_SELECTS false
#endif

#ifdef COUNT
// The counters of shared.glsl; nodes are those of meshes and of the top level.
uint bvh_node_visits = 0u;
uint bvh_top_visits = 0u;
uint bvh_triangle_tests = 0u;
uint bvh_instances_reached = 0u;
uint bvh_false_unions = 0u;
uint bvh_false_boxes = 0u;
uint bvh_triangle_hits = 0u;   // before the last instance that was entered
#endif

struct BvhRay {
    vec3 origin;
    vec3 inverse;      // of the direction; finite where that is zero
    uint octant;       // of the direction, complemented, in each byte
    ShearedRay sheared;
};

BvhRay bvh_ray(vec3 origin, vec3 direction) {
    BvhRay ray;
    ray.origin = origin;
    vec3 size = abs(direction);
    ray.inverse = 1.0 / mix(direction, vec3(1e-24), lessThan(size, vec3(1e-24)));
    ray.octant = (ray.inverse.x < 0.0 ? 0u : 0x04040404u) | (ray.inverse.y < 0.0 ? 0u : 0x02020202u)
        | (ray.inverse.z < 0.0 ? 0u : 0x01010101u);
    ray.sheared = sheared_ray(origin, direction);
    return ray;
}

vec4 bvh_bytes(uint word) {
    return vec4(uvec4(word, word >> 8u, word >> 16u, word >> 24u) & 0xffu);
}

// Children of four slots that the ray meets before t_max: bits of inner children in traversal order
// from bit 24, of primitives below.
uint bvh_children(BvhRay ray, uint meta, uvec3 lo, uvec3 hi, vec3 scale, vec3 near, vec3 far, float t_min, float t_max) {
    bvec3 negative = lessThan(ray.inverse, vec3(0.0));
    uvec3 first = mix(lo, hi, negative);
    uvec3 last = mix(hi, lo, negative);
    vec4 enter = max(max(bvh_bytes(first.x) * scale.x + near.x, bvh_bytes(first.y) * scale.y + near.y),
        max(bvh_bytes(first.z) * scale.z + near.z, vec4(t_min)));
    vec4 leave = min(min(bvh_bytes(last.x) * scale.x + far.x, bvh_bytes(last.y) * scale.y + far.y),
        min(bvh_bytes(last.z) * scale.z + far.z, vec4(t_max)));
    bvec4 met = lessThanEqual(enter, leave);
    uint inner = (((meta & (meta << 1u)) & 0x10101010u) >> 4u) * 0xffu;
    uint place = (meta ^ (ray.octant & inner)) & 0x1f1f1f1fu;
    uint bits = (meta >> 5u) & 0x07070707u;
    uvec4 children = ((uvec4(bits) >> uvec4(0u, 8u, 16u, 24u)) & 0xffu) << ((uvec4(place) >> uvec4(0u, 8u, 16u, 24u)) & 0xffu);
    children = mix(uvec4(0u), children, met);
    return children.x | children.y | children.z | children.w;
}

// True if rays ignore a triangle found in a structure that instances share.
bool bvh_passes(uint entered, uint triangle, uint skip_instance) {
    if (instances[entered].owners == 0u) return false;   // checked at the top level
    uint owner = triangle_owner(entered, triangle);
    return owner == skip_instance || instances[owner].slot == NONE || RAY_SKIPS(owner);
}

// `selects`: true if rays may ignore some instance.
void bvh_triangle(BvhRay ray, uint entered, uint triangle, float t_min, bool selects, uint skip_instance, inout Hit hit) {
    TriangleHit h = triangle_hit(ray.sheared, triangle);
    if (min(h.edges.x, min(h.edges.y, h.edges.z)) < 0.0 && max(h.edges.x, max(h.edges.y, h.edges.z)) > 0.0) return;
    if (!(h.sum != 0.0 && h.t > t_min && h.t < hit.t)) return;
    if (selects && bvh_passes(entered, triangle, skip_instance)) return;
    hit = Hit(h.t, entered, triangle, h.u, h.v);
#ifdef COUNT
    bvh_triangle_hits += 1u;
#endif
}

#ifdef COUNT
// True if a ray in object space meets the bounds of the shown shape of an instance before t_max.
bool bvh_bounds_met(uint instance, BvhRay ray, float t_min, float t_max) {
    if (instances[instance].owners != 0u) return true;   // rows have no bounds of shared structures
    vec3 a = (instances[instance].low.xyz - ray.origin) * ray.inverse;
    vec3 b = (instances[instance].high.xyz - ray.origin) * ray.inverse;
    vec3 enter = min(a, b), leave = max(a, b);
    return max(max(enter.x, enter.y), max(enter.z, t_min)) <= min(min(leave.x, leave.y), min(leave.z, t_max));
}
#endif

// The first surface with t_min < t < t_max along origin + t direction, world space; direction need
// not be a unit vector. All of `skip_instance` is transparent; NONE: nothing is.
// Miss: instance NONE, t = t_max. An invalid ray (not finite, no direction, t_min < 0) misses.
// Starkov et al. 2019, II-B: an instance is met by the inverse transform of the ray (figure 9); that of a selector has the union of its
// children's boxes, and its row names the root of the one that is shown (figure 8).
Hit closest_hit(vec3 origin, vec3 direction, float t_min, float t_max, uint skip_instance) {
    Hit hit = Hit(t_max, NONE, NONE, 0.0, 0.0);
    uint root = nodes[0].x;
    float size = max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
    bool finite = all(lessThan(abs(origin), vec3(1e18))) && all(lessThan(abs(direction), vec3(1e18)));
    if (root == NONE || !finite || !(size > 1e-18) || !(t_min >= 0.0) || !(t_max >= t_min)) return hit;

    bool selects = skip_instance != NONE || nodes[0].z != 0u || (RAY_SELECTS);
    uvec2 stack[BVH_STACK];
    uint depth = 0u;
    uint instance = NONE;     // whose triangles are walked; NONE: the top level
    uint base = 0u;           // depth of the stack below which the top level lies
    BvhRay ray = bvh_ray(origin, direction);
    uvec2 inner = uvec2(root, 0x80000000u);   // first child; children yet to visit and their mask
    uvec2 primitives = uvec2(0u);             // first; those yet to test
    while (true) {
        if (inner.y > 0x00ffffffu) {
            uint bit = uint(findMSB(inner.y));
            uint mask = inner.y & 0xffu;
            inner.y &= ~(1u << bit);
            if (inner.y > 0x00ffffffu && depth < BVH_STACK) {
                stack[depth] = inner;
                depth += 1u;
            }
            uint slot = (bit - 24u) ^ (ray.octant & 0xffu);
            uint n = 5u * (inner.x + uint(bitCount(mask & ~(0xffffffffu << slot))));
#ifdef COUNT
            bvh_node_visits += 1u;
            if (instance == NONE) bvh_top_visits += 1u;
#endif
            uvec4 header = nodes[n];
            uvec4 links = nodes[n + 1u];
            uvec4 x = nodes[n + 2u];
            uvec4 y = nodes[n + 3u];
            uvec4 z = nodes[n + 4u];
            vec3 quantum = uintBitsToFloat((uvec3(header.w, header.w >> 8u, header.w >> 16u) & 0xffu) << 23u);
            vec3 scale = quantum * ray.inverse;
            vec3 corner = (uintBitsToFloat(header.xyz) - ray.origin) * ray.inverse;
            // Ten ulps of what is added below, and half a thousandth of a quantum: more than the
            // rounding here, in the sheared vertices and in the builder's quantisation. A ray along
            // an axis within a face thus meets its box.
            vec3 margin = (abs(corner) + 512.0 * abs(scale)) * 1e-6;
            vec3 near = corner - margin;
            vec3 far = corner + margin;
            uint hits = bvh_children(ray, links.z, uvec3(x.x, y.x, z.x), uvec3(x.z, y.z, z.z), scale, near, far, t_min, hit.t)
                | bvh_children(ray, links.w, uvec3(x.y, y.y, z.y), uvec3(x.w, y.w, z.w), scale, near, far, t_min, hit.t);
            inner = uvec2(links.x, (hits & 0xff000000u) | (header.w >> 24u));
            primitives = uvec2(links.y, hits & 0x00ffffffu);
        } else {
            primitives = inner;
            inner = uvec2(0u);
        }
        while (primitives.y != 0u) {
            uint bit = uint(findLSB(primitives.y));
            primitives.y &= primitives.y - 1u;
            uint primitive = primitives.x + bit;
            if (instance != NONE) {
#ifdef COUNT
                bvh_triangle_tests += 1u;
#endif
                bvh_triangle(ray, instance, primitive, t_min, selects, skip_instance, hit);
                continue;
            }
            uint entered = nodes[5u * nodes[0].y + primitive / 4u][primitive % 4u];
            bool passed_by = entered == skip_instance || instances[entered].slot != primitive || RAY_SKIPS(entered);
            if (passed_by && instances[entered].owners == 0u) continue;
            // The rest of the top level waits on the stack below `base`.
            if (primitives.y != 0u && depth < BVH_STACK) {
                stack[depth] = primitives;
                depth += 1u;
            }
            if (inner.y > 0x00ffffffu && depth < BVH_STACK) {
                stack[depth] = inner;
                depth += 1u;
            }
            instance = entered;
            base = depth;
            ray = bvh_ray(object_point(instance, origin), object_direction(instance, direction));
            inner = uvec2(instances[instance].bvh_root, 0x80000000u);
            primitives = uvec2(0u);
#ifdef COUNT
            bvh_instances_reached += 1u;
            if (!bvh_bounds_met(instance, ray, t_min, hit.t)) {
                bvh_false_unions += 1u;
                bvh_false_boxes -= 1u;   // F1, not F2: cancels the count made when the mesh is left
            }
            bvh_triangle_hits = 0u;
#endif
        }
        if (inner.y <= 0x00ffffffu) {
            if (depth == base && instance != NONE) {
#ifdef COUNT
                if (bvh_triangle_hits == 0u) bvh_false_boxes += 1u;
#endif
                instance = NONE;
                base = 0u;
                ray = bvh_ray(origin, direction);
            }
            if (depth == 0u) break;
            depth -= 1u;
            inner = stack[depth];
        }
    }
    if (hit.instance != NONE) hit.instance = triangle_owner(hit.instance, hit.primitive);
    return hit;
}
