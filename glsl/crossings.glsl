// The crossings of a straight scanline, and the instances around it behind each. One work group is one scanline;
// its first thread traces it.
//
// The includer declares frame, instances[] and counters, defines what rays meet, and includes closest_hit,
// surface_geometric_normal.

const uint MAX_CROSSINGS = 64u;

// Distances at which the scanline enters an instance; negative where it leaves one.
shared float crossings[MAX_CROSSINGS];
shared uint crossed[MAX_CROSSINGS];       // which
shared uint crossing_count;
// Instances that enclose the scanline's start: those that it leaves more often than it enters.
shared int enclosing;

void note_crossing(Hit hit, vec3 d) {
    bool entering = dot(d, surface_geometric_normal(hit)) < 0.0;
    if (crossing_count < MAX_CROSSINGS) {
        crossings[crossing_count] = entering ? hit.t : -hit.t;
        crossed[crossing_count] = hit.instance;
        crossing_count += 1u;
        enclosing += entering ? -1 : 1;
    } else {
        atomicAdd(counters.stack_overflow, 1u);
    }
}

void follow_scanline(vec3 o, vec3 d) {
    crossing_count = 0u;
    enclosing = 0;
    float t_min = 0.0;
    for (uint order = 0u; order <= MAX_CROSSINGS; ++order) {
        Hit hit = closest_hit(o, d, t_min, 1e9, NONE);
        if (hit.instance == NONE) break;
        note_crossing(hit, d);
        vec3 p = o + hit.t * d;
        float clearance = 4e-6 * max(max(abs(p.x), abs(p.y)), max(abs(p.z), 1.0));
        t_min = hit.t + clearance;
        if ((frame.flags & FLAG_COINCIDENT) != 0u) {
            Hit twin = closest_hit(o, d, max(hit.t - clearance, 0.0), hit.t + clearance, hit.instance);
            if (twin.instance != NONE) {
                note_crossing(twin, d);
                t_min = max(t_min, twin.t + clearance);
            }
        }
    }
}

// True if `instance` encloses the scanline behind its first `passed` crossings: after them it leaves more often
// than it enters. `entered`: the crossing at which it entered, counted from 1; 0 if the instance encloses the start.
bool is_around(uint instance, uint passed, out uint entered) {
    int net = 0;
    entered = 0u;
    for (uint i = 0u; i < crossing_count; ++i) {
        if (crossed[i] != instance) continue;
        bool enters = crossings[i] > 0.0;
        if (i >= passed) net += enters ? -1 : 1;
        else if (enters) entered = i + 1u;
    }
    return net > 0;
}

// The instance of the highest priority behind the first `passed` crossings, of equals the one entered last; NONE where
// nothing is around.
uint instance_behind(uint passed) {
    uint best = NONE, best_entered = 0u;
    for (uint i = passed; i < crossing_count; ++i) {
        uint entered;
        if (!is_around(crossed[i], passed, entered)) continue;
        int ahead = best == NONE ? 1 : instances[crossed[i]].priority - instances[best].priority;
        if (ahead > 0 || ahead == 0 && entered > best_entered) {
            best = crossed[i];
            best_entered = entered;
        }
    }
    return best;
}
