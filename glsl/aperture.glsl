// What lies on the way counts by the part of the aperture that it lies in front of: losses, and surfaces that bend rays.
//
// The includer declares frame and apertures[], by layer, node and scanline. Node n lies n / APERTURE_BANDS of the way down.
// APERTURES is the name of another array for them.

#ifndef APERTURES
#define APERTURES apertures
#endif

// Loss where nobody has followed the main path: around masks.
const float UNKNOWN = -1e3;

bool loses_by_aperture() { return (frame.flags & FLAG_APERTURE) != 0u; }

// Place of a node of scanline l of a layer.
uint node_at(uint layer, uint l, uint node) { return (layer * (APERTURE_BANDS + 1u) + node) * frame.scanlines + l; }

uint aperture_at(uint line, uint node) { return node_at(line / frame.scanlines, line % frame.scanlines, node); }

// Nepers that a main path of this weight has lost.
float lost_of(float weight) { return -log(max(weight, LEAST_MAIN)); }

// Nepers lost at a sample of a piece of `shadow`; what its line has lost there in vain is limited as on main paths.
float shade_lost(vec4 piece, float kappa) {
    return clamp(piece.z * (kappa - piece.x) - piece.y, lost_of(1e20), lost_of(0.0));
}

// A one-way time in bands; the last node at most.
float bands_at(float time) {
    return clamp(mix(0.0, time * frame.speed / frame.depth, time > 0.0), 0.0, 1.0) * float(APERTURE_BANDS);
}

// Two of which something is known, and where between them a place is.
struct Between {
    uint above;
    uint below;
    float part;   // of the way from the one to the other
};

// Nodes of a line, of those that are `step` apart.
Between nodes_at(uint line, float time, uint step) {
    float at = bands_at(time) / float(step);
    uint node = min(uint(whole(floor(at))), APERTURE_BANDS / step - 1u);
    uint above = aperture_at(line, step * node);
    return Between(above, above + step * frame.scanlines, at - float(node));
}

// Factor on amplitudes of a line at a one-way time, in nepers, where its main path has lost `lost` nepers. Between two nodes
// it changes with the depth, but where a surface takes much away, with that: in front of it is what was at the node before.
float aperture_nepers(uint line, float time, float lost) {
    Between nodes = nodes_at(line, time, 1u);
    float lost_above = APERTURES[nodes.above].lost;
    float jump = APERTURES[nodes.below].lost - lost_above;
    if (jump > APERTURE_JUMP) nodes.part = clamp((lost - lost_above) / jump, 0.0, 1.0);
    return mix(APERTURES[nodes.above].gain, APERTURES[nodes.below].gain, nodes.part);
}

// Two of `count` scanlines or layers that have levels, between which one lies; LEVEL_STEP divides their numbers from `first` on.
Between levelled(uint at, uint first, uint count) {
    uint beyond = (first + at) % LEVEL_STEP;
    uint next = at + LEVEL_STEP - beyond;
    if (beyond == 0u || (beyond > at && next >= count)) return Between(at, at, 0.0);
    if (beyond > at) return Between(next, next, 0.0);
    uint before = at - beyond;
    return Between(before, next < count ? next : before, float(beyond) / float(LEVEL_STEP));
}

float level_between(uint line, float time) {
    Between nodes = nodes_at(line, time, LEVEL_STEP);
    return mix(APERTURES[nodes.above].level, APERTURES[nodes.below].level, nodes.part);
}

float level_beside(uint layer, Between lines, float time) {
    float before = level_between(layer * frame.scanlines + lines.above, time);
    if (lines.part <= 0.0) return before;
    return mix(before, level_between(layer * frame.scanlines + lines.below, time), lines.part);
}

// Factor on the amplitude of speckle of a line at a one-way time, in nepers, by surfaces that bend its beam.
float aperture_level(uint line, float time) {
    Between lines = levelled(line % frame.scanlines, frame.first_line, frame.scanlines);
    Between layers = levelled(line / frame.scanlines, 0u, frame.layers);
    float before = level_beside(layers.above, lines, time);
    if (layers.part <= 0.0) return before;
    return mix(before, level_beside(layers.below, lines, time), layers.part);
}
