// Lattices of scatterers, as coarse as speckle allows, and their enumeration along a beam; tools/reference/lattice.rs
// says why. The includer declares tissues[], rows[] and frame and includes random.glsl.

// Edges of cells on six successive levels, and volumes on two; the volume doubles every two levels.
const float EDGES[6] = float[6](1.0, 1.122462, 1.259921, 1.4142135, 1.5874011, 1.7817974);
const float VOLUMES[2] = float[2](1.0, 1.4142135);

// One level of a tissue's lattices.
struct Lattice {
    float edge;            // mm
    float inverse_edge;
    uint presence;         // cells of 65536 that hold a scatterer
    float amplitude;
    uvec3 key;
};

float lattice_edge(int number) {
    return frame.cell * EDGES[number % 6] * float(1u << uint(number / 6));
}

Lattice lattice_of(uint tissue, int number) {
    float volume = VOLUMES[number % 2] * float(1u << uint(number / 2));
    float presence = min(tissues[tissue].density * volume, 1.0);
    Lattice lattice;
    lattice.edge = lattice_edge(number);
    lattice.inverse_edge = 1.0 / lattice.edge;
    lattice.presence = max(uint(presence * 65536.0 + 0.5), 1u);
    lattice.amplitude = tissues[tissue].amplitude * sqrt(volume / presence);
    lattice.key = pcg4d(uvec4(tissues[tissue].seed, uint(number), 0u, 0u)).xyz;
    return lattice;
}

bool present(Lattice lattice, uvec3 bits) {
    return (((bits.x & 255u) << 8u) | (bits.y & 255u)) < lattice.presence;
}

// Lattice level that a piece of tissue needs, not rounded: the coarser of `wanted`, of the axial row, and the level that still has
// eight cells for each of the tissue's own scatterers; coarser by `drowned`. All are log2 of volumes, in cells of the finest.
float wanted_level(uint tissue, float wanted, float drowned) {
    if (wanted <= ALL_LEVELS) return 0.0;
    float own = -log2(8.0 * tissues[tissue].density);
    return clamp(LEVELS_PER_OCTAVE * (max(wanted, own) + drowned), 0.0, float(LATTICE_LEVELS));
}

// Share of the power that a level carries if level `wanted` is needed.
float level_power(float wanted, int number) {
    float above = wanted - float(number);
    return min(clamp((above + LEVEL_FADE) / LEVEL_FADE, 0.0, 1.0), clamp((1.0 - above) / LEVEL_FADE, 0.0, 1.0));
}

// Enumeration of a lattice under a beam: axis a along it, b across, c through the slab of the layer.
struct Walk {
    uint a; uint b; uint c;
    vec2 along; vec2 across;   // per mm of a and b within the slab's middle plane: along the beam, and across
    vec2 tilt;                 // decrease of c per mm of a and b within that plane
    float inverse_c;           // of the slab's normal
    float inverse_across;      // of across.y, without its sign
    float slant;               // shift across, mm, of a point 1 mm above the slab's middle plane along c
    float inverse_slant;
    float drift;               // of the axis, mm of b per mm of a
    float step;                // along the axis per mm of a
};

// Keeps a divisor away from zero, where a field squeezes tissue to no volume.
float at_least(float v, float least) { return mix(max(v, least), min(v, -least), v < 0.0); }

// The three directions of the beam in the lattice's space; covectors in deformed tissue.
Walk walk_of(vec3 d, vec3 lateral, vec3 up) {
    Walk w;
    vec3 size = abs(up);
    w.c = mix(mix(2u, 1u, size.y >= size.z), 0u, size.x >= max(size.y, size.z));
    w.a = (w.c + 1u) % 3u;
    w.b = (w.c + 2u) % 3u;
    w.inverse_c = 1.0 / at_least(up[w.c], 0.2);
    vec2 tilt = vec2(up[w.a], up[w.b]) * w.inverse_c;
    vec2 along = vec2(d[w.a], d[w.b]) - d[w.c] * tilt;
    vec2 across = vec2(lateral[w.a], lateral[w.b]) - lateral[w.c] * tilt;
    if (abs(across.x) > abs(across.y)) {
        uint a = w.a;
        w.a = w.b;
        w.b = a;
        tilt = tilt.yx;
        along = along.yx;
        across = across.yx;
    }
    w.across = vec2(across.x, at_least(across.y, 0.25));
    w.along = along;
    w.tilt = tilt;
    w.inverse_across = 1.0 / abs(w.across.y);
    w.slant = at_least(lateral[w.c] * w.inverse_c, 1e-4);
    w.inverse_slant = 1.0 / w.slant;
    w.drift = -w.across.x / w.across.y;
    w.step = at_least(w.along.x + w.along.y * w.drift, 0.2);
    return w;
}

ivec3 unit_step(uint axis) { return ivec3(equal(uvec3(axis), uvec3(0u, 1u, 2u))); }

// Cells, of edge 1 / inverse_h, whose centres lie in `ends` about `rest`: the first one, and the first one after them. At most
// 1024, so that the loop over them ends even for NaN.
ivec2 cells_between(vec2 ends, float rest, float inverse_h) {
    vec2 at = clamp(ceil((ends + rest) * inverse_h - 0.5), -1e6, 1e6);
    int first = whole(at.x);
    return ivec2(first, first + min(whole(clamp(at.y - at.x, 0.0, 1024.0)), 1024));
}

// Range along b, in the plane at `da`, that may be within `width` of the axis and within `reach` of the slab's
// middle plane.
vec2 row_ends(Walk walk, float da, float width, float reach) {
    float half_range = (width + abs(walk.slant) * reach) * walk.inverse_across;
    return walk.drift * da + vec2(-half_range, half_range);
}

// Range along c of the cells in one row that are.
ivec2 columns_between(Walk walk, vec2 at, float width, vec2 slab, float rest, float inverse_h) {
    float across = dot(walk.across, at);
    vec2 up = (vec2(-width, width) - across) * walk.inverse_slant;
    vec2 both = vec2(max(min(up.x, up.y), slab.x), min(max(up.x, up.y), slab.y)) * walk.inverse_c;
    if (walk.inverse_c < 0.0) both = both.yx;
    return cells_between(both - dot(walk.tilt, at), rest, inverse_h);
}
