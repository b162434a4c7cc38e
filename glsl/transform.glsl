// 3x4 transforms stored as rows: rotation row, translation.

vec3 apply_point(vec4 rows3[3], vec3 p) {
    return vec3(dot(rows3[0].xyz, p) + rows3[0].w, dot(rows3[1].xyz, p) + rows3[1].w, dot(rows3[2].xyz, p) + rows3[2].w);
}

vec3 apply_vector(vec4 rows3[3], vec3 v) {
    return vec3(dot(rows3[0].xyz, v), dot(rows3[1].xyz, v), dot(rows3[2].xyz, v));
}

vec3 world_point(vec3 p) { return apply_point(frame.world_from_probe, p); }
vec3 world_vector(vec3 v) { return apply_vector(frame.world_from_probe, v); }
vec3 probe_point(vec3 p) { return apply_point(frame.probe_from_world, p); }
vec3 probe_vector(vec3 v) { return apply_vector(frame.probe_from_world, v); }

// World to the space in which an instance's scatterers rest; NONE is the background.
vec3 texture_point(uint instance, vec3 p) {
    if (instance == NONE || (frame.flags & FLAG_WORLD_TEXTURE) != 0u) return p;
    return apply_point(instances[instance].texture_from_world, p);
}

vec3 texture_vector(uint instance, vec3 v) {
    if (instance == NONE || (frame.flags & FLAG_WORLD_TEXTURE) != 0u) return v;
    return apply_vector(instances[instance].texture_from_world, v);
}
