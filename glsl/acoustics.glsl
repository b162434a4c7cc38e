// Interfaces between fluids: refraction by sound speeds, pressure reflection, rough normals.
#include "angles.glsl"

// Signed pressure reflection coefficient at incidence cos_i from medium 1 into 2 (fluid-fluid).
// Total reflection gives +1; the true phase of the evanescent case is not modelled.
float reflection(float z1, float c1, float z2, float c2, float cos_i) {
    float k = c2 / c1;
    float sin2_t = k * k * (1.0 - cos_i * cos_i);
    if (sin2_t >= 1.0) return 1.0;
    float cos_t = sqrt(1.0 - sin2_t);
    float a = z2 * cos_i;
    float b = z1 * cos_t;
    return (a - b) / (a + b);
}

// Snell's law by sound speeds: sin(t) / c2 = sin(i) / c1. False at total reflection.
// Starkov et al. 2019, II-A: the law by which a ray of figure 5 goes on.
bool refraction(vec3 d, vec3 n, float c1, float c2, out vec3 transmitted) {
    float k = c2 / c1;
    float cos_i = -dot(d, n);
    float sin2_t = k * k * (1.0 - cos_i * cos_i);
    transmitted = d;
    if (sin2_t >= 1.0) return false;
    transmitted = normalize(k * d + (k * cos_i - sqrt(1.0 - sin2_t)) * n);
    return true;
}

// Orthonormal frame about n (Duff et al., JCGT 6(1), 2017).
void basis(vec3 n, out vec3 tangent, out vec3 bitangent) {
    float s = mix(-1.0, 1.0, n.z >= 0.0);
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    bitangent = vec3(b, s + n.y * n.y * a, -n.y);
}

// Exponents above this are a mirror: the rms tilt is below 5e-5 rad.
const float SPECULAR = 1e9;

// Direction about n with pdf (s+1)/(2 pi) cos^s, from two uniforms.
vec3 power_cosine(vec3 n, float exponent, vec2 u) {
    vec3 tangent, bitangent;
    basis(n, tangent, bitangent);
    // cos t = u^(1/(s+1)); sin^2 = 1 - exp(-x), by series where 1 - cos^2 would cancel.
    float x = -2.0 * logarithm(max(u.x, 1.0 / 16777216.0)) / (exponent + 1.0);
    float sin2 = mix(1.0 - exp(-x), x * (1.0 - x * (0.5 - x / 6.0)), x < 0.01);
    float cos_t = sqrt(1.0 - sin2);
    vec2 across = sqrt(sin2) * phasor(u.y);
    return normalize(across.x * tangent + across.y * bitangent + cos_t * n);
}

// True if what comes along d meets the mirror of normal m from the front, and leaves on the near side of the geometric normal.
bool is_mirror(vec3 d, vec3 m, vec3 n_geometric) {
    float along = dot(d, m);
    return along < 0.0 && dot(d - 2.0 * along * m, n_geometric) > 0.0;
}

// Micro-normal about n whose reflection leaves on the near side of the geometric normal: pdf
// (s+1)/(2 pi) cos^s. False when eight attempts fail.
// Starkov et al. 2019, II-A: the surface normal that is drawn at every intersection.
bool rough_normal(vec3 d, vec3 n, vec3 n_geometric, float roughness, uint path, uint key, uint seed, bool sobol, out vec3 m) {
    if (roughness >= SPECULAR) {
        m = n;
        return is_mirror(d, m, n_geometric);
    }
    for (uint attempt = 0u; attempt < 8u; ++attempt) {
        uvec4 bits = path_draw(path, key, PURPOSE_NORMAL + attempt, seed, sobol);
        m = power_cosine(n, roughness, vec2(unit(bits.x), unit(bits.y)));
        if (is_mirror(d, m, n_geometric)) return true;
    }
    m = n;
    return false;
}
