// Low-frequency tissue texture: two octaves of value noise with unit variance.

float texture_value(ivec3 cell, uint seed) {
    return 2.0 * unit(pcg4d(uvec4(uvec3(cell), seed ^ 0x9e3779b9u)).x) - 1.0;
}

float value_noise(vec3 p, uint seed) {
    vec3 base = floor(p);
    vec3 f = p - base;
    vec3 w = f * f * (3.0 - 2.0 * f);
    ivec3 c = ivec3(base);
    float sum = 0.0;
    for (int i = 0; i < 8; ++i) {
        ivec3 corner = ivec3(i & 1, (i >> 1) & 1, i >> 2);
        vec3 side = mix(1.0 - w, w, vec3(corner));
        sum += side.x * side.y * side.z * texture_value(c + corner, seed);
    }
    return sum;
}

// Variance of one octave: (26/35)^3 of smoothstep weights, 1/3 of the values; 5/4 for both octaves.
float tissue_texture(vec3 p, uint seed) {
    return (value_noise(p, seed) + 0.5 * value_noise(2.0 * p + 17.0, seed)) / 0.41329;
}
