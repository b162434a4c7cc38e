// An interface where a path of trace.comp has arrived: its echo, and its state written down for the branches.
//
// The includer declares frame, surfaces[], tissues[], interactions[] and media, and includes path.glsl and
// wavefront.glsl.

// Distance of a point from the geometric scanline in the image plane, mm.
float off_axis(uint line, vec3 position) {
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    return dot(probe_point(position) - o, lateral);
}

// An interface that a path has arrived at; normals are turned against the path.
struct Interface {
    vec3 geometric; vec3 shading;
    vec3 refracting;                // averaged over the wavefront
    vec3 turning;                   // its change per mm across
    vec3 ray;                       // averaged over what a ray of the aperture stands for: it turns by this
    float reflectance;
    float turn;                     // deviation of the reflected direction over the beam
    bool curved;                    // over the beam: something gets through beside a totally reflected middle
    uint instance; uint surface;
    uint before; uint behind;       // tissues
};

// The echo of one path from one interface: a part in phase, and one from behind the surface.
struct Echo {
    uint waiting;                   // bit 0: the part in phase, bit 1: the other
    uint key;
    float time; vec2 in_phase;
    float late; vec2 behind;
};

// Share of an echo that the aperture receives of a surface whose small mirrors are spread about the normal n by its
// roughness, 1 where it faces the path; the share of the energy that is the variance of their tilts goes everywhere. What is
// in phase has its lobe by its neighbours' phases, which `beam` adds up.
float received(vec3 d, vec3 n, float roughness, float lobe) {
    float along = dot(d, n);
    float facing = max(2.0 * along * along - 1.0, 0.0);
    float diffuse = 2.0 / (roughness + 2.0);
    return sqrt(mix(exp(-2.0 * lobe * (1.0 - facing * facing) / (1.0 + 8.0 * lobe * diffuse)), 1.0, diffuse));
}

// m is the sampled micro-normal.
void make_echo(inout Echo echo, inout Path path, uint line, uint n, inout Interface at, vec3 m) {
    float coherence = surfaces[at.surface].coherence;
    Medium t1 = medium_of(at.before), t2 = medium_of(at.behind);
    float cos_m = -dot(path.direction, m);
    float r = reflection(t1.impedance, t1.speed, t2.impedance, t2.speed, cos_m);
    float facing = 2.0 * cos_m * cos_m - 1.0; // -d . v_r
    if (facing <= 0.0) return;
    float amplitude = path.weight * r * pow(facing, surfaces[at.surface].specularity)
        * surfaces[at.surface].gain * beam_weight(off_axis(line, path.origin));
    uvec4 words = draw(n, echo.key, PURPOSE_THICKNESS);
    float q = surfaces[at.surface].thickness * abs(gaussian(words.x & 0xffff0000u | words.y >> 16u));
    float late = path.time + q / t1.speed;
    float behind = amplitude * exp(-t1.absorption * q);
    echo.waiting = 1u;
    if ((frame.flags & FLAG_COHERENT) != 0u) {
        echo.time = late;
        echo.in_phase = vec2(path.share * behind, 0.0);
        return;
    }
    echo.time = path.time;
    echo.in_phase = vec2(coherence * path.share * amplitude, 0.0);
    if (coherence >= 1.0) return;
    // Off the round numbers at which flat faces are modelled: on a cell's border the rounding of a
    // tracer would choose the phase.
    vec3 p = tissue_point(at.instance, path.origin) * 2.0 + 0.381966;
    uvec3 cell = uvec3(ivec3(floor(p)));
    vec2 phase = phasor(unit(pcg4d(uvec4(cell, n * 0x9e3779b9u + frame.seed)).w));
    float incoherent = sqrt((1.0 - coherence * coherence) * path.share * path.probability) * behind
        * received(path.direction, at.shading, surfaces[at.surface].roughness, rows[row_of(path.time)].lobe);
    echo.waiting = 3u;
    echo.late = late;
    echo.behind = incoherent * phase;
}

// The interface where the path has arrived.
void meet(out Interface at, Met here, bool entering, inout Path path, uint before, uint behind) {
    Hit hit = here.hit;
    at.instance = hit.instance;
    at.surface = entering ? instances[hit.instance].surface_outside : instances[hit.instance].surface_inside;
    at.before = before;
    at.behind = behind;
    Slope slope = slope_at(here, path, row_of(path.time), path.spread.x, goes_on_in_shadow());
    at.geometric = slope.geometric;
    at.shading = slope.shading;
    at.refracting = slope.refracting;
    at.turning = slope.turning;
    at.ray = slope.ray;
    at.reflectance = reflectance_at(slope, path.direction, medium_of(before), medium_of(behind));
    at.turn = 2.0 * slope.width / max(-dot(path.direction, slope.refracting), 1e-3);
    at.curved = slope.width > 0.0;
}

void write_down(uint slot, inout Path path, uint n, inout Interface at, float weight) {
    interactions[slot].origin_weight = vec4(path.origin, weight);
    interactions[slot].direction_time = vec4(path.direction, path.time);
    interactions[slot].lateral_reflectance = vec4(path.lateral, at.reflectance);
    interactions[slot].geometric_turn = vec4(at.geometric, at.turn);
    interactions[slot].shading = vec4(at.shading, 0.0);
    interactions[slot].spread = vec4(path.spread, 0.0);
    interactions[slot].lens = vec4(path.lens, 0.0);
    interactions[slot].path = n;
    interactions[slot].instance = at.instance;
    interactions[slot].surface = at.surface;
    interactions[slot].before = at.before;
    interactions[slot].behind = at.behind;
    interactions[slot].interactions = path.interactions;
    interactions[slot].crossings = path.crossings;
    interactions[slot].enclosing = media.count;
    for (uint i = 0u; i < media.count; ++i) interactions[slot].media[i] = media.ids[i];
}

// The path of a line as it arrived where it was written down; its weight is that of the whole beam.
void recall(uint slot, uint line, out Path path, out Interface at) {
    path.origin = interactions[slot].origin_weight.xyz;
    path.weight = interactions[slot].origin_weight.w;
    path.direction = interactions[slot].direction_time.xyz;
    path.time = interactions[slot].direction_time.w;
    if (loses_by_aperture()) path.weight *= exp(aperture_nepers(line, path.time, lost_of(path.weight)));
    path.lateral = interactions[slot].lateral_reflectance.xyz;
    path.spread = interactions[slot].spread.xyz;
    path.lens = interactions[slot].lens.xyz;
    path.bent = 0.0;
    path.interactions = interactions[slot].interactions;
    path.crossings = interactions[slot].crossings;
    path.t_min = clearance(path.origin);
    path.handedness = 1.0;
    path.share = 1.0 / float(frame.paths);
    path.probability = 1.0;
    path.reflections = 0u;
    path.left_instance = NONE;
    path.left_primitive = NONE;
    path.branch = false;
    path.first = 0u;
    path.count = 1u;
    path.shadowed = false;
    path.survival = 1.0;
    at.geometric = interactions[slot].geometric_turn.xyz;
    at.turn = interactions[slot].geometric_turn.w;
    at.shading = interactions[slot].shading.xyz;
    at.refracting = at.shading; // nothing goes through here
    at.turning = vec3(0.0);
    at.ray = at.shading;
    at.reflectance = interactions[slot].lateral_reflectance.w;
    at.curved = false;
    at.instance = interactions[slot].instance;
    at.surface = interactions[slot].surface;
    at.before = interactions[slot].before;
    at.behind = interactions[slot].behind;
    media.count = interactions[slot].enclosing;
    for (uint i = 0u; i < media.count; ++i) media.ids[i] = interactions[slot].media[i];
}
