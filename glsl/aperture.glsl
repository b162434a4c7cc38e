// Losses by the aperture: what a main path has lost on the way counts by the part of the aperture that it lies in front of.
//
// The includer declares frame and apertures[]: for each layer, node and scanline the factor on amplitudes, in nepers, and
// the nepers that the main path itself has lost. Node n lies n / APERTURE_BANDS of the way down. APERTURES is the name of another
// array for them.

#ifndef APERTURES
#define APERTURES apertures
#endif

// Loss where nobody has followed the main path: around masks.
const float UNKNOWN = -1e3;

bool loses_by_aperture() { return (frame.flags & FLAG_APERTURE) != 0u; }

uint aperture_at(uint line, uint node) {
    uint layer = line / frame.scanlines;
    return (layer * (APERTURE_BANDS + 1u) + node) * frame.scanlines + line % frame.scanlines;
}

// Nepers that a main path of this weight has lost.
float lost_of(float weight) { return -log(max(weight, LEAST_MAIN)); }

// Nepers lost at a sample of a piece of `shadow`; what its line has lost there in vain is limited as on main paths.
float shade_lost(vec4 piece, float kappa) {
    return clamp(piece.z * (kappa - piece.x) - piece.y, lost_of(1e20), lost_of(0.0));
}

// Factor on amplitudes of a line at a one-way time, in nepers, where its main path has lost `lost` nepers. Between two nodes
// it changes with the depth, but where a surface takes much away, with that: in front of it is what was at the node before.
float aperture_nepers(uint line, float time, float lost) {
    float at = clamp(mix(0.0, time * frame.speed / frame.depth, time > 0.0), 0.0, 1.0) * float(APERTURE_BANDS);
    uint node = min(uint(whole(floor(at))), APERTURE_BANDS - 1u);
    vec2 above = APERTURES[aperture_at(line, node)];
    vec2 below = APERTURES[aperture_at(line, node + 1u)];
    float jump = below.y - above.y;
    float part = at - float(node);
    if (jump > APERTURE_JUMP) part = clamp((lost - above.y) / jump, 0.0, 1.0);
    return mix(above.x, below.x, part);
}
