// Reflectance of an interface averaged over the width of the beam.
//
// A ray stands for a beam. Where a surface curves by `kappa` (1/mm, along the plane of incidence), a
// ray xi mm beside it meets the surface at sin i' = sin i + kappa xi (exact for a cylinder), and
// beyond 1 it misses. If xi is normal with standard deviation sigma, sin i' is normal with kappa sigma.
// Without this average the edge of a vessel, where a hundredth of the beam is totally reflected, would
// reflect all of it.
#include "angles.glsl"

// Standard normal distribution function at x: Abramowitz and Stegun 7.1.26, within 1e-7.
float normal_mass(float x) {
    float z = abs(x) * 0.70710678;
    float t = 1.0 / (1.0 + 0.3275911 * z);
    float tail = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    tail *= 0.5 * exp(-z * z);
    return mix(1.0 - tail, tail, x < 0.0);
}

// Mean intensity reflectance; `width` is kappa sigma.
float footprint_reflectance(float z1, float c1, float z2, float c2, float cos_i, float width) {
    float r = reflection(z1, c1, z2, c2, cos_i);
    if (!(width > 1e-4)) return r * r;
    float centre = sqrt(max(1.0 - cos_i * cos_i, 0.0));
    float critical = min(c1 / c2, 1.0);
    float beyond = normal_mass((1.0 - centre) / width) - normal_mass((critical - centre) / width)
        + normal_mass((-critical - centre) / width) - normal_mass((-1.0 - centre) / width);
    // Below the critical angle, with s = critical sin(phi), which makes the steep integrand at the edge smooth.
    float from = arcsine(clamp((centre - 4.0 * width) / critical, -1.0, 1.0)) * TURNS;
    float to = arcsine(clamp((centre + 4.0 * width) / critical, -1.0, 1.0)) * TURNS;
    float sum = 0.0;
    float norm = 0.0;
    // Gauss-Legendre, 8 points.
    const vec4 NODES = vec4(0.1834346425, 0.5255324099, 0.7966664774, 0.9602898565);
    const vec4 WEIGHTS = vec4(0.3626837834, 0.3137066459, 0.2223810345, 0.1012285363);
    for (uint i = 0u; i < 8u; ++i) {
        float node = mix(-NODES[i >> 1u], NODES[i >> 1u], (i & 1u) == 0u);
        vec2 phi = phasor(0.5 * (from + to) + 0.5 * (to - from) * node);
        float s = critical * phi.y;
        float off = (s - centre) / width;
        float mass = WEIGHTS[i >> 1u] * phi.x * exp(-0.5 * off * off);
        float r_s = reflection(z1, c1, z2, c2, sqrt(max(1.0 - s * s, 0.0)));
        sum += mass * r_s * r_s;
        norm += mass;
    }
    float within = normal_mass((critical - centre) / width) - normal_mass((-critical - centre) / width);
    return clamp(beyond + mix(0.0, max(within, 0.0) * sum / norm, norm > 0.0), 0.0, 1.0);
}
