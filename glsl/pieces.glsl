// Scatterers of deformed tissue along a stretch: part of scatter.comp, which declares what is used here.

// No organ squeezes tissue to less than half of its length, but a coarse field may contain such values where
// surfaces slide past each other. There the search for scatterers is limited: those
// at the beam's edge may be missed.
const float MOST_SQUEEZED = 2.5;

const uint GENERATION_KEY = 0x9e3779b9u;   // 2^32 over the golden ratio: lattices of successive numbers lie far from each other

vec3 bounded(vec3 v) { return v * min(1.0, MOST_SQUEEZED * inversesqrt(max(dot(v, v), 1e-12))); }

// Echo of a scatterer of deformed tissue at `rel` from the stretch's origin, if it is within the strip, the
// slab of the layer and the range `x` along the beam. Returns 1 if it is, and the number of samples that could not hold it.
uvec2 hear(Stretch s, vec3 rel, float strength, int number, vec2 x, float drowned) {
    float along = dot(rel, s.d);
    float up = dot(rel, s.e_e);
    vec2 slab = slab_of();
    if (!(along >= x.x && along < x.y && up >= slab.x && up < slab.y)) return uvec2(0u);
    float kappa = kappa_at(s, along);
    uint row = row_at(kappa);
    float across = dot(rel, s.e_l);
    vec4 shape = rows[row].shape;
    if (!(abs(across) < half_width(s, row, along))) return uvec2(0u);
    float share = strip_share(across, shape.x, rows[row].strip_core, strip_ratio(s, along));
    float power = level_power(wanted_at(s, row, along, drowned), number);
    if (!(power > 0.0)) return uvec2(0u);
    up += s.layer_y;
    float exponent = rows[row_at(kappa + 0.5)].shape.z - s.absorption * LOG2_E * along - shape.y * up * up;
    float turns = 2.0 * frame.frequency * (s.time + along / s.speed);
    strength *= share * scattered(s, along, row) * sqrt(power) * thinning(s, along, row);
    return uvec2(1u, deposit_near(kappa, strength * exp2(exponent) * phasor(-turns)));
}

// Scatterers of deformed tissue that were set out together.
struct Scatterers {
    Motion motion;
    float weight;        // factor on their amplitudes
    uint number;         // of the generation; 0 where nothing flows
};

// Where a piece of a stretch lies in the reference shape, whichever lattice is searched there.
struct Piece {
    vec3 middle;                        // of the stretch between both distances
    vec3 d;                             // the beam's direction
    vec3 centre, half_size, miss;       // of the box that the affine map makes, and by how much its error widens it
    vec3 along, across, up;             // from offsets in it to those along the beam's axes
    float growth;                       // of volumes
};

// The piece between two distances, whose strip is `width` to either side at most.
Piece piece_of(Stretch s, Motion motion, vec2 x, float width) {
    Piece piece;
    float half_length = 0.5 * (x.y - x.x);
    vec3 here = s.o + (x.x + half_length) * s.d;
    vec3 p = rest_of(motion, here);
    mat3 jacobian;
    vec3 back = here - p - moved(motion, p, jacobian);
    vec3 middle = p + undeform(jacobian, back);
    float reach = slab_of().y;

    vec3 along = s.d * jacobian, across = s.e_l * jacobian, up = s.e_e * jacobian;
    // Where scatterers of the piece may lie by the affine map: it differs from the true one as at the corners, and half as much
    // of its range again between them. What is the same at all corners shifts the middle.
    vec3 d = bounded(undeform(jacobian, s.d)), el = bounded(undeform(jacobian, s.e_l)), ee = bounded(undeform(jacobian, s.e_e));
    vec3 half_size = vec3(half_length, width, reach);
    vec3 least = vec3(0.0), most = vec3(0.0);
    for (uint i = 0u; i < 8u; ++i) {
        vec3 side = (2.0 * vec3(i & 1u, (i >> 1u) & 1u, i >> 2u) - 1.0) * half_size;
        vec3 off = side.x * d + side.y * el + side.z * ee;
        mat3 unused;
        vec3 at = middle + off;
        vec3 to = at + moved(motion, at, unused) - here;
        vec3 miss = vec3(dot(to, s.d) - dot(off, along), dot(to, s.e_l) - dot(off, across), dot(to, s.e_e) - dot(off, up));
        least = min(least, miss);
        most = max(most, miss);
    }
    vec3 shift = -0.5 * (least + most);
    piece.middle = middle;
    piece.d = d;
    piece.centre = middle + shift.x * d + shift.y * el + shift.z * ee;
    piece.half_size = half_size;
    piece.miss = most - least;
    piece.along = along;
    piece.across = across;
    piece.up = up;
    piece.growth = abs(dot(jacobian[0], cross(jacobian[1], jacobian[2])));
    return piece;
}

// Scatterers of one lattice of deformed tissue in a piece. Cells are found where the piece lies
// in the reference shape: by the affine map at its middle, in a box that the map's error widens. Each scatterer
// then echoes from its true place, in the piece that holds it.
uvec3 march_piece(Stretch s, Scatterers group, Piece piece, int number, vec2 x, float drowned) {
    Lattice lattice = lattice_of(s.tissue, number);
    // Each generation has scatterers of its own.
    lattice.key += uvec3(group.number * GENERATION_KEY);
    float h = lattice.edge, inverse_h = lattice.inverse_edge;
    float half_length = piece.half_size.x;
    vec3 along = piece.along, across = piece.across, up = piece.up, centre = piece.centre;
    vec3 half_box = piece.half_size + min(piece.miss + 1e-3 * h, vec3(half_length + piece.half_size.z));

    Walk walk = walk_of(along, across, up);
    float high = half_box.z + 0.51 * h * dot(abs(up), vec3(1.0));
    float wide = half_box.y + 0.51 * h * dot(abs(across), vec3(1.0));
    // Along the beam, within the slab's middle plane.
    float deep = half_box.x + 0.51 * h * dot(abs(along), vec3(1.0)) + high * abs(along[walk.c] * walk.inverse_c);
    float far = deep + (wide + high * abs(walk.slant)) * abs(walk.along.y / walk.across.y);
    float row_slope = 1.0 / at_least(walk.along.y, 1e-4);

    vec3 nearest = floor(centre * inverse_h);
    vec3 rest = fma(-nearest, vec3(h), centre);
    ivec3 base = ivec3(nearest);
    // Squeezed tissue keeps its echo level though its scatterers are closer together.
    float strength = group.weight * lattice.amplitude * s.weight * frame.volume_scale * sqrt(clamp(piece.growth, LEAST_GROWTH, 1.0 / LEAST_GROWTH));
    float depth = tissues[s.tissue].texture_depth, length_inverse = 1.0 / tissues[s.tissue].texture_length;
    ivec3 step_a = unit_step(walk.a), step_b = unit_step(walk.b), step_c = unit_step(walk.c);
    float planes = far / abs(walk.step);
    ivec2 plane = cells_between(vec2(-planes, planes), rest[walk.a], inverse_h);
    uvec3 count = uvec3(0u);
    for (int i = plane.x; i < plane.y; ++i) {
        float da = (float(i) + 0.5) * h - rest[walk.a];
        // The rows of the plane within the ends of the piece.
        vec2 within = (vec2(-deep, deep) - walk.along.x * da) * row_slope;
        vec2 ends = row_ends(walk, da, wide, high);
        ends = vec2(max(ends.x, min(within.x, within.y)), min(ends.y, max(within.x, within.y)));
        ivec2 row_range = cells_between(ends, rest[walk.b], inverse_h);
        int j = row_range.x - 1;
        ivec2 column = ivec2(0);
        // Threads of a group first each search their next scatterer, so that all then have one to work on.
        while (j < row_range.y) {
            bool found = false;
            vec3 rel = vec3(0.0);
            float signed_strength = strength;
            while (!found && j < row_range.y) {
                if (column.x >= column.y) {
                    j += 1;
                    column = columns_between(walk, vec2(da, (float(j) + 0.5) * h - rest[walk.b]), wide, vec2(-high, high), rest[walk.c], inverse_h);
                }
                ivec3 at = i * step_a + j * step_b + column.x * step_c;
                bool counts = column.x < column.y && j < row_range.y;
                column.x += 1;
                count.x += uint(counts);
                uvec3 bits = pcg3d(uvec3(base + at) + lattice.key);
                rel = (vec3(at) + vec3(unit(bits.x), unit(bits.y), unit(bits.z))) * h - rest;
                vec3 about = abs(vec3(dot(rel, along), dot(rel, across), dot(rel, up)));
                signed_strength = mix(-strength, strength, (bits.z & 1u) == 0u);
                found = counts && present(lattice, bits) && all(lessThanEqual(about, half_box));
            }
            if (!found) continue;
            mat3 unused;
            vec3 rest_at = centre + rel;
            vec3 from = rest_at + moved(group.motion, rest_at, unused) - s.o;
            if (depth > 0.0) {
                // That of the axis beside the scatterer, as in march_planes.
                vec3 on_axis = piece.middle + (dot(from, s.d) - x.x - half_length) * piece.d;
                signed_strength *= 1.0 + depth * tissue_texture(on_axis * length_inverse, tissues[s.tissue].seed);
            }
            count.yz += hear(s, from, signed_strength, number, x, drowned);
        }
    }
    return count;
}

// Scatterers of the lattices from one number to another: of both generations where something flows, and of one for a pulse.
uvec3 march_generations(Stretch s, ivec2 numbers, vec2 x, float drowned) {
    uvec3 count = uvec3(0u);
    float width = 1.1 * end_width(s, x);
    if (!(width > 0.0)) return count;
    Scatterers group = Scatterers(Motion(NONE, 0.0, field_of(s.instance)), 1.0, 0u);
    uint flow = flows(s) ? flow_of(s.instance) : 0u;
    bool pulse = (push.part & PART_PULSE) != 0u;
    for (uint i = 0u; i < (flow == 0u || pulse ? 1u : GENERATIONS); ++i) {
        if (flow != 0u) {
            vec3 head = field_vector(flow + (pulse ? GENERATIONS : i));
            group.motion.flow = flow + FLOW_VECTORS;
            group.motion.way = head.z + (pulse ? head.x * push.time : 0.0);
            group.weight = pulse ? 1.0 : head.x;
            group.number = uint(whole(head.y));
        }
        Piece piece = piece_of(s, group.motion, x, width);
        for (int number = numbers.x; number <= numbers.y; ++number) count += march_piece(s, group, piece, number, x, drowned);
    }
    return count;
}
