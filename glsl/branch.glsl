// The parting of trace.comp's paths at a surface: what is reflected off a main path, and what a path does there by chance.
//
// The includer declares frame, rows[] and row_of, and includes path.glsl, emit.glsl and interface.glsl.

// True if what the surface sends back meets it, or one beside it, again: faces that are about parallel make a train of echoes.
bool makes_train(inout Path path, inout Interface at, float level) {
    return -dot(path.direction, at.shading) > TRAIN_FACING && level >= TRAIN_FLOOR;
}

// Paths that follow what is reflected off a main path, `least` of them where there are as many.
uint followers(float reflectance, float least) {
    float most = float(frame.paths);
    return uint(min(max(ceil(most * reflectance), least), most));
}

// Makes the reflected part of a main path a branch; true if path n is among the `wanted` that may follow it, and does. Those
// are a group until they part.
bool branch(inout Path path, uint line, uint n, uint key, inout Interface at, out uint wanted) {
    // Russian roulette: the fainter a branch, the more rarely it is followed, with as much more weight.
    float level = path.weight * at.reflectance * rows[row_of(path.time)].compensation;
    path.survival = level < frame.branch_floor ? max(level / frame.branch_floor, LEAST_SURVIVAL) : 1.0;
    wanted = followers(at.reflectance, path.survival == 1.0 && makes_train(path, at, level) ? float(TRAIN_PATHS) : 1.0);
    path.branch = true;
    path.weight *= at.reflectance / path.survival;
    path.probability = path.survival;
    path.share = 1.0 / float(wanted);
    path.first = paths_are_alike() ? 0u : n;
    path.count = paths_are_alike() ? wanted : 1u;
    return n < wanted && unit(line_random(line, n, key, PURPOSE_SURVIVAL).x) < path.survival;
}

// Divides the group of path n at a surface; true if the path is among those that are reflected. Where there are enough
// paths for both ways, each way has its part of the weight; otherwise a draw of this line's says how many take which.
bool parts(inout Path path, uint line, uint n, uint key, inout Interface at) {
    float reflectance = at.reflectance;
    float count = float(path.count);
    float level = path.weight * path.survival * reflectance * rows[row_of(path.time)].compensation;
    float portion = mix(reflectance, max(reflectance, 0.5), makes_train(path, at, level));
    bool last = path.reflections >= frame.max_reflections;
    bool enough = path.count > 1u && count * portion >= 1.0 && count * (1.0 - portion) >= 1.0;
    float u = unit(line_random(line, path.first, key, PURPOSE_PARTS).x);
    uint back = min(uint(mix(count * reflectance + u, count * portion + 0.5, enough)), path.count);
    // A path that may not be reflected again has what is transmitted, where anything is.
    if (last) back = reflectance < 1.0 ? 0u : path.count;
    uint through = path.count - back;
    bool reflects = n - path.first >= through;
    float part = mix(1.0 - reflectance, reflectance, reflects);
    uint members = reflects ? back : through;
    if (enough || last) {
        path.weight *= part;
        path.share *= count / float(members);
    } else {
        path.probability *= part;
    }
    if (reflects) path.first += through;
    path.count = members;
    return reflects;
}

// Chooses reflection or transmission at random; true for reflection.
bool choose(inout Path path, uint n, uint key, float reflectance) {
    float choice = unit(draw(n, key, PURPOSE_CHOICE).x);
    if (path.interactions == 1u) choice = (float(n) + choice) / float(frame.paths);
    bool reflects = choice < reflectance;
    path.probability *= mix(1.0 - reflectance, reflectance, reflects);
    return reflects;
}
