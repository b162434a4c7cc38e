// Scatterers of deformed tissue along a stretch: part of scatter.comp, which declares what is used here.

bool deforms(Stretch s) { return DEFORMING && field_of(s.instance) != NONE; }

// Stretches through deformed tissue are cut: within a piece the field's gradient hardly changes.
float piece_length(Field f) { return max(0.25 / f.scale.x, 4.0 * frame.cell); }

// Tissue is squeezed to less than half of its length by no organ; a coarse field may say so where
// surfaces slide past each other. There the search for scatterers is kept to what a frame affords: those
// at the beam's edge may be missed.
const float MOST_SQUEEZED = 2.5;

vec3 bounded(vec3 v) { return v * min(1.0, MOST_SQUEEZED * inversesqrt(max(dot(v, v), 1e-12))); }

// First piece and number of pieces.
ivec2 field_pieces(Stretch s) {
    vec2 x = window_extent(s);
    if (!(x.y > x.x)) return ivec2(0);
    float piece = piece_length(load_field(field_of(s.instance)));
    int first = int(floor(x.x / piece));
    return ivec2(first, int(ceil(x.y / piece)) - first);
}

// All scatterers of deformed tissue that the beam reaches within one piece. Cells are found where the
// piece lies in the reference shape, a sheared box up to a margin; each scatterer is then heard where it
// is, by the piece that holds it.
uvec2 march_piece(Stretch s, int piece) {
    Field f = load_field(field_of(s.instance));
    float pitch = piece_length(f);
    vec2 within = vec2(float(piece) * pitch, min(float(piece + 1) * pitch, s.extent));
    float half_length = 0.5 * (within.y - within.x);
    float x_middle = within.x + half_length;
    vec3 middle = s.o + x_middle * s.d;
    vec3 p = reference_point(f, middle);
    mat3 jacobian;
    vec3 back = middle - p - displacement(f, p, jacobian);
    jacobian += mat3(1.0);
    vec3 o = p + undeform(jacobian, back);
    vec3 d = bounded(undeform(jacobian, s.d)), el = bounded(undeform(jacobian, s.e_l)), ee = bounded(undeform(jacobian, s.e_e));
    float sigma = max(rows[row_at(kappa_at(s, within.x))].sigma_lateral, rows[row_at(kappa_at(s, within.y))].sigma_lateral);
    float lateral_reach = 1.02 * frame.lateral_cut * sigma, elevation_reach = frame.elevation_reach;

    // How far tissue at the corners is from where the box puts it; half as much again for what is between.
    float h = frame.cell;
    float miss = 0.0;
    for (uint i = 0u; i < 8u; ++i) {
        vec3 side = (2.0 * vec3(i & 1u, (i >> 1u) & 1u, i >> 2u) - 1.0) * vec3(half_length, lateral_reach, elevation_reach);
        vec3 there = middle + side.x * s.d + side.y * s.e_l + side.z * s.e_e;
        miss = max(miss, length(displaced(f, o + side.x * d + side.y * el + side.z * ee) - there));
    }
    miss = min(1.5 * miss + 1e-3 * h, half_length + elevation_reach);
    float margin = min(miss * max(length(d), max(length(el), length(ee))), half_length + elevation_reach);

    float factor = s.weight;
    if (tissues[s.tissue].texture_depth > 0.0) {
        factor *= 1.0 + tissues[s.tissue].texture_depth * tissue_texture(o / tissues[s.tissue].texture_length, tissues[s.tissue].seed);
    }
    float presence = tissues[s.tissue].presence;
    uint seed = tissues[s.tissue].seed;
    uint axis = dominant_axis(d);
    vec3 origin = o;
    o = turn(o, axis); d = turn(d, axis); el = turn(el, axis); ee = turn(ee, axis);
    float inverse_h = 1.0 / h;
    float thick = half_length * abs(d.x) + margin + elevation_reach * abs(ee.x);
    float half_planes = thick + lateral_reach * abs(el.x);
    int last = int(floor((o.x + half_planes) * inverse_h));

    // Cross-sections as in march_plane, but d, el and ee are oblique and of any length.
    vec2 slope = d.yz / d.x;
    vec2 u_l = el.yz - el.x * slope;
    vec2 u_e = ee.yz - ee.x * slope;
    bool swap = abs(u_l.y) > abs(u_l.x);
    if (swap) { slope = slope.yx; u_l = u_l.yx; u_e = u_e.yx; }
    float kappa = u_l.y / u_l.x;
    float skew = abs(slope.y - kappa * slope.x);
    float half_column = 0.5 * h * (abs(kappa) + skew) + margin * (1.0 + abs(kappa) + skew)
        + elevation_reach * abs(u_e.y - kappa * u_e.x);
    float across = abs(slope.x) * 0.5 * h + margin * (1.0 + abs(slope.x)) + elevation_reach * abs(u_e.x);

    uvec2 count = uvec2(0u);
    for (int plane = int(floor((o.x - half_planes) * inverse_h)); plane <= last; ++plane) {
        float ahead = (float(plane) + 0.5) * h - o.x;
        vec2 centre = (swap ? o.zy : o.yz) + slope * ahead;
        // The part of the beam's width that is within the piece's ends here.
        vec2 side = vec2(-lateral_reach, lateral_reach);
        float part = (thick + 0.5 * h) / max(abs(el.x), 1e-6);
        float at = ahead / (abs(el.x) > 1e-6 ? el.x : 1e-6);
        if (abs(el.x) > 1e-6) side = vec2(max(side.x, at - part), min(side.y, at + part));
        if (side.x > side.y) continue;
        float row_middle = centre.x + 0.5 * (side.x + side.y) * u_l.x;
        float half_row = across + 0.5 * (side.y - side.x) * abs(u_l.x);
        int row_last = int(floor((row_middle + half_row) * inverse_h));
        for (int r = int(floor((row_middle - half_row) * inverse_h)); r <= row_last; ++r) {
            float column = centre.y + kappa * ((float(r) + 0.5) * h - centre.x);
            int column_last = int(floor((column + half_column) * inverse_h));
            for (int c = int(floor((column - half_column) * inverse_h)); c <= column_last; ++c) {
                count.x += 1u;
                ivec3 cell = turn_back(swap ? ivec3(plane, c, r) : ivec3(plane, r, c), axis);
                uvec4 bits = pcg4d(uvec4(uvec3(cell), seed));
                if (!present(bits, presence)) continue;
                vec3 q = (vec3(cell) + vec3(unit(bits.x), unit(bits.y), unit(bits.z))) * h;
                vec3 about = jacobian * (q - origin);
                if (abs(dot(about, s.e_e)) > elevation_reach + miss || abs(dot(about, s.d)) > half_length + miss) continue;
                if (hear(s, displaced(f, q) - s.o, bits.w, factor, within)) count.y += 1u;
            }
        }
    }
    return count;
}
