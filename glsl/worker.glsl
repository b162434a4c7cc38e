// How trace deals its work out: pieces from a counter, each with one or more paths of a line. docs/kernels.md, trace.
//
// The includer declares frame, counters, interactions[], interaction_count[], the push constants and role, and includes
// interface.glsl and branch.glsl.

// Reads the paths of a piece of work; false if there is no such interaction.
bool take(uint piece, out uint line, out uint next, out uint last, out uint main_path, out uint slot) {
    uint row = piece % line_count;
    uint at = piece / line_count;
    line = line_begin + row;
    if (role != ROLE_BRANCHES) {
        next = path_begin + at;
        last = next + 1u;
        main_path = row * path_count + at;
        slot = main_path * frame.max_interactions;
        return true;
    }
    uint slots = path_count * frame.max_interactions;
    uint blocks_before = at / slots;
    at -= blocks_before * slots;
    main_path = row * path_count + at / frame.max_interactions;
    slot = row * slots + at;
    if (at % frame.max_interactions >= interaction_count[main_path]) return false;
    next = interactions[slot].path;
    last = next + 1u;
    if (paths_are_alike()) {
        next = block * blocks_before;
        last = min(next + block, frame.paths);
        // Path 0 echoes for all of them.
        if (echoes_in_the_mean()) last = min(last, followers(interactions[slot].lateral_reflectance.w, float(TRAIN_PATHS)));
        return next < last;
    }
    return true;
}

// Takes the next piece of work, `quota` at most; false if there is none.
bool take_next(inout uint quota, inout uint line, inout uint next, inout uint last, inout uint main_path, inout uint slot) {
    bool found = false;
    while (quota > 0u && !found) {
        quota -= 1u;
        uint piece = turn == 0u ? atomicAdd(counters.taken_even, 1u) : atomicAdd(counters.taken_odd, 1u);
        if (piece >= pieces) break;
        found = take(piece, line, next, last, main_path, slot);
    }
    return found;
}
