// Counter-based random numbers: pcg4d (Jarzynski and Olano, JCGT 9(3), 2020).
#include "angles.glsl"

uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

uvec3 pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return v;
}

// [0, 1) with 24 bits.
float unit(uint bits) { return float(bits >> 8u) * (1.0 / 16777216.0); }

// Natural logarithm of a number in (2^-25, 1), relative error 3e-7. A device's own may be 2^-21 off and
// positive, although the logarithm of a number close to 1 is smaller than that.
float logarithm(float u) {
    // u = m 2^e, m within sqrt(2) of 1.
    int e = (floatBitsToInt(u) - 0x3f3504f3) >> 23;
    precise float m = intBitsToFloat(floatBitsToInt(u) - (e << 23));
    precise float s = (m - 1.0) / (m + 1.0);
    precise float w = s * s;
    precise float log_m = s * (2.0 + w * (0.6666666667 + w * (0.4 + w * 0.2947)));
    return log_m + float(e) * 0.6931471806;
}

// Standard normal from one word: Box-Muller on two 16-bit uniforms, the first in (0, 1).
float gaussian(uint bits) {
    float u = (float(bits >> 16u) + 0.5) * (1.0 / 65536.0);
    return sqrt(-2.0 * logarithm(u)) * phasor(float(bits & 0xffffu) * (1.0 / 65536.0)).x;
}

// Keys of the path's decisions. Keyed by (path n, bounce) and never by scanline or layer, so that
// neighbouring lines share their sampled normals and differ only by geometry.
const uint PURPOSE_NORMAL = 0u;     // + attempt 0..7
const uint PURPOSE_THICKNESS = 16u;
const uint PURPOSE_CHOICE = 17u;
const uint PURPOSE_JITTER = 18u;
const uint PURPOSE_PHASE = 19u;

uvec4 path_random(uint path, uint bounce, uint purpose, uint seed) {
    return pcg4d(uvec4(path, bounce, purpose, seed));
}

// Each bit flipped by a hash of the lower ones (Laine and Karras 2011, constants of Burley 2020).
uint laine_karras(uint x, uint seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

// Owen scrambling: each bit flipped by a hash of the higher ones.
uint owen(uint x, uint seed) {
    return bitfieldReverse(laine_karras(bitfieldReverse(x), seed));
}

// Instead of the first two words of path_random: over the paths they are the first two dimensions of a Sobol sequence, Owen
// scrambled, its order shuffled so that the decisions of one path are independent (Burley,
// JCGT 9(4), 2020): the first 2^k paths cover the unit square evenly.
uvec2 path_sobol(uint path, uint bounce, uint purpose, uint seed) {
    uvec4 key = pcg4d(uvec4(0x9e3779b9u, bounce, purpose, seed));
    uint index = owen(path, key.x);
    // Bits of the two dimensions, lowest first: those of the index, and their sums by Pascal's triangle modulo 2,
    // which is a product of five sparse matrices.
    uint second = index;
    second ^= second >> 16u;
    second ^= second >> 8u & 0x00ff00ffu;
    second ^= second >> 4u & 0x0f0f0f0fu;
    second ^= second >> 2u & 0x33333333u;
    second ^= second >> 1u & 0x55555555u;
    return uvec2(bitfieldReverse(laine_karras(index, key.y)), bitfieldReverse(laine_karras(second, key.z)));
}

// The random words of a path, from the sequence that the frame uses.
uvec4 path_draw(uint path, uint bounce, uint purpose, uint seed, bool sobol) {
    uvec4 bits = path_random(path, bounce, purpose, seed);
    if (sobol) bits.xy = path_sobol(path, bounce, purpose, seed);
    return bits;
}
