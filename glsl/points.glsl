// Samples of the voxel grid, and point targets, along a stretch: part of scatter.comp, which declares what is used here.

// Echo of one equally spaced sample looked up in the voxel grid; the jitter decorrelates the grid from the carrier.
// Starkov et al. 2019, II-A, figure 6: samples by the segment's speed of sound and the sampling rate, and the scatterers there.
uvec3 march_sample(Stretch s, int k) {
    float x = distance_at(s, float(k));
    if (!(x >= 0.0 && x < s.extent)) return uvec3(0u);
    vec3 p = s.o + x * s.d;
    // Voxels are carried by no flow.
    if (deforms(s)) p = rest_of(Motion(NONE, 0.0, field_of(s.instance)), p);
    ivec3 cell = ivec3(floor(p / frame.cell));
    uint seed = tissues[s.tissue].seed;
    uvec4 bits = pcg4d(uvec4(uvec3(cell), seed));
    uint low = ((bits.x & 255u) << 16u) | ((bits.y & 255u) << 8u) | (bits.z & 255u);
    if (!(float(low) * (1.0 / 16777216.0) < tissues[s.tissue].presence)) return uvec3(1u, 0u, 0u);
    uint row = row_at(float(k));
    float sigma_e = rows[row].sigma_elevation;
    float e = s.layer_y / sigma_e;
    float factor = 1.0;
    if (tissues[s.tissue].texture_depth > 0.0) {
        factor += tissues[s.tissue].texture_depth * tissue_texture(p / tissues[s.tissue].texture_length, seed);
    }
    float amplitude = s.weight * factor * exp(-0.5 * e * e - s.absorption * x)
        * thinning(s, x, row)
        * (tissues[s.tissue].mean + tissues[s.tissue].sigma * gaussian(bits.w));
    float kappa = float(k) + unit(bits.x) - 0.5;
    vec2 q = amplitude * frame.volume_scale * carrier(kappa * frame.sample_pitch / frame.speed);
    return uvec3(1u, 1u, deposit_near(kappa, q * rows[row_at(kappa + 0.5)].volume_gain));
}

// Adds to a sample of the window of a scanline's point targets; returns 1 if the value is too large.
uint deposit_point(uint scanline, int slot, vec2 v) {
    if (slot >= 0 && slot < int(min(SCATTER_WINDOW, frame.samples - window_begin))) {
        vec2 held = clamp(v, vec2(-ECHO_LIMIT), vec2(ECHO_LIMIT));
        uint at = 2u * (scanline * frame.samples + window_begin + uint(slot));
        atomicAdd(point_echoes[at], whole_large(floor(held.x + 0.5)));
        atomicAdd(point_echoes[at + 1u], whole_large(floor(held.y + 0.5)));
    }
    return uint(!(max(abs(v.x), abs(v.y)) < ECHO_LIMIT));
}

// Adds the echo of one point target, as wide as the beam, to a scanline; returns the number of samples for which the value is too large.
uint march_point(Stretch s, uint scanline, vec4 point) {
    vec3 rel = point.xyz - s.o;
    float x = dot(rel, s.d);
    if (!(x >= 0.0 && x < s.extent)) return 0u;
    float rho_e = dot(rel, s.e_e);
    // Borders of layers avoid the round numbers at which points lie: by rounding a point could belong to two or to none.
    float pitch = frame.slice_thickness / float(frame.layers);
    float height = rho_e - POINT_SHIFT * pitch;
    if (!(height >= -0.5 * pitch && height < 0.5 * pitch)) return 0u;
    float rho_l = dot(rel, s.e_l);
    float time = s.time + x / s.speed;
    float at = frame.speed * time / frame.sample_pitch;
    uint row = row_at(at);
    float sigma_l = rows[row].sigma_lateral, sigma_e = rows[row].sigma_elevation;
    float narrow = narrowing(s, x, row);
    float l = rho_l * sqrt(narrow) / sigma_l;
    if (abs(l) > 4.0) return 0u;
    float e = (s.layer_y + rho_e) / sigma_e;
    vec2 q = s.weight * point.w * sqrt(narrow) * exp(-0.5 * (l * l + e * e) - s.absorption * x) * thinning(s, x, row)
        * frame.volume_scale * carrier(time);
    vec4 shares = deposit_shares(at - floor(at));
    int slot = int(clamp(floor(at), -1e6, 1e9)) - 1 - int(window_begin);
    uint saturated = 0u;
    for (int i = 0; i < 4; ++i) {
        uint k = uint(clamp(slot + i + int(window_begin), 0, int(frame.samples) - 1));
        saturated += deposit_point(scanline, slot + i, q * (shares[i] * rows[k].point_gain));
    }
    return saturated;
}

// True if the stretch may have a point target of a sphere in the window. The beam is widest at an end of the part considered.
bool passes_sphere(Stretch s, vec4 sphere) {
    vec3 rel = sphere.xyz - s.o;
    float x = dot(rel, s.d);
    float r = sphere.w;
    // A point echoes in four samples around its own.
    vec2 kappa = vec2(kappa_at(s, x - r) - 3.0, kappa_at(s, x + r) + 3.0) - float(window_begin);
    if (!(x >= -r && x < s.extent + r && kappa.y >= 0.0 && kappa.x <= float(SCATTER_WINDOW)
        && abs(dot(rel, s.e_e)) <= (0.5 + POINT_SHIFT) * frame.slice_thickness / float(frame.layers) + r)) return false;
    uvec2 ends = uvec2(row_at(kappa_at(s, x - r)), row_at(kappa_at(s, x + r)));
    // An offset by a lens is largest at an end of the part, or at its turning point.
    float turn = clamp(-0.5 * s.lens.y / mix(s.lens.z, 1.0, s.lens.z == 0.0), max(x - r, 0.0), min(x + r, s.extent));
    vec3 at = vec3(max(x - r, 0.0), min(x + r, s.extent), turn);
    vec3 off = abs(offset_at(s, at));
    float sigma = max(rows[ends.x].sigma_lateral, rows[ends.y].sigma_lateral);
    float width = 4.0 * sigma * sqrt(widened(max(max(off.x, off.y), off.z), 1.0 / (sigma * sigma)));
    return abs(dot(rel, s.e_l)) <= width + r;
}
