// The middle of a beam through the anatomy: what trace follows before anything random, transmitted at every surface.
// It is a chain of straight ways, each in one medium, and is told to the includer way by way.
//
// The includer declares what path.glsl and wavefront.glsl need, includes aperture.glsl, and defines:
// true if the path is to end here
bool is_over(Path path);
// a way begins in a medium of this instance (NONE: the background); if it ends at once, nothing comes behind it
void begin_way(Path path, uint instance, Medium way, bool heard, bool ends);
// the way was this long, mm
void pass_way(float t);
// at its end the path has met a surface with this normal, turned against it; the part that is transmitted comes on
void pass_surface(Path path, vec3 normal, float transmitted);
// the last way has reached the image's bottom, or has ended
void end_ways();

// Transmits the path at a surface; returns the part of its intensity that gets through.
float pass(inout Path path, Met here, Medium t1, Medium t2) {
    Slope slope = slope_at(here, path, sample_at(frame.speed * path.time / frame.sample_pitch), path.spread.x, false);
    float transmitted = 1.0 - reflectance_at(slope, path.direction, t1, t2);
    Path before = path;
    bool through = transmit_path(path, slope.refracting, slope.geometric, t1.speed, t2.speed) || slope.width > 0.0;
    transmitted = mix(0.0, max(transmitted, 0.0), through);
    // Parts of the aperture may reach beyond.
    if (loses_by_aperture()) transmitted = max(transmitted, LEAST_PASSED);
    pass_surface(before, slope.shading, transmitted);
    return transmitted;
}

void follow(inout Path path, inout Media media) {
    Media after;
    float time_end = frame.depth / frame.speed;
    uint limit = 64u + frame.max_interactions;
    bool fresh = true;
    // Below zero if no sound begins here, or nothing was transmitted at a surface. A variable of its own for that is more
    // than LLVM 19 can carry around a ray query for vectors of four: it ends the process on `shadow_query`.
    if (path.weight <= 0.0) path.weight = -1.0;
    // True while the first of two coincident surfaces has been found and the ray searches for the other.
    bool pairing = false;
    Met first = surface_met(Hit(0.0, NONE, NONE, 0.0, 0.0));
    float close = 0.0;
    while (true) {
        uint before = current_instance(media);
        Medium t1 = medium_of(tissue_of(before));
        bool heard = is_heard(media);
        // Around the mask sound travels at the speed assumed by the recording.
        Medium way = t1;
        if (!heard) way.speed = frame.speed;
        bool ends = path.weight < 0.0 || path.crossings >= limit || is_over(path);
        if (!pairing && (fresh || ends)) begin_way(path, before, way, heard, ends);
        fresh = false;
        float t_end = (time_end - path.time) * way.speed;
        // With t_max = -1 the ray meets nothing.
        Hit hit = closest_hit(path.origin, path.direction, pairing ? max(first.hit.t - close, 0.0) : path.t_min,
            pairing ? first.hit.t + close : (ends ? -1.0 : t_end), pairing ? first.hit.instance : NONE);
        Met here = surface_met(hit);
        Met other = Met(Hit(hit.t, NONE, NONE, 0.0, 0.0), vec3(0.0), vec3(0.0));
        if (pairing) {
            other = here;
            here = first;
            pairing = false;
        } else if (hit.instance == NONE) {
            end_ways();
            break;
        } else {
            close = clearance(here.position);
            if (is_left(path, hit)) {
                path.t_min = hit.t + close;
                path.crossings += 1u;
                continue;
            }
            if ((frame.flags & FLAG_COINCIDENT) != 0u) {
                first = here;
                pairing = true;
                continue;
            }
        }
        path.crossings += 1u;
        float past = here.hit.t + close;
        if (other.hit.instance != NONE) past = max(past, other.hit.t + close);
        if (other.hit.instance < here.hit.instance) {
            Met found = here;
            here = other;
            other = found;
        }
        copy_media(after, media);
        cross_interface(after, here.hit.instance, dot(path.direction, here.normal) < 0.0);
        if (other.hit.instance != NONE) cross_interface(after, other.hit.instance, dot(path.direction, other.normal) < 0.0);
        bool heard_after = is_heard(after);
        uint behind = current_instance(after);
        if (behind == before && heard == heard_after) {
            path.t_min = past;
            copy_media(media, after);
            continue;
        }
        fresh = true;
        pass_way(here.hit.t);
        advance(path, here.hit.t, way, here.position);
        leave(path, here.hit);
        Medium t2 = medium_of(tissue_of(behind));
        if (behind == before || !heard && !heard_after) {
            path.t_min = max(path.t_min, past - here.hit.t);
            if (behind != before) {
                path.weight *= passed(t1.impedance, t2.impedance);
                path.interactions += 1u;
            }
        } else {
            path.interactions += 1u;
            float transmitted = pass(path, here, t1, t2);
            path.weight = transmitted <= 0.0 ? -1.0 : path.weight * transmitted;
            if (loses_by_aperture()) path.weight = max(path.weight, LEAST_MAIN);
        }
        copy_media(media, after);
    }
}
