// Complex baseband deposit: an echo at one-way time T carries the phase of the two-way carrier there.
#include "angles.glsl"
#include "numbers.glsl"

vec2 carrier(float time) { return phasor(-2.0 * frame.frequency * time); }

// Shares of four samples in an echo that lies `f` behind the second of them, 0 to 1, by the cubic through
// them. They keep the echo's centre, its width and its symmetry.
vec4 deposit_shares(float f) {
    float behind = 1.0 - f, ahead = 2.0 - f;
    return vec4(-f * behind * ahead, 3.0 * (1.0 + f) * behind * ahead, 3.0 * (1.0 + f) * f * ahead, -(1.0 + f) * f * behind) * (1.0 / 6.0);
}

// `dither` in [0, 1): 0.5 rounds to the nearest; uniform random numbers keep the mean of values below one unit.
int to_fixed(float value, float scale, float dither) {
    float v = value * scale;
    if (!(abs(v) < ECHO_LIMIT)) {
        atomicAdd(counters.saturated, 1u);
        v = v > 0.0 ? ECHO_LIMIT : (v < 0.0 ? -ECHO_LIMIT : 0.0);
    }
    return whole_large(floor(v + dither));
}
