// Low-frequency tissue texture: two octaves of value noise with unit variance.

// A random word from three: they are folded into one, which is then mixed (C. Wellons' lowbias32).
uint texture_hash(uint folded) {
    folded ^= folded >> 16u;
    folded *= 0x7feb352du;
    folded ^= folded >> 15u;
    folded *= 0x846ca68bu;
    return folded ^ folded >> 16u;
}

float value_noise(vec3 p, uint seed) {
    vec3 base = floor(p);
    vec3 f = p - base;
    vec3 w = f * f * (3.0 - 2.0 * f);
    const uvec3 FOLD = uvec3(0x8da6b343u, 0xd8163841u, 0xcb1ab31fu);
    uvec3 near = uvec3(ivec3(base)) * FOLD + uvec3(seed, 0u, 0u);
    uvec3 far = near + FOLD;
    uvec4 plane = uvec4(near.x ^ near.y, far.x ^ near.y, near.x ^ far.y, far.x ^ far.y);
    vec4 sum = vec4(0.0);
    for (uint i = 0u; i < 4u; ++i) {
        vec2 ends = vec2(unit(texture_hash(plane[i] ^ near.z)), unit(texture_hash(plane[i] ^ far.z)));
        sum[i] = mix(ends.x, ends.y, w.z);
    }
    vec2 row = mix(sum.xz, sum.yw, w.x);
    return 2.0 * mix(row.x, row.y, w.y) - 1.0;
}

// Variance of one octave: (26/35)^3 of smoothstep weights, 1/3 of the values; 5/4 for both octaves.
// Starkov et al. 2019, III-A: scatterer texture of high and of low frequency.
float tissue_texture(vec3 p, uint seed) {
    return (value_noise(p, seed) + 0.5 * value_noise(2.0 * p + 17.0, seed)) / 0.41329;
}
