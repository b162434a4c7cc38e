// variants: rigid deforming(DEFORMING_TISSUE) flowing(DEFORMING_TISSUE, FLOWING_TISSUE)
#version 460
// Echoes of scatterers and point targets along the segments of one scanline. A scanline hears the scatterers of its own
// strip, which beam spreads over its neighbours, and all point targets in its beam. One workgroup owns one
// (scanline, chunk of its segments, window of samples) and gathers in shared memory, so that global
// atomics happen once per sample. A thread works on one segment in one bin of samples.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "random.glsl"
#include "numbers.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 4) restrict readonly buffer PointBuffer { vec4 points[]; };
layout(std430, binding = 5) restrict readonly buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 6) restrict readonly buffer SegmentCountBuffer { uint segment_count[]; };
layout(std430, binding = 7) restrict buffer VolumeEchoBuffer { int volume_echoes[]; };
layout(std430, binding = 8) restrict buffer CounterBuffer { Counters counters; };
layout(std430, binding = 9) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 10) restrict readonly buffer FieldBuffer { vec4 fields[]; };   // of the deforming one
layout(std430, binding = 11) restrict buffer PointEchoBuffer { int point_echoes[]; };   // where there are point targets
layout(std430, binding = 12) restrict readonly buffer ApertureBuffer { Aperture apertures[]; };
layout(push_constant) uniform Push {
    uint part;     // PART_*
    float time;    // of a pulse, seconds from the frame's time
} push;

// True if any instance's tissue deforms, or something flows. Modules of their own, as not every driver removes the code that
// a specialization constant switches off, and the code for deformed tissue is the larger half.
#ifdef DEFORMING_TISSUE
const bool DEFORMING = true;
#else
const bool DEFORMING = false;
#endif
#ifdef FLOWING_TISSUE
const bool FLOWING = true;
#else
const bool FLOWING = false;
#endif

#include "transform.glsl"
#include "probe.glsl"
#include "field.glsl"
#include "texture.glsl"
#include "deposit.glsl"
#include "alone.glsl"

const uint THREADS = 64u;
const float POINT_SHIFT = 0.01234;   // shift of the layers' borders, in their pitch
const float LEVEL_SPAN = 3.0;             // mm of depth between the rows whose lattice level is looked up
const float SHAPE_SPAN = 0.6;             // mm of depth to either side, for differences of the beam's shape
const uint BINS = SCATTER_WINDOW / SCATTER_BIN;
const int BESIDE = 2;                     // bins on each side whose scatterers may echo in the window
const uint SLOTS = SCATTER_BIN / SCATTER_SLOT;    // per bin
const int SLOTS_BESIDE = BESIDE * int(SLOTS);
const float LEVEL_UNIT = 65536.0;         // integers per unit of level, for comparisons
const int SILENT = -0x40000000;

shared int echoes[2u * SCATTER_WINDOW];
shared int loudest[(BINS + 2u * uint(BESIDE)) * SLOTS];   // largest level per slot of all segments of the scanline; also beside the window
shared uint line_end[MAX_ELEVATION_LAYERS];   // number of segments of the scanline in all layers up to each one
shared uint work_at[THREADS];       // indices of some segments,
shared uint work_end[THREADS];      // and the number of items of work up to each of them
shared uint shared_candidates;
shared uint shared_deposits;

uint window_begin;

#include "stretch.glsl"

Stretch texture_stretch(uint at) {
    Stretch s = world_stretch(at);
    s.o = texture_point(s.instance, s.o);
    s.d = texture_vector(s.instance, s.d);
    s.e_l = texture_vector(s.instance, s.e_l);
    s.e_e = texture_vector(s.instance, s.e_e);
    return s;
}

bool flows(Stretch s) { return FLOWING && flow_of(s.instance) != 0u; }
bool deforms(Stretch s) { return DEFORMING && (field_of(s.instance) != NONE || flows(s)); }

// True if the dispatch hears the stretch.
bool heard(Stretch s) {
    return sounds(s) && (push.part & (flows(s) ? PART_FLOWING : PART_STILL)) != 0u;
}

// Parts of a bin that are searched one by one: in deformed tissue, several.
uint items_of(Stretch s) { return deforms(s) ? SCATTER_BIN / frame.piece : 1u; }

// The slab of a layer about its middle, mm. Borders of layers avoid the round numbers at which cells have their
// centres: by rounding a cell could belong to two layers or to none.
vec2 slab_of() { return (vec2(-1.0, 1.0) + 2.0 * POINT_SHIFT) * frame.elevation_reach; }

#include "lattice.glsl"

// Adds to a sample of the window; returns 1 if the value is too large.
uint deposit_at(int slot, vec2 v) {
    if (slot >= 0 && slot < int(min(SCATTER_WINDOW, frame.samples - window_begin))) {
        vec2 held = clamp(v, vec2(-ECHO_LIMIT), vec2(ECHO_LIMIT));
        atomicAdd(echoes[2 * slot], whole_large(floor(held.x + 0.5)));
        atomicAdd(echoes[2 * slot + 1], whole_large(floor(held.y + 0.5)));
    }
    return uint(!(max(abs(v.x), abs(v.y)) < ECHO_LIMIT));
}

// Adds a scatterer's echo to the sample nearest to it. About halfway between two samples each gets a share, so that
// rounding of the place has little effect. Returns the number of samples for which the value is too large.
uint deposit_near(float kappa, vec2 v) {
    float before = floor(clamp(kappa, -1e6, 1e6));
    float share = clamp(0.5 - (kappa - before - 0.5) / SAMPLE_BLEND, 0.0, 1.0);
    int slot = whole(before) - int(window_begin);
    if (share == 0.0) {
        slot += 1;
        share = 1.0;
    }
    // A loop, so that no time is spent if no thread of a group has a second share.
    uint saturated = 0u;
    for (int i = 0; i < 2 && share > 0.0; ++i) {
        saturated += deposit_at(slot + i, share * v);
        share = 1.0 - share;
    }
    return saturated;
}

// True if the strip is a narrow beam's, of which no other scanline hears scatterers.
bool is_narrow(uint row) { return rows[row].strip_core < 0.0; }

// Half the strip's width at distance x, whose row is given, mm; 0 where the whole layer lies beyond the beam's edge in elevation.
// A narrow beam's section is an ellipse, of which the edge of the layer nearest to the middle is taken.
float half_width(Stretch s, uint row, float x) {
    vec4 shape = rows[row].shape;
    float nearest = max(abs(s.layer_y) - frame.elevation_reach, 0.0) / frame.elevation_cut;
    float within = 1.0 - INVERSE_FALL * shape.y * nearest * nearest;
    if (!(within > 0.0)) return 0.0;
    return shape.x * strip_ratio(s, x) * (is_narrow(row) ? sqrt(within) : 1.0);
}

// Lattice level wanted at distance x, whose row is given. A narrow beam that is wider needs fewer scatterers; in strips that
// scanlines share they must be the same ones.
float wanted_at(Stretch s, uint row, float x, float drowned) {
    float level = rows[row].shape.w;
    if (is_narrow(row) && level > ALL_LEVELS) level += max(log2(strip_ratio(s, clamp(x, 0.0, s.extent))), 0.0);
    return wanted_level(s.tissue, level, drowned);
}

// How far a scatterer may lie from the middle of its cell, of edge h, in a direction e of the lattice's space.
float jitter(float h, vec3 e) { return 0.5 * h * dot(abs(e), vec3(1.0)); }

// Echoes of the scatterers of one lattice near a stretch, plane by plane. x: range of the distances of crossed planes
// that belong to this work. A cell counts if its centre is within the layer's slab and, of a narrow beam, within its width; its
// scatterer, if it is within the stretch's ends and the strip of others. What varies slowly is that of the place where the axis
// crosses the plane's middle.
uvec3 march_planes(Stretch s, int number, vec2 x, float drowned) {
    Lattice lattice = lattice_of(s.tissue, number);
    Walk walk = walk_of(s.d, s.e_l, s.e_e);
    float h = lattice.edge, inverse_h = lattice.inverse_edge;
    // Lattice coordinates relative to the middle, so that the sums below are small.
    float x_middle = clamp(0.5 * (x.x + x.y), 0.0, s.extent);
    vec3 middle = s.o + x_middle * s.d;
    vec3 nearest = floor(middle * inverse_h);
    vec3 rest = fma(-nearest, vec3(h), middle);
    ivec3 base = ivec3(nearest);
    // From the stretch's own origin, so that bins with a common end divide the planes consistently.
    vec2 ends = clamp(ceil((s.o[walk.a] + x / walk.step) / h - 0.5), -1e6, 1e6);
    ivec2 plane = ivec2(min(ends.x, ends.y), max(ends.x, ends.y)) - base[walk.a];
    plane.y = min(plane.y, plane.x + 1024);

    float depth = tissues[s.tissue].texture_depth;
    float per_mm = samples_per_mm(s);
    float kappa_middle = kappa_at(s, x_middle);
    float turns_middle = 2.0 * frame.frequency * (s.time + x_middle / s.speed);
    turns_middle -= floor(turns_middle);
    float turns_per_mm = 2.0 * frame.frequency / s.speed;
    vec2 slab = slab_of();
    float beside = jitter(h, s.e_l);
    uint span = max(uint(SHAPE_SPAN / frame.sample_pitch), 1u);
    float mm_per_sample = 1.0 / per_mm;
    ivec3 step_a = unit_step(walk.a), step_b = unit_step(walk.b), step_c = unit_step(walk.c);

    uvec3 count = uvec3(0u);
    for (int i = plane.x; i < plane.y; ++i) {
        float da = (float(i) + 0.5) * h - rest[walk.a];
        float ahead = walk.step * da;         // distance from the middle to where the axis crosses the plane
        uint row = row_at(kappa_middle + ahead * per_mm);
        vec4 shape = rows[row].shape;
        float x_plane = x_middle + ahead;
        float power = level_power(wanted_at(s, row, x_plane, drowned), number);
        float width = half_width(s, row, x_plane);
        if (!(power > 0.0) || !(width > 0.0)) continue;

        // Over the plane the beam's shape and the gain vary as a parabola through samples on both sides.
        uint below = row - min(row, span), above = min(row + span, frame.samples - 1u);
        float run = per_mm / max(float(above - below), 1.0);
        vec3 here = shape.xyz, shape_below = rows[below].shape.xyz, shape_above = rows[above].shape.xyz;
        vec3 slope = (shape_above - shape_below) * run;
        vec3 bend = (shape_above + shape_below - 2.0 * here) * mix(0.0, 2.0 * run * run, above - below == 2u * span);
        // The values of a row belong to the middle of its sample.
        float row_ahead = (float(row) + 0.5 - kappa_middle) * mm_per_sample;

        vec3 profile = strip_profile(rows[row].strip_core);
        float reach = is_narrow(row) ? width : 1.05 * width + beside;
        float strength = lattice.amplitude * sqrt(power) * s.weight * thinning(s, x_plane, row) * frame.volume_scale;
        strength *= scattered(s, clamp(x_plane, 0.0, s.extent), row);
        if (depth > 0.0) {
            strength *= 1.0 + depth * tissue_texture((s.o + x_plane * s.d) / tissues[s.tissue].texture_length, tissues[s.tissue].seed);
        }
        float falling = s.absorption * LOG2_E;
        float constant = here.z - s.absorption * LOG2_E * x_middle;

        ivec2 row_range = cells_between(row_ends(walk, da, reach, slab.y), rest[walk.b], inverse_h);
        // Rows and their cells in one loop, so that nearly all threads of a group have a cell in each step.
        int j = row_range.x - 1;
        ivec2 column = ivec2(0);
        while (j < row_range.y) {
            if (column.x >= column.y) {
                j += 1;
                column = columns_between(walk, vec2(da, (float(j) + 0.5) * h - rest[walk.b]), reach, slab, rest[walk.c], inverse_h);
            }
            ivec3 at = i * step_a + j * step_b + column.x * step_c;
            bool counts = column.x < column.y && j < row_range.y;
            column.x += 1;
            uvec3 bits = pcg3d(uvec3(base + at) + lattice.key);
            vec3 rel = (vec3(at) + vec3(unit(bits.x), unit(bits.y), unit(bits.z))) * h - rest;
            float dx = dot(rel, s.d);
            float along = x_middle + dx;
            count.x += uint(counts);
            float off_row = dx - row_ahead;
            vec3 change = off_row * (slope + off_row * bend);
            float ratio = strip_ratio(s, along);
            float off = abs(dot(rel, s.e_l)) / (max(here.x + change.x, LEAST_PITCH) * ratio);
            float share = min(profile.x + (1.0 - off) * profile.y, 1.0);
            // One branch, as many threads of a group have none of it.
            if (!(counts && present(lattice, bits) && along >= 0.0 && along < s.extent && share > 0.0)) continue;
            float up = s.layer_y + dot(rel, s.e_e);
            // An echo on a sample has the gain of the sample's row.
            float off_gain = off_row + 0.5 * mm_per_sample;
            change.z = off_gain * (slope.z + off_gain * bend.z);
            float exponent = constant + change.z - falling * dx - (here.y + change.y) * up * up - profile.z * off * off;
            vec2 v = strength * share * inversesqrt(ratio) * exp2(exponent) * phasor(-(turns_middle + dx * turns_per_mm));
            v *= mix(-1.0, 1.0, (bits.z & 1u) == 0u);
            count.y += 1u;
            count.z += deposit_near(kappa_middle + dx * per_mm, v);
        }
    }
    return count;
}

// Half the strip's width at the wider end of a piece.
float end_width(Stretch s, vec2 x) {
    uvec2 row = uvec2(row_at(kappa_at(s, x.x)), row_at(kappa_at(s, x.y)));
    return max(half_width(s, row.x, x.x), half_width(s, row.y, x.y));
}

// Largest distance along the beam between a cell's scatterer and the crossing of its plane.
float plane_margin(Stretch s, vec2 x, int number) {
    Walk walk = walk_of(s.d, s.e_l, s.e_e);
    float width = end_width(s, x);
    return 0.51 * lattice_edge(number) * (abs(s.d.x) + abs(s.d.y) + abs(s.d.z))
        + (1.2 * width + jitter(lattice_edge(number), s.e_l) + frame.elevation_reach * abs(walk.slant)) * abs(walk.along.y / walk.across.y)
        + frame.elevation_reach * abs(s.d[walk.c] * walk.inverse_c);
}

#include "pieces.glsl"

// Echoes of a stretch in one bin of the window, or beside it.
uvec3 march_bin(Stretch s, int bin, int piece) {
    ivec2 passed = bins_of(s);
    float level = level_in(s, bin);
    uint middle = min(uint(bin) * SCATTER_BIN + SCATTER_BIN / 2u, frame.samples - 1u);
    float black = rows[middle].black;
    if (level < black - UNHEARD) return uvec3(0u);
    // The lowest of the slots' loudest levels in the bin, over the part that the stretch reaches.
    vec2 reached = clamp(vec2(kappa_at(s, 0.0), kappa_at(s, s.extent)) / float(SCATTER_SLOT), -1e6, 1e6);
    int window = int(window_begin / SCATTER_SLOT) - SLOTS_BESIDE;
    int slot = max(whole(floor(reached.x)), bin * int(SLOTS));
    int last_slot = min(min(whole(floor(reached.y)), bin * int(SLOTS) + int(SLOTS) - 1), int((frame.samples - 1u) / SCATTER_SLOT));
    int over = 0x7fffffff;
    for (; slot <= last_slot; ++slot) over = min(over, loudest[slot - window]);
    float drowned = 2.0 * max(max(float(over) / LEVEL_UNIT, black) - level, 0.0);

    uint begin = uint(bin) * SCATTER_BIN;
    uint end = begin + SCATTER_BIN;
    bool field = deforms(s);
    if (field) {
        begin += uint(piece) * frame.piece;
        end = begin + frame.piece;
    }
    vec2 x = vec2(distance_at(s, float(begin)), distance_at(s, float(end)));
    // The first and the last bin also have what lies before the first and behind the last sample.
    bool first = begin == 0u || bin == passed.x && (!field || x.x <= 0.0);
    bool last = end >= frame.samples || bin == passed.y && (!field || x.y >= s.extent);
    x = vec2(mix(max(x.x, 0.0), 0.0, first), mix(min(x.y, s.extent), s.extent, last));
    if (!(x.y > x.x)) return uvec3(0u);

    // Levels that some plane may need. Between the rows looked up they differ by a twentieth of a level at most.
    // Where paths cross, a strip is narrowest between them.
    bool crosses = (s.strip.x + x.x * s.strip.y) * (s.strip.x + x.y * s.strip.y) < 0.0;
    float lowest = 1e9, highest = -1e9;
    int spans = clamp(whole(ceil(min((x.y - x.x) / LEVEL_SPAN, 64.0))), 2, 64);
    for (int i = 0; i <= spans; ++i) {
        float there = mix(x.x, x.y, float(i) / float(spans));
        uint row = row_at(kappa_at(s, there));
        float wanted = wanted_at(s, row, there, drowned);
        lowest = min(lowest, crosses ? wanted_level(s.tissue, rows[row].shape.w, drowned) : wanted);
        highest = max(highest, wanted);
    }
    int number = whole(floor(max(lowest - 0.05, 0.0)));
    int coarsest = whole(floor(min(highest + 0.05 + LEVEL_FADE, float(LATTICE_LEVELS))));
    uvec3 count = uvec3(0u);
    if (field) return march_generations(s, ivec2(number, coarsest), x, drowned);
    for (; number <= coarsest; ++number) {
        // Planes that are crossed beyond the ends may have scatterers within them.
        float margin = plane_margin(s, x, number);
        count += march_planes(s, number, x + margin * mix(vec2(0.0), vec2(-1.0, 1.0), bvec2(first, last)), drowned);
    }
    return count;
}

#include "points.glsl"

// Index of segment i of those of all the scanline's lines.
uint stretch_at(uint scanline, uint i) {
    uint layer = 0u;
    while (i >= line_end[layer]) layer += 1u;
    uint before = layer == 0u ? 0u : line_end[layer - 1u];
    return (layer * frame.scanlines + scanline) * frame.segment_capacity + i - before;
}

// First item of work and number of items: samples, or bins (in deformed tissue pieces of bins) of the
// window, and of those beside it.
ivec2 work_of(Stretch s, bool voxel) {
    if (voxel) {
        int first = max(int(ceil(clamp(kappa_at(s, 0.0), -1.0, 1e6))), int(window_begin)) - int(window_begin);
        int last = min(int(ceil(clamp(kappa_at(s, s.extent), 0.0, 1e6))), int(window_begin + SCATTER_WINDOW) + 1);
        return ivec2(first + int(window_begin), max(last - first - int(window_begin), 0));
    }
    ivec2 passed = bins_of(s);
    int window = int(window_begin / SCATTER_BIN);
    if (deforms(s)) {
        // A piece has the scatterers that lie in it, and only those nearest to its end echo behind it.
        int items = int(items_of(s)), piece = int(frame.piece);
        int first = max(passed.x * items, (max(int(window_begin), first_heard) - 1) / piece);
        int last = min(passed.y * items + items - 1, min(int(window_begin + SCATTER_WINDOW) - 1, last_heard) / piece);
        return ivec2(first, max(last - first + 1, 0));
    }
    int first = max(passed.x, max(window, first_heard / int(SCATTER_BIN)) - BESIDE);
    int last = min(passed.y, min(window + int(BINS) - 1, last_heard / int(SCATTER_BIN)) + BESIDE);
    return ivec2(first, max(last - first + 1, 0));
}

void main() {
    uint scanline = frame.echo_first + gl_WorkGroupID.x;
    uint thread = gl_LocalInvocationID.x;
    window_begin = gl_WorkGroupID.z * SCATTER_WINDOW;
    bool voxel = (frame.flags & FLAG_VOXEL) != 0u;
    uint chunks = gl_NumWorkGroups.y;
    if (!echoes_wanted(scanline) || window_begin + SCATTER_WINDOW <= frame.first_sample) return;

    for (uint i = thread; i < 2u * SCATTER_WINDOW; i += THREADS) echoes[i] = 0;
    for (uint i = thread; i < (BINS + 2u * uint(BESIDE)) * SLOTS; i += THREADS) loudest[i] = SILENT;
    for (uint i = thread; i < frame.layers; i += THREADS) {
        line_end[i] = min(segment_count[i * frame.scanlines + scanline], frame.segment_capacity);
    }
    barrier();
    if (thread == 0u) {
        shared_candidates = 0u;
        shared_deposits = 0u;
        begin_heard();
        for (uint i = 1u; i < frame.layers; ++i) line_end[i] += line_end[i - 1u];
    }
    barrier();
    find_heard(scanline, thread, THREADS);
    uint available = line_end[frame.layers - 1u];

    // Masking: the level of the loudest stretch in each slot, of all layers, for the bins that may echo in what is heard.
    // If there are few stretches, several threads share one.
    ivec2 asked = (ivec2(first_heard, last_heard) / int(SCATTER_BIN) + ivec2(-BESIDE, BESIDE + 1)) * int(SLOTS);
    uint sharing = THREADS / clamp(available, 1u, THREADS);
    for (uint i = thread / sharing; i < available && !voxel; i += THREADS / sharing) {
        Stretch s = world_stretch(stretch_at(scanline, i));
        ivec2 filled = sounds(s) ? slots_of(s) : ivec2(0, -1);
        int window = int(window_begin / SCATTER_SLOT) - SLOTS_BESIDE;
        int last = min(min(filled.y, asked.y - 1), window + int(BINS * SLOTS) + 2 * SLOTS_BESIDE - 1);
        for (int slot = max(max(filled.x, asked.x), window) + int(thread % sharing); slot <= last; slot += int(sharing)) {
            float level = level_at(s, distance_at(s, (float(slot) + 0.5) * float(SCATTER_SLOT)));
            atomicMax(loudest[slot - window], whole_large(clamp(floor(level * LEVEL_UNIT), float(SILENT), 1e9)));
        }
    }
    barrier();

    uint mine = gl_WorkGroupID.y < available ? (available - gl_WorkGroupID.y + chunks - 1u) / chunks : 0u;
    if (thread == 0u && gl_WorkGroupID.z == 0u && mine > 0u) atomicAdd(counters.segments, mine);
    for (uint batch = 0u; batch < mine; batch += THREADS) {
        uvec3 count = uvec3(0u);
        uint size = min(THREADS, mine - batch);
        if (thread < size) {
            uint at = stretch_at(scanline, gl_WorkGroupID.y + (batch + thread) * chunks);
            Stretch s = world_stretch(at);
            work_at[thread] = at;
            work_end[thread] = heard(s) ? uint(max(work_of(s, voxel).y, 0)) : 0u;
        }
        barrier();
        if (thread == 0u) {
            for (uint i = 1u; i < size; ++i) work_end[i] += work_end[i - 1u];
        }
        barrier();
        uint total = work_end[size - 1u];
        uint owner = 0u;
        for (uint item = thread; item < total; item += THREADS) {
            while (item >= work_end[owner]) owner += 1u;
            Stretch s = texture_stretch(work_at[owner]);
            int index = work_of(s, voxel).x + int(item - (owner == 0u ? 0u : work_end[owner - 1u]));
            if (voxel) {
                count += march_sample(s, index);
            } else {
                int items = int(items_of(s));
                count += march_bin(s, index / items, index % items);
            }
        }
        for (uint i = 0u; i < size && frame.points > 0u && (push.part & PART_STILL) != 0u; ++i) {
            Stretch w = world_stretch(work_at[i]);
            uint groups = is_finite(w) ? (frame.points + POINT_GROUP - 1u) / POINT_GROUP : 0u;
            for (uint g = thread; g < groups; g += THREADS) {
                if (!passes_sphere(w, points[frame.points + g])) continue;
                uint end = min((g + 1u) * POINT_GROUP, frame.points);
                for (uint p = g * POINT_GROUP; p < end; ++p) count.z += march_point(w, scanline, points[p]);
            }
        }
        // Inside the loop: naga loses values that two loops carry when they are used after both.
        if (count.x > 0u) { atomicAdd(shared_candidates, count.x); atomicAdd(shared_deposits, count.y); }
        if (count.z > 0u) atomicAdd(counters.saturated, count.z);
        barrier();
    }
    barrier();

    uint base = 2u * (scanline * frame.samples + window_begin);
    uint end = 2u * min(SCATTER_WINDOW, frame.samples - min(window_begin, frame.samples));
    for (uint i = thread; i < end; i += THREADS) {
        int v = echoes[i];
        if (v != 0) atomicAdd(volume_echoes[base + i], v);
    }
    if (thread == 0u && shared_candidates > 0u) {
        atomicAdd(counters.candidates, shared_candidates);
        atomicAdd(counters.deposits, shared_deposits);
    }
}
