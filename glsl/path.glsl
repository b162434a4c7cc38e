// A path and its steps between interfaces.
//
// The includer declares frame and triangles[], and includes random.glsl, probe.glsl, transform.glsl,
// acoustics.glsl and media.glsl.

struct Path {
    vec3 origin; vec3 direction; vec3 lateral;
    float handedness; float t_min;
    float weight;       // one-way intensity, which is the two-way amplitude
    float share;        // part of an echo's amplitude that this path carries
    float probability;  // of the stochastic choices made so far
    float time;         // one way, us
    vec3 spread;        // lateral variance a + 2 b x + c x^2 after rough reflections
    vec3 lens;          // lateral offset a + b x + c x^2 of what comes one deviation beside the axis
    float bent;         // sine by which surfaces have turned a ray on a main path behind the last node, towards its lateral axis
    vec2 strip;         // distance of the neighbouring scanline's path across, mm, and its growth per mm
    uint interactions; uint reflections; uint crossings;
    uint left_instance; uint left_primitive; // the triangle that it starts on; NONE: none
    float survival;     // probability with which it was followed; its weight is divided by it
    bool branch;
    uint first; uint count; // the paths that have come the same way, a group: this one is one of them
    bool shadowed;      // a main path behind a surface that lets hardly anything through: only others of the aperture reach there
};

uvec4 draw(uint n, uint key, uint purpose) {
    return path_draw(n, key, purpose, frame.seed, (frame.flags & FLAG_SOBOL) != 0u);
}

// Random numbers of one line's interaction, for decisions that neighbouring lines must not share.
const uint PURPOSE_DITHER = 0x51ed270bu;
const uint PURPOSE_SURVIVAL = 0x2545f491u;
const uint PURPOSE_PARTS = 0x85ebca6bu;

uvec4 line_random(uint line, uint n, uint key, uint purpose) {
    // As the same line has it among all of the face.
    uint made = line % frame.scanlines, layer = line / frame.scanlines;
    uint on_face = layer * face_lines() + frame.first_line + made;
    return pcg4d(uvec4(on_face, n, key, frame.seed ^ purpose));
}

float clearance(vec3 p) {
    return 4e-6 * max(max(abs(p.x), abs(p.y)), max(abs(p.z), 1.0));
}

// A path at its start, before anything random: its place, its direction and its lateral axis in the world.
void begin(vec3 origin, vec3 direction, vec3 lateral, out Path path) {
    path.origin = origin;
    path.direction = direction;
    path.lateral = lateral;
    path.spread = vec3(frame.origin_jitter * frame.origin_jitter, 0.0, 0.0);
    if (frame.emission_lobe > 0.0) path.spread.z = 1.0 / (frame.emission_lobe + 2.0);
    path.lens = vec3(0.0);
    path.bent = 0.0;
    path.strip = line_pitch();
    path.handedness = 1.0;
    path.t_min = 0.0;
    path.weight = 1.0;
    path.share = 1.0 / float(frame.paths);
    path.probability = 1.0;
    path.time = 0.0;
    path.interactions = 0u;
    path.reflections = 0u;
    path.crossings = 0u;
    path.branch = false;
    path.first = 0u;
    path.count = 1u;
    path.shadowed = false;
    path.survival = 1.0;
    path.left_instance = NONE;
    path.left_primitive = NONE;
}

// True if by rounding the ray meets again the triangle on which the path starts, which a straight line meets
// only once. For a path refracted nearly along the triangle no clearance would be enough. A triangle that
// was cut has several numbers, so its corners are compared.
bool is_left(Path path, Hit hit) {
    if (hit.instance != path.left_instance) return false;
    uint a = 3u * hit.primitive;
    uint b = 3u * path.left_primitive;
    return triangles[a] == triangles[b] && triangles[a + 1u] == triangles[b + 1u] && triangles[a + 2u] == triangles[b + 2u];
}

void leave(inout Path path, Hit hit) {
    path.left_instance = hit.instance;
    path.left_primitive = hit.primitive;
}

void reflect_path(inout Path path, vec3 m, float roughness, float turn) {
    path.direction = normalize(path.direction - 2.0 * dot(path.direction, m) * m);
    path.lateral = path.lateral - 2.0 * dot(path.lateral, m) * m;
    path.handedness = -path.handedness;
    path.reflections += 1u;
    if (roughness < SPECULAR) path.spread.z += 4.0 / (roughness + 2.0);
    path.spread.z += min(turn * turn, 1.0);
}

// Moves the path along its segment: attenuation, time, widening.
// Starkov et al. 2019, II-A: attenuation by Beer and Lambert.
void advance(inout Path path, float t, Medium medium, vec3 position) {
    path.weight *= exp(-medium.absorption * t);
    path.time += t / medium.speed;
    path.spread.x += t * (2.0 * path.spread.y + t * path.spread.z);
    path.spread.y += t * path.spread.z;
    path.lens.x += t * (path.lens.y + t * path.lens.z);
    path.lens.y += 2.0 * t * path.lens.z;
    path.strip.x += t * path.strip.y;
    path.origin = position;
    path.t_min = clearance(position);
}
