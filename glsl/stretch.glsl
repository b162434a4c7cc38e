// A segment of a path as scatter.comp and expect.comp hear it: where its samples lie, how wide and how loud the beam is along it.
//
// The includer declares frame, tissues[], rows[], segments[] and apertures[], and includes transform.glsl and probe.glsl.

#include "aperture.glsl"

const float LOG2_E = 1.44269504;
const float INVERSE_FALL = 1.38629436;    // 2 ln 2: times `shape.y` it is 1 / sigma^2 in elevation
const float SLOT_MARGIN = 0.5 / float(SCATTER_SLOT);

// A segment in the frame of its scatterers.
struct Stretch {
    vec3 o; vec3 d; vec3 e_l; vec3 e_e;
    float extent; float time; float weight;
    vec3 spread; float share;
    vec3 lens;
    vec2 strip;          // distance to the neighbouring scanline's path, mm, and its growth per mm
    vec2 pitch;          // distance to the neighbouring scanline, likewise
    bool reflected;      // on its way to its start
    float speed; float absorption;
    vec2 off;            // distance from the geometric scanline, mm: at the start and per mm
    float layer_y;       // elevation of the line's layer, mm
    uint line; float lost;   // nepers lost up to its start
    uint tissue; uint instance;
};

Stretch world_stretch(uint at) {
    Stretch s;
    vec4 a = segments[at].origin_length;
    vec4 b = segments[at].direction_time;
    vec4 c = segments[at].lateral_weight;
    vec4 w = segments[at].spread;
    s.o = a.xyz;
    s.extent = a.w;
    s.d = b.xyz;
    s.time = b.w;
    s.e_l = c.xyz;
    s.weight = c.w;
    float strip = segments[at].strip;
    s.e_e = cross(s.d, s.e_l) * (strip < 0.0 ? -1.0 : 1.0);
    s.spread = w.xyz;
    s.share = w.w;
    s.lens = segments[at].lens.xyz;
    s.strip = vec2(abs(strip), segments[at].lens.w);
    s.tissue = segments[at].tissue;
    s.instance = segments[at].instance;
    s.speed = tissues[s.tissue].speed;
    s.absorption = tissues[s.tissue].absorption;
    s.reflected = (segments[at].line & REFLECTED) != 0u;
    uint line = segments[at].line & ~REFLECTED;
    s.line = line;
    s.lost = lost_of(s.weight);
    s.layer_y = elevation(line / frame.scanlines);
    s.off = vec2(0.0);
    vec2 pitch = line_pitch();
    s.pitch = vec2(pitch.x + pitch.y * frame.speed * s.time, pitch.y * frame.speed / s.speed);
    if (frame.beam_width > 0.0) {
        vec3 o, d, lateral;
        probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
        s.off = vec2(dot(probe_point(s.o) - o, lateral), dot(probe_vector(s.d), lateral));
    }
    return s;
}

float samples_per_mm(Stretch s) { return frame.speed / (s.speed * frame.sample_pitch); }
float kappa_at(Stretch s, float x) { return frame.speed * s.time / frame.sample_pitch + x * samples_per_mm(s); }
float distance_at(Stretch s, float kappa) {
    return (kappa * frame.sample_pitch / frame.speed - s.time) * s.speed;
}

uint row_at(float kappa) { return sample_at(kappa); }

// A stretch with NaN or infinity has no echoes. NaN fails every comparison.
bool is_finite(Stretch s) {
    return abs(s.extent) < 1e18 && abs(s.time) < 1e18 && abs(s.weight) < 1e18 && abs(s.share) < 1e18
        && all(lessThan(abs(s.o), vec3(1e18))) && all(lessThan(abs(s.d), vec3(2.0)))
        && all(lessThan(abs(s.e_l), vec3(2.0))) && all(lessThan(abs(s.spread), vec3(1e18)))
        && all(lessThan(abs(s.lens), vec3(1e18))) && all(lessThan(abs(s.strip), vec2(1e18)));
}

bool sounds(Stretch s) { return tissues[s.tissue].presence > 0.0 && s.weight > 0.0 && is_finite(s); }

// The factor on amplitudes: echoes that a rough reflection spreads over many resolution cells average out; a path off the
// geometric scanline is received more weakly; on the main path losses count by the aperture. `row` is that of the distance.
float thinning(Stretch s, float x, uint row) {
    float variance = s.spread.x + x * (2.0 * s.spread.y + x * s.spread.z);
    float beam = beam_weight(s.off.x + x * s.off.y);
    if (loses_by_aperture() && !s.reflected) {
        float lost = s.lost + s.absorption * x;
        float nepers = aperture_nepers(s.line, s.time + x / s.speed, lost);
        beam *= mix(exp(nepers), 0.0, nepers - lost < log(frame.min_weight));
    }
    if (variance <= 0.0) return beam;
    vec2 sigmas = vec2(rows[row].sigma_lateral, rows[row].sigma_elevation);
    vec2 widened = 1.0 + variance / (sigmas * sigmas);
    float cells = sqrt(widened.x * widened.y);
    return beam * min(1.0, sqrt(s.share / cells));
}

// Offset, at distances x, of what comes one deviation beside the beam's axis, mm.
vec3 offset_at(Stretch s, vec3 x) { return s.lens.x + x * (s.lens.y + x * s.lens.z); }

// Variance across over that of an even wavefront, whose 1 / sigma^2 is `fall`: transmitted and received beam each are
// wider by the offset, the product of both by half its square.
float widened(float off, float fall) { return 1.0 + min(0.5 * off * off * fall, MOST_WIDENED); }

// 1 / sigma^2 across over that of an even wavefront at distance x, whose standard deviation is that of the row.
float narrowing(Stretch s, float x, uint row) {
    float sigma = rows[row].sigma_lateral;
    return 1.0 / widened(offset_at(s, vec3(x)).x, 1.0 / (sigma * sigma));
}

// Distance of the neighbouring scanlines' paths at distance x over that of the scanlines, with its limits.
float strip_ratio(Stretch s, float x) {
    float nominal = max(s.pitch.x + x * s.pitch.y, LEAST_PITCH);
    return clamp(abs(s.strip.x + x * s.strip.y) / nominal, 1.0 / STRIP_LIMIT, STRIP_LIMIT);
}

// The factor on the power of speckle at distance x: where two beams whose intensities are Gaussians meet it is 1 over the root of
// the sum of their variances. A surface that bends the wavefront makes them wider, or narrower: the received beam, which
// converges on x, misses it by the offset; the transmitted one, narrower or wider than that where it passed the surface, is as
// much closer to its focus or farther from it. Never brighter: a lens that would mend the focus is too small to have all of the beam.
float spoiled(Stretch s, float x, uint row) {
    float off = offset_at(s, vec3(x)).x, turn = s.lens.y + 2.0 * x * s.lens.z;
    float defocus = rows[row].defocus;
    float moved = (0.5 * turn * defocus + off * rows[row].transmit_sine) / rows[row].aperture;
    float more = off * off + moved * (moved + 2.0 * defocus);
    return inversesqrt(1.0 + clamp(more / rows[row].variances, 0.0, MOST_WIDENED));
}

// The same on the amplitude of a scatterer; on the main path surfaces bend by the aperture.
float scattered(Stretch s, float x, uint row) {
    if (loses_by_aperture() && !s.reflected) return exp(aperture_level(s.line, s.time + x / s.speed));
    if (all(equal(s.lens, vec3(0.0)))) return 1.0;
    return sqrt(spoiled(s, x, row));
}

// How a scanline hears scatterers over its strip: x at the strip's edge, by y more in its middle, up to all of it, and by z log2
// less over its width as the square of the distance. `core` is the share that is heard whole; below 0 the strip is a Gaussian,
// that of a beam narrower than what lines could share.
vec3 strip_profile(float core) {
    return core < 0.0 ? vec3(1.0, 0.0, 0.5 * LOG2_E * STRIP_CUT * STRIP_CUT) : vec3(0.0, 1.0 / (1.0 - core), 0.0);
}

// The part of a scatterer's amplitude that a scanline hears `across` mm beside its path, in a strip `wide` to either side where
// neighbouring paths are as far apart as scanlines: those of all scanlines add up to the same number everywhere. Where they
// leave a strip `ratio` times as wide it has more scatterers, and hears each more weakly.
float strip_share(float across, float wide, float core, float ratio) {
    float off = abs(across) / (wide * ratio);
    vec3 profile = strip_profile(core);
    if (!(off < 1.0)) return 0.0;
    return min(profile.x + (1.0 - off) * profile.y, 1.0) * exp2(-profile.z * off * off) * inversesqrt(ratio);
}

// Level of its speckle at distance x: one-way weight times echogenicity, log2.
float level_at(Stretch s, float x) {
    uint row = row_at(kappa_at(s, x));
    float weight = s.weight * thinning(s, x, row);
    return log2(weight) - s.absorption * LOG2_E * x + tissues[s.tissue].level;
}

// First and last bin that a stretch passes; if it passes none, the last is before the first.
ivec2 bins_of(Stretch s) {
    float begin = kappa_at(s, 0.0), end = kappa_at(s, s.extent);
    if (!(end > 0.0) || !(begin < float(frame.samples))) return ivec2(0, -1);
    return ivec2(row_at(begin) / SCATTER_BIN, row_at(end) / SCATTER_BIN);
}

// First and last slot that a stretch fills, up to half a sample at either end: stretches also end where the
// recording ends, and rounding must not decide whether the last slot is filled.
ivec2 slots_of(Stretch s) {
    vec2 ends = clamp(vec2(kappa_at(s, 0.0), kappa_at(s, s.extent)), vec2(0.0), vec2(float(frame.samples))) / float(SCATTER_SLOT);
    return ivec2(whole(ceil(ends.x - SLOT_MARGIN)), whole(floor(ends.y + SLOT_MARGIN)) - 1);
}

// Level of a stretch for the comparison with the others in a bin.
float level_in(Stretch s, int bin) {
    return level_at(s, clamp(distance_at(s, float(bin) * float(SCATTER_BIN) + 0.5 * float(SCATTER_BIN)), 0.0, s.extent));
}
