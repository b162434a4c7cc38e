// The media that enclose a point: a small stack of instance ids, in the order of entry. Stacks are passed
// `inout` even where they are only read: a copy would move the whole stack.
//
// The includer declares frame, instances[] and tissues[].

struct Media { uint count; uint ids[MAX_STACK]; };

void copy_media(inout Media to, inout Media from) {
    to.count = from.count;
    for (uint i = 0u; i < from.count; ++i) to.ids[i] = from.ids[i];
}

// The entry of highest priority; ties go to the one entered last. NONE: the background.
uint current_instance(inout Media media) {
    uint best = NONE;
    int priority = -2147483647;
    for (uint i = 0u; i < media.count; ++i) {
        int p = instances[media.ids[i]].priority;
        if (p >= priority) { priority = p; best = media.ids[i]; }
    }
    return best;
}

uint tissue_of(uint instance) {
    return instance == NONE ? frame.background : instances[instance].tissue;
}

// Properties of a tissue that matter to sound on its way: mm/us, MRayl, Np/mm at f0.
struct Medium { float speed; float impedance; float absorption; };

Medium medium_of(uint tissue) {
    return Medium(tissues[tissue].speed, tissues[tissue].impedance, tissues[tissue].absorption);
}

// True if echoes from here are wanted: everywhere, or only inside the mask that is cut into an
// acquired image.
bool is_heard(inout Media media) {
    if ((frame.flags & FLAG_MASKED) == 0u) return true;
    for (uint i = 0u; i < media.count; ++i) {
        if (instances[media.ids[i]].masks != 0u) return true;
    }
    return false;
}

// Entering pushes; leaving removes the last occurrence. False when the stack is full. The couplant ends at the first
// surface: behind the body is no gel.
bool cross_interface(inout Media media, uint instance, bool entering) {
    if (entering) {
        if (media.count == 1u && media.ids[0] == frame.couplant) media.count = 0u;
        if (media.count >= MAX_STACK) return false;
        media.ids[media.count] = instance;
        media.count += 1u;
        return true;
    }
    uint at = NONE;
    for (uint i = 0u; i < media.count; ++i) {
        if (media.ids[i] == instance) at = i;
    }
    if (at == NONE) return true;
    for (uint i = at; i + 1u < media.count; ++i) media.ids[i] = media.ids[i + 1u];
    media.count -= 1u;
    return true;
}

// Weight behind a surface around the masks, where sound goes straight on: all
// except what a fluid interface reflects at normal incidence.
float passed(float impedance1, float impedance2) {
    float r = (impedance2 - impedance1) / (impedance2 + impedance1);
    return 1.0 - r * r;
}
