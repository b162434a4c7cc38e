// Averaged normals as words: a unit vector's projection onto an octahedron (Meyer et al. 2010), two signed parts of 13
// bits, x in the lower; above them its coherence, 0 to 1, in 6 bits. src/scene/smoothed.rs packs them.

// Unit vector, coherence.
vec4 unpack_mean(uint word) {
    ivec2 parts = ivec2(bitfieldExtract(int(word), 0, 13), bitfieldExtract(int(word), 13, 13));
    vec2 e = max(vec2(parts) / 4095.0, vec2(-1.0));
    float z = 1.0 - abs(e.x) - abs(e.y);
    float fold = max(-z, 0.0);
    vec3 v = vec3(e.x - mix(-fold, fold, e.x >= 0.0), e.y - mix(-fold, fold, e.y >= 0.0), z);
    return vec4(normalize(v), float(word >> 26u) / 63.0);
}

// The zero vector becomes an arbitrary unit vector.
uint pack_mean(vec4 mean) {
    vec3 p = mean.xyz / max(abs(mean.x) + abs(mean.y) + abs(mean.z), 1e-30);
    vec2 folded = mix(vec2(-1.0), vec2(1.0), greaterThanEqual(p.xy, vec2(0.0))) * (1.0 - abs(p.yx));
    ivec2 parts = ivec2(round(mix(p.xy, folded, bvec2(p.z < 0.0)) * 4095.0)) & 0x1fff;
    uint coherence = uint(round(clamp(mean.w, 0.0, 1.0) * 63.0));
    return uint(parts.x) | uint(parts.y) << 13u | coherence << 26u;
}
