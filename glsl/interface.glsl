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

// What waits of an echo from one interface: a part in phase, and draws from behind the surface.
struct Echo {
    uint waiting;           // how many draws, and one for the part in phase
    uint draw;              // number of the first draw
    uint key;
    float time;             // us, at the surface
    float in_phase;         // amplitude
    float behind;           // of each draw, at the surface
    float thickness;        // scale of the draws' depth behind it, mm
    uint before;            // tissue in front
    uvec4 cell;             // that their phases belong to
    bool mean;              // it stands for all paths of the line; then their depths belong to the cell, too
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

// True if echoes of main paths are the mean over the small mirrors of a surface, and not one mirror for each of their paths.
bool echoes_in_the_mean() {
    return role == ROLE_BRANCHES && paths_are_alike() && (frame.flags & FLAG_COHERENT) == 0u;
}

// Mean over three cosines of incidence about the one of `mirrors`: of the pressure reflected, and of its square.
vec2 reflected(vec2 mirrors, Medium t1, Medium t2) {
    vec2 sum = vec2(0.0);
    // The Gauss-Hermite rule of three points.
    [[dont_unroll]] for (int i = -1; i <= 1; ++i) {
        float r = reflection(t1.impedance, t1.speed, t2.impedance, t2.speed, mirrors.x + float(i) * mirrors.y);
        sum += (i == 0 ? 2.0 / 3.0 : 1.0 / 6.0) * vec2(r, r * r);
    }
    return sum;
}

// Share of the pressure that a surface sends back along the path by the mirror of normal m: of the part in phase, and of each
// draw from behind. `mean`: by the mean over its mirrors about the normal m, and the root of its mean square.
vec2 sent_back(vec3 d, vec3 m, inout Interface at, Medium t1, Medium t2, bool mean) {
    float cos_m = -dot(d, m);
    vec2 mirrors = vec2(cos_m, 0.0);
    vec2 share = vec2(0.0);
    bool lobed = mean && surfaces[at.surface].roughness < SPECULAR;
    if (lobed) {
        float along = (1.0 - cos_m) * (float(LOBE_ANGLES - 1u) / LOBE_REACH);
        // Beyond the last angle as between the last two.
        uint j = min(uint(whole(floor(along))), LOBE_ANGLES - 2u);
        vec4 lobe = mix(surfaces[at.surface].lobe[j], surfaces[at.surface].lobe[j + 1u], along - float(j));
        share = vec2(exp(lobe.x), exp(lobe.y));
        mirrors = lobe.zw;
    } else {
        float facing = 2.0 * cos_m * cos_m - 1.0; // -d . v_r
        if (facing > 0.0) share = vec2(pow(facing, surfaces[at.surface].specularity));
    }
    vec2 r = reflected(mirrors, t1, t2);
    return share * vec2(r.x, lobed ? sqrt(r.y) : r.x);
}

// True if the surface sends anything back at all in the mean: it is met from the front.
bool is_mirrored(vec3 d, inout Interface at) {
    bool rough = surfaces[at.surface].roughness < SPECULAR;
    return rough ? dot(d, at.shading) < 0.0 : is_mirror(d, at.shading, at.geometric);
}

// m is the sampled micro-normal; `arrived` weight, share and probability of the path as it arrived. `mean`: the echo of all
// paths of the line, m is the normal about which the micro-normals lie.
void make_echo(inout Echo echo, inout Path path, vec3 arrived, uint line, uint n, inout Interface at, vec3 m, bool mean) {
    float coherence = surfaces[at.surface].coherence;
    Medium t1 = medium_of(at.before), t2 = medium_of(at.behind);
    vec2 amplitude = arrived.x * surfaces[at.surface].gain * beam_weight(off_axis(line, path.origin))
        * sent_back(path.direction, m, at, t1, t2, mean);
    if (amplitude.x == 0.0) return;
    float share = mean ? 1.0 : arrived.y;
    echo.time = path.time;
    echo.draw = n;
    echo.thickness = surfaces[at.surface].thickness;
    echo.before = at.before;
    echo.mean = mean;
    echo.cell = uvec4(0u);
    if ((frame.flags & FLAG_COHERENT) != 0u) {
        echo.waiting = 2u;
        echo.in_phase = 0.0;
        echo.behind = share * amplitude.x;
        return;
    }
    echo.waiting = 1u;
    echo.in_phase = coherence * share * amplitude.x;
    if (coherence >= 1.0) return;
    // Off the round numbers at which flat faces are modelled: on a cell's border the rounding of a
    // tracer would choose the phase.
    vec3 p = tissue_point(at.instance, path.origin) * 2.0 + 0.381966;
    // The two faces of a thin sheet are cells of their own.
    echo.cell = uvec4(ivec3(floor(p)), at.behind * 0x85ebca6bu + frame.seed);
    float power = mean ? 1.0 / float(LOBE_DRAWS) : arrived.y * arrived.z;
    echo.behind = sqrt((1.0 - coherence * coherence) * power) * amplitude.y
        * received(path.direction, at.shading, surfaces[at.surface].roughness, rows[row_of(path.time)].lobe);
    echo.waiting += mean ? LOBE_DRAWS : 1u;
}

// Deposits what waits: the draws, then the part in phase.
void deposit_echo(inout Echo echo, uint line) {
    bool split = (frame.flags & FLAG_COHERENT) == 0u;
    while (echo.waiting != 0u) {
        echo.waiting -= 1u;
        bool behind = echo.waiting != 0u;
        uint n = echo.draw + (behind ? echo.waiting - 1u : 0u);
        vec2 amplitude = vec2(echo.in_phase, 0.0);
        float time = echo.time;
        if (behind) {
            uvec4 words = draw(n, echo.key, PURPOSE_THICKNESS);
            uvec4 own = pcg4d(echo.cell + uvec4(0u, 0u, 0u, n * 0x9e3779b9u));
            float q = echo.thickness * abs(gaussian(echo.mean ? own.x : words.x & 0xffff0000u | words.y >> 16u));
            Medium before = medium_of(echo.before);
            time += q / before.speed;
            vec2 phase = vec2(1.0, 0.0);
            if (split) phase = phasor(unit(own.w));
            amplitude = echo.behind * exp(-before.absorption * q) * phase;
        }
        deposit_surface(line, time, amplitude, behind && split, line_random(line, n, echo.key, PURPOSE_DITHER));
    }
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
