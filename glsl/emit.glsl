// Echoes and segments that a path of trace.comp writes.
//
// The includer declares frame, tissues[], rows[], surface_echoes[], segments[], segment_count[], counters and media,
// and includes deposit.glsl, path.glsl and media.glsl.

// `dither` randomises rounding: each of N paths deposits an N-th, and rounded to the nearest, faint echoes would vanish
// as N grows.
void deposit_surface(uint line, float time, vec2 amplitude, bool incoherent, uvec4 dither) {
    uint l = line % frame.scanlines;
    float y = elevation(line / frame.scanlines);
    float kappa = frame.speed * time / frame.sample_pitch;
    float before = floor(kappa);
    vec4 shares = deposit_shares(kappa - before);
    vec2 q = carrier(time);
    q = vec2(amplitude.x * q.x - amplitude.y * q.y, amplitude.x * q.y + amplitude.y * q.x);
    for (int i = 0; i < 4; ++i) {
        float at = before + float(i - 1);
        if (!(at >= 0.0 && at < float(frame.samples))) continue;
        uint k = uint(whole(at));
        float sigma = rows[k].sigma_elevation;
        float gain = rows[k].surface_gain * exp(-0.5 * y * y / (sigma * sigma));
        if (incoherent) gain *= rows[k].incoherent_gain;
        vec2 v = q * gain * shares[i];
        uint slot = 2u * (l * frame.samples + k);
        int re = to_fixed(v.x, frame.surface_scale, float(dither[i] >> 16u) * (1.0 / 65536.0));
        int im = to_fixed(v.y, frame.surface_scale, float(dither[i] & 0xffffu) * (1.0 / 65536.0));
        if (re != 0) atomicAdd(surface_echoes[slot], re);
        if (im != 0) atomicAdd(surface_echoes[slot + 1u], im);
    }
}

// True if all paths of a line are equal up to their first reflection.
bool paths_are_alike() {
    return frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0
        && (frame.flags & FLAG_ROUGH_TRANSMISSION) == 0u;
}

// True for a main path that stands for all paths of its line: behind a surface that lets nothing through, or in its shadow, it
// goes on, as parts of the aperture may reach beyond.
bool goes_on_in_shadow() { return role == ROLE_MAIN && loses_by_aperture(); }

// True for a shadowed path in a medium of another speed than tissue: those that reach beyond it come through tissue.
bool is_passed_by(inout Path path, float speed) {
    return path.shadowed && abs(speed - frame.speed) > OTHER_SPEED * frame.speed;
}

const float FOREVER = 1e18;

// Writes what a main path loses up to a time, us, at the nodes that it reaches before, `rate` nepers per us from where it is, and
// how surfaces on the way to each have turned rays; in front of its start, and where it is not followed, nobody knows what it loses.
void write_losses(uint line, inout uint node, inout Path path, float rate, float until, bool known) {
    float spacing = frame.depth / (frame.speed * float(APERTURE_BANDS));
    float lost = lost_of(path.weight);
    for (; node <= APERTURE_BANDS && float(node) * spacing < until; ++node) {
        float way = float(node) * spacing - path.time;
        uint at = aperture_at(line, node);
        apertures[at].lost = mix(UNKNOWN, min(lost + rate * way, lost_of(0.0)), known && way >= 0.0);
        apertures[at].bent = path.bent;
        path.bent = 0.0;
    }
}

// Distance between the paths of neighbouring scanlines, mm, and its growth per mm in a medium of speed c: what a main path
// has carried here. Reflected ones, whose neighbours may have been reflected elsewhere, are as far apart as scanlines are.
vec2 strip_of(inout Path path, vec2 nominal) {
    if (path.reflections > 0u) return nominal;
    return path.strip.x < 0.0 ? -path.strip : path.strip;
}

// Part of the weight with which the group of a path counts in power.
float of_group(inout Path path) {
    return path.branch ? sqrt(path.probability * path.share * float(path.count)) : 1.0;
}

// Writes a segment, unless another path writes it. Its weight and share say which part of the volume echoes this path
// stands for, and over how many paths they average.
void emit_segment(inout Path path, uint line, uint n, uint instance, float extent) {
    bool whole = paths_are_alike() && (frame.sampling == SAMPLING_MAIN_PATH
        || (frame.sampling == SAMPLING_SHARED_PRIMARY && path.interactions == 0u));
    if (whole && n != path.first || again != 0u) return;
    if (!is_heard(media)) return;
    uint tissue = tissue_of(instance);
    if (is_passed_by(path, tissues[tissue].speed)) return;
    if (!(extent > 0.0) || (tissues[tissue].presence <= 0.0 && frame.points == 0u)) return;
    if (path.branch && path.weight * path.survival * rows[row_of(path.time)].compensation < frame.volume_floor) return;
    uint slot = atomicAdd(segment_count[line], 1u);
    if (slot >= frame.segment_capacity) {
        atomicAdd(counters.segments_dropped, 1u);
        return;
    }
    uint at = line * frame.segment_capacity + slot;
    // Speckle adds in power; the first of a group stands for all of it.
    float weight = path.weight * mix(sqrt(path.survival) * path.share, of_group(path), whole);
    float share = mix(max(1.0, path.probability / (path.survival * path.share)), 1.0, whole);
    segments[at].origin_length = vec4(path.origin, extent);
    segments[at].direction_time = vec4(path.direction, path.time);
    segments[at].lateral_weight = vec4(path.lateral, weight);
    segments[at].spread = vec4(path.spread, share);
    vec2 pitch = line_pitch();
    float speed = tissues[tissue].speed;
    vec2 nominal = vec2(pitch.x + pitch.y * frame.speed * path.time, pitch.y * frame.speed / speed);
    vec2 strip = strip_of(path, nominal);
    vec2 ratios = vec2(strip.x, abs(strip.x + extent * strip.y)) / max(vec2(nominal.x, nominal.x + extent * nominal.y), vec2(LEAST_PITCH));
    // Where all scanlines meet their distance says nothing.
    if (nominal.x > LEAST_PITCH && (any(greaterThan(ratios, vec2(STRIP_LIMIT))) || any(lessThan(ratios, vec2(1.0 / STRIP_LIMIT))))) {
        atomicAdd(counters.strips_limited, 1u);
    }
    segments[at].lens = vec4(path.lens, strip.y);
    segments[at].tissue = tissue;
    segments[at].instance = instance;
    segments[at].line = line | (path.reflections > 0u ? REFLECTED : 0u);
    segments[at].strip = path.handedness * max(strip.x, LEAST_PITCH);
}
