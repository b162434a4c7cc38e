#version 460
// Echoes of scatterers and point targets along the segments of one line. One workgroup owns one
// (line, chunk of its segments, window of samples) and gathers in shared memory, so that global
// atomics happen once per sample. Threads work across lattice planes (or samples, in voxel mode).
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 4) readonly buffer PointBuffer { vec4 points[]; };
layout(std430, binding = 5) readonly buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 6) readonly buffer SegmentCountBuffer { uint segment_count[]; };
layout(std430, binding = 7) buffer VolumeEchoBuffer { int volume_echoes[]; };
layout(std430, binding = 8) buffer CounterBuffer { Counters counters; };
layout(std430, binding = 9) readonly buffer FieldBuffer { float fields[]; };
layout(std430, binding = 10) readonly buffer ScanlineBuffer { Scanline scanlines[]; };

// Whether any instance's tissue deforms; without it the kernel is smaller.
layout(constant_id = 0) const bool DEFORMING = true;

#include "transform.glsl"
#include "probe.glsl"
#include "field.glsl"
#include "texture.glsl"
#include "deposit.glsl"

const uint THREADS = 128u;
const uint WINDOW = 2048u;   // samples per workgroup: 16 KiB of shared memory
const float POINT_SHIFT = 0.01234;   // of a layer's pitch
const uint BATCH = 32u;      // segments whose work is shared out at once

shared int echoes[2u * WINDOW];
shared uint work_end[BATCH];
shared uint shared_candidates;
shared uint shared_deposits;

uint window_begin;
float layer_y;               // elevation of this line's layer, mm

// A segment in the frame of its scatterers.
struct Stretch {
    vec3 o; vec3 d; vec3 e_l; vec3 e_e;
    float extent; float time; float weight;
    vec3 spread; float share;
    float speed; float absorption;
    vec2 off;            // distance from the geometric scanline, mm: at the start and per mm
    uint tissue; uint instance;
};

Stretch world_stretch(uint at) {
    Stretch s;
    vec4 a = segments[at].origin_length;
    vec4 b = segments[at].direction_time;
    vec4 c = segments[at].lateral_weight;
    vec4 w = segments[at].spread;
    s.o = a.xyz;
    s.extent = a.w;
    s.d = b.xyz;
    s.time = b.w;
    s.e_l = c.xyz;
    s.weight = c.w;
    s.e_e = segments[at].handedness * cross(s.d, s.e_l);
    s.spread = w.xyz;
    s.share = w.w;
    s.tissue = segments[at].tissue;
    s.instance = segments[at].instance;
    s.speed = tissues[s.tissue].speed;
    s.absorption = tissues[s.tissue].absorption;
    s.off = vec2(0.0);
    if (frame.beam_width > 0.0) {
        uint line = segments[at].line;
        vec3 o, d, lateral;
        probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
        s.off = vec2(dot(probe_point(s.o) - o, lateral), dot(probe_vector(s.d), lateral));
    }
    return s;
}

Stretch texture_stretch(uint at) {
    Stretch s = world_stretch(at);
    s.o = texture_point(s.instance, s.o);
    s.d = texture_vector(s.instance, s.d);
    s.e_l = texture_vector(s.instance, s.e_l);
    s.e_e = texture_vector(s.instance, s.e_e);
    return s;
}

float kappa_at(Stretch s, float x) {
    return frame.speed * (s.time + x / s.speed) / frame.sample_pitch;
}

uint row_at(float kappa) {
    return uint(clamp(floor(kappa), 0.0, float(frame.samples - 1u)));
}

// A stretch with a number that is none has no echoes. NaN fails every comparison.
bool is_finite(Stretch s) {
    return abs(s.extent) < 1e18 && abs(s.time) < 1e18
        && all(lessThan(abs(s.o), vec3(1e18))) && all(lessThan(abs(s.d), vec3(2.0)));
}

// What a rough reflection spreads over many resolution cells averages down; what lies off the
// scanline is heard less.
float thinning(Stretch s, float x, float sigma_l, float sigma_e) {
    float variance = s.spread.x + x * (2.0 * s.spread.y + x * s.spread.z);
    float beam = beam_weight(s.off.x + x * s.off.y);
    if (variance <= 0.0) return beam;
    float cells = sqrt((1.0 + variance / (sigma_l * sigma_l)) * (1.0 + variance / (sigma_e * sigma_e)));
    return beam * min(1.0, sqrt(s.share / cells));
}

void deposit(float kappa, float time, float amplitude, bool point) {
    float base = floor(kappa);
    vec2 q = amplitude * carrier(time);
    for (int i = 0; i < 2; ++i) {
        float at = base + float(i);
        if (!(at >= 0.0 && at < float(frame.samples))) continue;
        uint k = uint(at);
        uint slot = k - window_begin;
        if (slot >= WINDOW) continue;
        float gain = point ? rows[k].point_gain : rows[k].volume_gain;
        vec2 v = q * gain * (i == 0 ? 1.0 - (kappa - base) : kappa - base);
        atomicAdd(echoes[2u * slot], to_fixed(v.x, frame.volume_scale, 0.5));
        atomicAdd(echoes[2u * slot + 1u], to_fixed(v.y, frame.volume_scale, 0.5));
    }
}

bool present(uvec4 bits, float presence) {
    uint low = ((bits.x & 255u) << 16u) | ((bits.y & 255u) << 8u) | (bits.z & 255u);
    return float(low) * (1.0 / 16777216.0) < presence;
}

// Brings the dominant axis to x, keeping the order cyclic, and back.
vec3 turn(vec3 v, uint axis) { return axis == 0u ? v : (axis == 1u ? v.yzx : v.zxy); }
ivec3 turn_back(ivec3 v, uint axis) { return axis == 0u ? v : (axis == 1u ? v.zxy : v.yzx); }

uint dominant_axis(vec3 d) {
    vec3 a = abs(d);
    return a.x >= a.y && a.x >= a.z ? 0u : (a.y >= a.z ? 1u : 2u);
}

// Part of a segment that can reach this window's samples, one sample of margin.
vec2 window_extent(Stretch s) {
    float per_sample = frame.sample_pitch / frame.speed * s.speed;
    float x0 = ((float(window_begin) - 1.0) * frame.sample_pitch / frame.speed - s.time) * s.speed;
    float x1 = x0 + (float(WINDOW) + 2.0) * per_sample;
    return vec2(max(x0, 0.0), min(x1, s.extent));
}

// Half thickness, along the dominant axis, of what the beam may reach at distance x.
float plane_margin(Stretch s, float x, float el_a, float ee_a) {
    float sigma = max(rows[row_at(kappa_at(s, x))].sigma_lateral, rows[row_at(kappa_at(s, x) + 40.0)].sigma_lateral);
    return 1.05 * frame.lateral_cut * sigma * abs(el_a) + frame.elevation_reach * abs(ee_a);
}

// First lattice plane and number of planes of a stretch.
ivec2 lattice_planes(Stretch s) {
    vec2 x = window_extent(s);
    if (!(x.y > x.x)) return ivec2(0);
    uint axis = dominant_axis(s.d);
    float o = turn(s.o, axis).x, d = turn(s.d, axis).x;
    float el = turn(s.e_l, axis).x, ee = turn(s.e_e, axis).x;
    float a = o + x.x * d, b = o + x.y * d;
    float margin_a = plane_margin(s, x.x, el, ee), margin_b = plane_margin(s, x.y, el, ee);
    float low = d > 0.0 ? a - margin_a : b - margin_b;
    float high = d > 0.0 ? b + margin_b : a + margin_a;
    int first = int(floor(low / frame.cell));
    return ivec2(first, int(floor(high / frame.cell)) - first + 1);
}

// Echo of a scatterer at `rel` from the stretch's origin, if it is within the beam and, along it, `within`.
bool hear(Stretch s, vec3 rel, uint bits, float factor, vec2 within) {
    float rho_e = dot(rel, s.e_e);
    if (abs(rho_e) > frame.elevation_reach) return false;
    float x = dot(rel, s.d);
    if (!(x >= within.x && x < within.y)) return false;
    float rho_l = dot(rel, s.e_l);
    float time = s.time + x / s.speed;
    float at = frame.speed * time / frame.sample_pitch;
    uint row = row_at(at);
    float sigma_l = rows[row].sigma_lateral;
    if (abs(rho_l) > frame.lateral_cut * sigma_l) return false;
    float sigma_e = rows[row].sigma_elevation;
    float l = rho_l / sigma_l;
    float e = (layer_y + rho_e) / sigma_e;
    float amplitude = factor * exp(-0.5 * (l * l + e * e) - s.absorption * x)
        * thinning(s, x, sigma_l, sigma_e)
        * (tissues[s.tissue].mean + tissues[s.tissue].sigma * gaussian(bits));
    deposit(at, time, amplitude, false);
    return true;
}

// All scatterers of one lattice plane that the beam reaches.
uvec2 march_plane(Stretch s, int plane, vec2 within) {
    uint axis = dominant_axis(s.d);
    vec3 o = turn(s.o, axis), d = turn(s.d, axis), el = turn(s.e_l, axis), ee = turn(s.e_e, axis);
    float h = frame.cell;
    float middle = (float(plane) + 0.5) * h;
    float x_middle = (middle - o.x) / d.x;

    float sigma = rows[row_at(kappa_at(s, x_middle))].sigma_lateral;
    float reach = (0.5 * h + 1.2 * frame.lateral_cut * sigma * abs(el.x) + frame.elevation_reach * abs(ee.x)) / abs(d.x);
    sigma = max(sigma, max(rows[row_at(kappa_at(s, x_middle - reach))].sigma_lateral,
                           rows[row_at(kappa_at(s, x_middle + reach))].sigma_lateral));
    float lateral_reach = frame.lateral_cut * sigma;
    if (x_middle + reach < within.x || x_middle - reach > within.y) return uvec2(0u);

    float presence = tissues[s.tissue].presence;
    uint seed = tissues[s.tissue].seed;
    float depth = tissues[s.tissue].texture_depth;
    float factor = s.weight;
    if (depth > 0.0) {
        vec3 crossing = s.o + x_middle * s.d;
        factor *= 1.0 + depth * tissue_texture(crossing / tissues[s.tissue].texture_length, seed);
    }

    // The beam's cross-section seen along d on the plane: centre and oblique axes in (y, z).
    vec2 slope = d.yz / d.x;
    vec2 u_l = el.yz - el.x * slope;
    vec2 u_e = ee.yz - ee.x * slope;
    vec2 centre = o.yz + slope * (middle - o.x);
    bool swap = abs(u_l.y) > abs(u_l.x);
    if (swap) { slope = slope.yx; u_l = u_l.yx; u_e = u_e.yx; centre = centre.yx; }
    float kappa = u_l.y / u_l.x;
    float half_row = abs(slope.x) * 0.5 * h + lateral_reach * abs(u_l.x) + frame.elevation_reach * abs(u_e.x);
    float half_column = 0.5 * h * (abs(kappa) + abs(slope.y - kappa * slope.x))
        + frame.elevation_reach * abs(u_e.y - kappa * u_e.x);
    float inverse_h = 1.0 / h;
    int row_first = int(floor((centre.x - half_row) * inverse_h));
    int row_last = int(floor((centre.x + half_row) * inverse_h));

    uvec2 count = uvec2(0u);
    for (int r = row_first; r <= row_last; ++r) {
        float column = centre.y + kappa * ((float(r) + 0.5) * h - centre.x);
        int column_first = int(floor((column - half_column) * inverse_h));
        int column_last = int(floor((column + half_column) * inverse_h));
        for (int c = column_first; c <= column_last; ++c) {
            count.x += 1u;
            ivec3 cell = turn_back(swap ? ivec3(plane, c, r) : ivec3(plane, r, c), axis);
            uvec4 bits = pcg4d(uvec4(uvec3(cell), seed));
            if (!present(bits, presence)) continue;
            vec3 p = (vec3(cell) + vec3(unit(bits.x), unit(bits.y), unit(bits.z))) * h;
            vec3 rel = p - s.o;
            if (!hear(s, rel, bits.w, factor, vec2(0.0, s.extent))) continue;
            count.y += 1u;
        }
    }
    return count;
}

#include "pieces.glsl"

// Whole samples inside a stretch: first and number (voxel mode).
ivec2 voxel_samples(Stretch s) {
    vec2 x = window_extent(s);
    if (!(x.y > x.x)) return ivec2(0);
    int first = int(ceil(kappa_at(s, x.x)));
    return ivec2(first, int(ceil(kappa_at(s, x.y))) - first);
}

// One equally spaced sample looked up in the voxel grid; the jitter hides the grid from the carrier.
uvec2 march_sample(Stretch s, int k) {
    float x = (float(k) * frame.sample_pitch / frame.speed - s.time) * s.speed;
    vec3 p = s.o + x * s.d;
    if (deforms(s)) p = reference_point(load_field(field_of(s.instance)), p);
    ivec3 cell = ivec3(floor(p / frame.cell));
    uint seed = tissues[s.tissue].seed;
    uvec4 bits = pcg4d(uvec4(uvec3(cell), seed));
    if (!present(bits, tissues[s.tissue].presence)) return uvec2(1u, 0u);
    float kappa = float(k) + unit(bits.x) - 0.5;
    uint row = row_at(float(k));
    float sigma_e = rows[row].sigma_elevation;
    float e = layer_y / sigma_e;
    float factor = 1.0;
    if (tissues[s.tissue].texture_depth > 0.0) {
        factor += tissues[s.tissue].texture_depth * tissue_texture(p / tissues[s.tissue].texture_length, seed);
    }
    float amplitude = s.weight * factor * exp(-0.5 * e * e - s.absorption * x)
        * thinning(s, x, rows[row].sigma_lateral, sigma_e)
        * (tissues[s.tissue].mean + tissues[s.tissue].sigma * gaussian(bits.w));
    deposit(kappa, kappa * frame.sample_pitch / frame.speed, amplitude, false);
    return uvec2(1u);
}

void march_point(Stretch s, vec4 point) {
    if (!is_finite(s)) return;
    vec3 rel = point.xyz - s.o;
    float x = dot(rel, s.d);
    if (!(x >= 0.0 && x < s.extent)) return;
    float rho_e = dot(rel, s.e_e);
    // Layers meet off the round numbers at which points lie: rounding must not give one to two, or none.
    float pitch = frame.slice_thickness / float(frame.layers);
    float height = rho_e - POINT_SHIFT * pitch;
    if (!(height >= -0.5 * pitch && height < 0.5 * pitch)) return;
    float rho_l = dot(rel, s.e_l);
    float time = s.time + x / s.speed;
    float at = frame.speed * time / frame.sample_pitch;
    uint row = row_at(at);
    float sigma_l = rows[row].sigma_lateral, sigma_e = rows[row].sigma_elevation;
    float l = rho_l / sigma_l;
    if (abs(l) > 4.0) return;
    float e = (layer_y + rho_e) / sigma_e;
    deposit(at, time, s.weight * point.w * exp(-0.5 * (l * l + e * e) - s.absorption * x) * thinning(s, x, sigma_l, sigma_e), true);
}

// First item of work and number of items: samples, pieces or lattice planes.
ivec2 work_of(Stretch s, bool voxel) {
    if (voxel) return voxel_samples(s);
    return deforms(s) ? field_pieces(s) : lattice_planes(s);
}

void main() {
    uint line = gl_WorkGroupID.x;
    uint thread = gl_LocalInvocationID.x;
    uint lines = frame.scanlines * frame.layers;
    uint available = line < lines ? min(segment_count[line], frame.segment_capacity) : 0u;
    window_begin = gl_WorkGroupID.z * WINDOW;
    uint layer = line / frame.scanlines;
    layer_y = elevation(layer);
    bool voxel = (frame.flags & FLAG_VOXEL) != 0u;

    uint chunks = gl_NumWorkGroups.y;
    uint mine = gl_WorkGroupID.y < available ? (available - gl_WorkGroupID.y + chunks - 1u) / chunks : 0u;
    // Where nothing is heard there is nothing to gather.
    if (mine == 0u) return;

    for (uint i = thread; i < 2u * WINDOW; i += THREADS) echoes[i] = 0;
    if (thread == 0u) { shared_candidates = 0u; shared_deposits = 0u; }
    barrier();

    uvec2 count = uvec2(0u);
    for (uint batch = 0u; batch < mine; batch += BATCH) {
        uint size = min(BATCH, mine - batch);
        if (thread < size) {
            uint at = line * frame.segment_capacity + gl_WorkGroupID.y + (batch + thread) * chunks;
            Stretch s = texture_stretch(at);
            bool scatters = tissues[s.tissue].presence > 0.0 && is_finite(s);
            work_end[thread] = !scatters ? 0u : uint(max(work_of(s, voxel).y, 0));
        }
        barrier();
        if (thread == 0u) {
            for (uint i = 1u; i < size; ++i) work_end[i] += work_end[i - 1u];
        }
        barrier();
        uint total = work_end[size - 1u];
        uint owner = 0u, loaded = NONE;
        Stretch s;
        int first = 0;
        vec2 within = vec2(0.0);
        for (uint item = thread; item < total; item += THREADS) {
            while (item >= work_end[owner]) owner += 1u;
            if (loaded != owner) {
                s = texture_stretch(line * frame.segment_capacity + gl_WorkGroupID.y + (batch + owner) * chunks);
                first = work_of(s, voxel).x;
                within = window_extent(s);
                loaded = owner;
            }
            int index = first + int(item - (owner == 0u ? 0u : work_end[owner - 1u]));
            if (voxel) count += march_sample(s, index);
            else if (deforms(s)) count += march_piece(s, index);
            else count += march_plane(s, index, within);
        }
        for (uint i = 0u; i < size && frame.points > 0u; ++i) {
            Stretch w = world_stretch(line * frame.segment_capacity + gl_WorkGroupID.y + (batch + i) * chunks);
            for (uint p = thread; p < frame.points; p += THREADS) march_point(w, points[p]);
        }
        barrier();
    }
    if (count.x > 0u) { atomicAdd(shared_candidates, count.x); atomicAdd(shared_deposits, count.y); }
    barrier();

    uint base = 2u * ((line % frame.scanlines) * frame.samples + window_begin);
    uint end = 2u * min(WINDOW, frame.samples - min(window_begin, frame.samples));
    for (uint i = thread; i < end && line < lines; i += THREADS) {
        int v = echoes[i];
        if (v != 0) atomicAdd(volume_echoes[base + i], v);
    }
    if (thread == 0u && shared_candidates > 0u) {
        atomicAdd(counters.candidates, shared_candidates);
        atomicAdd(counters.deposits, shared_deposits);
        atomicAdd(counters.segments, mine);
    }
}
