// Where the paths of a line begin.
//
// The includer declares stacks[] and includes path.glsl.

// Path n of a line and the media around it, at the start that origin gives.
void start(uint line, uint n, out Path path, inout Media media) {
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    begin(world_point(o), world_vector(d), world_vector(lateral), path);
    uvec4 bits = draw(n, 0u, PURPOSE_JITTER);
    path.origin = world_point(o) + frame.origin_jitter * gaussian(bits.x) * path.lateral;
    if (frame.emission_lobe > 0.0) {
        path.direction = power_cosine(path.direction, frame.emission_lobe, vec2(unit(bits.y), unit(bits.z)));
        path.lateral = normalize(path.lateral - dot(path.lateral, path.direction) * path.direction);
    }
    uint at = line * START_WORDS;
    media.count = stacks[at];
    for (uint i = 0u; i < media.count; ++i) media.ids[i] = stacks[at + 1u + i];
    float travelled = uintBitsToFloat(stacks[at + MAX_STACK + 1u]);
    if (travelled > 0.0) {
        path.origin += travelled * path.direction;
        path.time = travelled / frame.speed;
        path.strip.x += travelled * path.strip.y;
        path.t_min = clearance(path.origin);
    }
    path.weight = uintBitsToFloat(stacks[at + MAX_STACK + 2u]);
    path.interactions = stacks[at + MAX_STACK + 3u];
}
