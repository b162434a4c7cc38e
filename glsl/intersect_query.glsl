// Closest hit by the device's ray query. Same interface as intersect_bvh.glsl.
//
// The includer enables GL_EXT_ray_query, includes triangle.glsl, and declares `tlas`, whose
// instances carry our instance as custom index (one of those that share a structure) and whose meshes
// hold the triangles in the same order as triangles[]. It defines RAY_MASK, the mask bits of the entries that are shown, and RAY_SLOTS,
// true if entries that are not shown share them; an instance's row then names the one that is shown. It may
// define RAY_SKIPS(i), true if instance i is transparent, and RAY_SELECTS, true if any may be.

#ifndef RAY_SKIPS
#define RAY_SKIPS(i) false
#define RAY_SELECTS false
#endif

// The instance to which the triangle at `index` of a structure belongs.
uint query_owner(uint entered, uint index) {
    return triangle_owner(entered, instances[entered].first_triangle + index);
}

// The first surface with t_min < t < t_max along origin + t direction, world space; direction need
// not be a unit vector. All of `skip_instance` is transparent; NONE: nothing is.
// Miss: instance NONE, t = t_max. An invalid ray (not finite, no direction, t_min < 0) misses.
Hit closest_hit(vec3 origin, vec3 direction, float t_min, float t_max, uint skip_instance) {
    Hit hit = Hit(t_max, NONE, NONE, 0.0, 0.0);
    float size = max(max(abs(direction.x), abs(direction.y)), abs(direction.z));
    bool finite = all(lessThan(abs(origin), vec3(1e18))) && all(lessThan(abs(direction), vec3(1e18)));
    // The specification leaves such input undefined.
    if (!finite || !(size > 1e-18) || !(t_min >= 0.0) || !(t_max >= t_min)) return hit;

    rayQueryEXT query;
    bool all_pass = skip_instance == NONE && !RAY_SLOTS && !(RAY_SELECTS);
    uint opacity = all_pass ? gl_RayFlagsOpaqueEXT : gl_RayFlagsNoOpaqueEXT;
    rayQueryInitializeEXT(query, tlas, opacity, RAY_MASK, origin, t_min, direction, t_max);
    while (rayQueryProceedEXT(query)) {
        if (rayQueryGetIntersectionTypeEXT(query, false) != gl_RayQueryCandidateIntersectionTriangleEXT) continue;
        uint instance = query_owner(uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false)),
            uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false)));
        uint slot = uint(rayQueryGetIntersectionInstanceIdEXT(query, false));
        if (RAY_SKIPS(instance)) continue;
        if (instance != skip_instance && instances[instance].slot == slot) rayQueryConfirmIntersectionEXT(query);
    }
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionTriangleEXT) {
        vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
        hit.t = rayQueryGetIntersectionTEXT(query, true);
        uint entered = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
        uint index = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
        hit.instance = query_owner(entered, index);
        hit.primitive = instances[entered].first_triangle + index;
        hit.u = uv.x;
        hit.v = uv.y;
        // The device only chooses the triangle; the hit is computed here, so that both tracers agree exactly.
        ShearedRay ray = sheared_ray(object_point(hit.instance, origin), object_direction(hit.instance, direction));
        TriangleHit h = triangle_hit(ray, hit.primitive);
        if (h.sum != 0.0 && h.t > t_min && h.t < t_max) {
            hit.t = h.t;
            hit.u = h.u;
            hit.v = h.v;
        }
    }
    return hit;
}
