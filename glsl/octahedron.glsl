// Unit vectors as words: two signed 16-bit parts of a projection onto an octahedron (Meyer et al. 2010), x in the lower
// half. src/scene/smoothed.rs packs them.

vec3 unpack_direction(uint word) {
    vec2 e = unpackSnorm2x16(word);
    float z = 1.0 - abs(e.x) - abs(e.y);
    float fold = max(-z, 0.0);
    return normalize(vec3(e.x - mix(-fold, fold, e.x >= 0.0), e.y - mix(-fold, fold, e.y >= 0.0), z));
}

// The zero vector becomes an arbitrary unit vector.
uint pack_direction(vec3 v) {
    vec3 p = v / max(abs(v.x) + abs(v.y) + abs(v.z), 1e-30);
    vec2 folded = mix(vec2(-1.0), vec2(1.0), greaterThanEqual(p.xy, vec2(0.0))) * (1.0 - abs(p.yx));
    return packSnorm2x16(mix(p.xy, folded, bvec2(p.z < 0.0)));
}
