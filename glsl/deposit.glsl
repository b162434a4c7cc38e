// Complex baseband deposit: an echo at one-way time T carries the phase of the two-way carrier there.
#include "angles.glsl"

const float FIXED_LIMIT = 1073741824.0; // 2^30

vec2 carrier(float time) { return phasor(-2.0 * frame.frequency * time); }

// What the three samples about the nearest one get of an echo that lies `f` samples, -1/2 to 1/2, behind
// it: the parabola through them, whose centre is the echo's and whose spread is zero.
vec3 deposit_shares(float f) {
    float square = f * f;
    return vec3(0.5 * (square - f), 1.0 - square, 0.5 * (square + f));
}

// `dither` in [0, 1): 0.5 rounds to the nearest; uniform ones keep the mean of what is less than a unit.
int to_fixed(float value, float scale, float dither) {
    float v = value * scale;
    if (!(abs(v) < FIXED_LIMIT)) {
        atomicAdd(counters.saturated, 1u);
        v = v > 0.0 ? FIXED_LIMIT : (v < 0.0 ? -FIXED_LIMIT : 0.0);
    }
    return int(floor(v + dither));
}
