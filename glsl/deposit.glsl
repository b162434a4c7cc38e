// Complex baseband deposit: an echo at one-way time T lands between two axial samples with the
// phase of the two-way carrier, so that position is kept to a fraction of a sample.
#include "angles.glsl"

const float FIXED_LIMIT = 1073741824.0; // 2^30

vec2 carrier(float time) { return phasor(-2.0 * frame.frequency * time); }

// `dither` in [0, 1): 0.5 rounds to the nearest; uniform ones keep the mean of what is less than a unit.
int to_fixed(float value, float scale, float dither) {
    float v = value * scale;
    if (!(abs(v) < FIXED_LIMIT)) {
        atomicAdd(counters.saturated, 1u);
        v = v > 0.0 ? FIXED_LIMIT : (v < 0.0 ? -FIXED_LIMIT : 0.0);
    }
    return int(floor(v + dither));
}
