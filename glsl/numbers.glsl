#ifndef NUMBERS_GLSL
#define NUMBERS_GLSL
// NaN test by bits: a compiler that assumes finite numbers may remove isnan().
bool not_a_number(float x) { return (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u; }

// A float that is a whole number below 2^22 in magnitude, as an integer. Software drivers convert one
// thread's number after the other, but add for all threads at once.
int whole(float x) { return floatBitsToInt(x + 12582912.0) - 0x4b400000; }

// The same for a magnitude below 2^31, in two small halves.
int whole_large(float x) {
    float high = floor(x * (1.0 / 65536.0));
    return (whole(high) << 16) + whole(x - 65536.0 * high);
}

// Grey level of a value from 0 to 1, of 256; 0 for NaN.
uint grey_level(float v) { return not_a_number(v) ? 0u : uint(whole(clamp(floor(v * 255.0 + 0.5), 0.0, 255.0))); }
#endif
