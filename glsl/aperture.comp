#version 460
// The aperture's way to a target. A target is lit and heard by an aperture that converges on it; the rays from there cross the
// paths of neighbouring scanlines, lose what these lose there, and are turned as these are. One thread has LEVEL_STEP scanlines, at
// some of the nodes of depth.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 2) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 3) restrict buffer ApertureBuffer { Aperture apertures[]; };

#include "probe.glsl"
#include "aperture.glsl"

const uint THREADS = 64u;
const float BAND_COUNT = float(APERTURE_BANDS);
const uint WORDS = 16u;
// Beyond as many pairs of neighbours two share a bit, or four, or eight: MAX_SCANLINES is eight times that.
const uint PAIRS = 32u * WORDS;

// For each band a bit for each pair of neighbouring scanlines that lose differently,
shared uint unlike[APERTURE_BANDS * WORDS];
// and for each that turn rays differently.
shared uint turning[APERTURE_BANDS * WORDS];
// For each scanline the first node behind a surface that lets hardly anything through, four to a word.
shared uint fronts[MAX_SCANLINES / 4u];
// A bit for each node that is one.
shared uint front_nodes[APERTURE_BANDS / 32u + 1u];

// Nepers that the main path of scanline l of a layer has lost down to a node.
float lost_at(uint layer, int l, uint node) { return apertures[node_at(layer, uint(l), node)].lost; }

// What it loses between two nodes; UNKNOWN where it was not followed.
float lost_between(float above, float below) { return mix(below - above, UNKNOWN, min(above, below) <= UNKNOWN); }

float lost_in(uint layer, int l, uint begin, uint end) {
    return lost_between(lost_at(layer, l, begin), lost_at(layer, l, end));
}

// Sine by which it turns rays in a band.
float bent_in(uint layer, int l, uint band) { return apertures[node_at(layer, uint(l), band + 1u)].bent; }

// The same `lines` beside scanline l, between two. Rounded alike wherever the frame's first scanline is.
float bent_beside(uint layer, int l, float lines, uint band) {
    float low = floor(clamp(lines, -1e6, 1e6));
    int last = int(frame.scanlines) - 1, at = l + whole(low);
    return mix(bent_in(layer, clamp(at, 0, last), band), bent_in(layer, clamp(at + 1, 0, last), band), min(lines - low, 1.0));
}

// Bit of the pair of scanline l and the next.
uint bit_of(int l) {
    return uint(l) >> (uint(frame.scanlines > PAIRS) + uint(frame.scanlines > 2u * PAIRS) + uint(frame.scanlines > 4u * PAIRS));
}

void keep(uint word, uvec2 found) {
    unlike[word] = found.x;
    turning[word] = found.y;
}

void find_unlike(uint layer, uint band) {
    uint at = 0u;
    uvec2 found = uvec2(0u);
    vec2 before = vec2(lost_in(layer, 0, band, band + 1u), bent_in(layer, 0, band));
    for (int l = 1; l < int(frame.scanlines); ++l) {
        uint bit = bit_of(l - 1);
        if (bit >> 5u != at) {
            keep(band * WORDS + at, found);
            found = uvec2(0u);
            at = bit >> 5u;
        }
        vec2 beside = vec2(lost_in(layer, l, band, band + 1u), bent_in(layer, l, band));
        // NaN, too, is unlike.
        bvec2 alike = lessThanEqual(abs(beside - before), vec2(APERTURE_ALIKE, BENT_ALIKE));
        found |= mix(uvec2(1u << (bit & 31u)), uvec2(0u), alike);
        before = beside;
    }
    keep(band * WORDS + at, found);
}

// Not 0 in x if neighbours from the first scanline to the last lose differently in a band, in y if they turn rays differently.
uvec2 differs(int first, int last, uint band) {
    uint low = bit_of(first), high = bit_of(last - 1);
    uvec2 found = uvec2(0u);
    for (uint word = low >> 5u; word <= high >> 5u; ++word) {
        uint mask = 0xffffffffu << (word == low >> 5u ? low & 31u : 0u);
        mask &= 0xffffffffu >> (word == high >> 5u ? 31u - (high & 31u) : 0u);
        found |= mask & uvec2(unlike[band * WORDS + word], turning[band * WORDS + word]);
    }
    return found;
}

// The first node behind such a surface; beyond all nodes where there is none.
uint find_front(uint layer, int l) {
    float above = lost_at(layer, l, 0u);
    for (uint node = 1u; node <= APERTURE_BANDS; ++node) {
        float below = lost_at(layer, l, node);
        if (lost_between(above, below) > APERTURE_FRONT) return node;
        above = below;
    }
    return 255u;
}

uint front_of(int l) { return fronts[l >> 2] >> (8u * uint(l & 3)) & 255u; }

// True if a ray crosses such a surface from a node of scanline `above` to a lower one of scanline `below`: it was in front of
// the one's and is behind the other's, and both are near. An inclined surface is crossed once, whatever bands it lies in; what
// is behind the surface of a neighbour, far below it, has crossed none.
bool crosses_front(int above, uint begin, int below, uint end) {
    uint before = front_of(above), behind = front_of(below);
    uint size = end - begin;
    return begin < before && before <= end + size && behind <= end && behind + size > begin;
}

// Distance of neighbouring scanlines at a depth, in nodes, mm.
float pitch_at(float at) {
    vec2 pitch = line_pitch();
    return max(pitch.x + frame.depth * at / BAND_COUNT * pitch.y, LEAST_PITCH);
}

// Scanlines beside the target's that a ray has crossed at a depth, in nodes, for each mm beside it on the aperture.
float lines_per_mm(float at, uint node) { return (1.0 - at / float(node)) / pitch_at(at); }

// The farther from the target, the more bands at once: where between them something lies matters less.
uint step_above(uint node, uint end) {
    uint away = node - end;
    return end - min(away < 8u ? 1u : (away < 24u ? 2u : 4u), end);
}

// True if some scanline's front lies where a ray could cross it in a step.
bool front_near(uint begin, uint end) {
    uint found = 0u;
    for (uint node = begin + 1u; node <= min(2u * end - begin, APERTURE_BANDS); ++node) {
        found |= front_nodes[node >> 5u] >> (node & 31u) & 1u;
    }
    return found != 0u;
}

// A target, and how its apertures see it.
struct Target {
    uint layer;
    int l;              // scanline
    uint node;
    uint row;           // of the samples
    float spacing;      // of rays on the aperture, mm
    float deviations;   // the same, of the receive aperture
};

// Nepers that each ray loses on its way to the target, over what the scanline's own path does.
float lost[APERTURE_RAYS];
// By how much each ray of the receive aperture misses the target, mm, over what one on that path does; and how much farther
// from the axis there that is which comes from as many deviations beside the axis on the transmit aperture, whose focus is another.
float missed[APERTURE_RAYS];
float aside[APERTURE_RAYS];

// Place of a ray on the aperture, in distances of rays from its middle.
float place_of(uint ray) { return float(ray) + 0.5 * (1.0 - float(APERTURE_RAYS)); }

// Scanlines beside the target's that a ray crosses at a depth, in nodes, for each deviation beside it on the transmit aperture.
float lines_sent(Target target, float at) {
    float way = frame.depth / BAND_COUNT * (float(target.node) - at);
    return (rows[target.row].defocus + rows[target.row].transmit_sine * way) / pitch_at(at);
}

// Adds what rays lose in a step.
void lose(Target target, uint begin, uint end) {
    float middle = float(target.l) + 0.5, last = float(frame.scanlines - 1u);
    float half_way = target.spacing * lines_per_mm(0.5 * float(begin + end), target.node);
    float own = lost_in(target.layer, target.l, begin, end);
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float crossed = clamp(floor(place_of(i) * half_way + middle), 0.0, last);
        float there = lost_in(target.layer, whole(crossed), begin, end);
        lost[i] += mix(there - own, 0.0, min(there, own) <= UNKNOWN);
    }
    if (!front_near(begin, end)) return;
    vec2 ends = target.spacing * vec2(lines_per_mm(float(begin), target.node), lines_per_mm(float(end), target.node));
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        vec2 crossed = clamp(floor(place_of(i) * ends + middle), vec2(0.0), vec2(last));
        lost[i] += mix(0.0, lost_of(0.0), crosses_front(whole(crossed.x), begin, whole(crossed.y), end));
    }
}

// Adds by how much rays miss the target as they are turned in a band.
void turn(Target target, uint band) {
    float at = float(band) + 0.5;
    float way = frame.depth / BAND_COUNT * (float(target.node) - at);
    float received = target.spacing * lines_per_mm(at, target.node), sent = target.deviations * lines_sent(target, at);
    float own = bent_in(target.layer, target.l, band);
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        missed[i] += (bent_beside(target.layer, target.l, place_of(i) * received, band) - own) * way;
        aside[i] += (bent_beside(target.layer, target.l, place_of(i) * sent, band) - own) * way;
    }
}

// Follows the rays from the target up, through what scanlines beside it do differently, and with `bends` as they are turned. False
// if there is nothing like that.
bool follow_rays(Target target, bool bends) {
    for (uint i = 0u; i < APERTURE_RAYS; ++i) lost[i] = missed[i] = aside[i] = 0.0;
    float widest = 0.5 * float(APERTURE_RAYS) * target.spacing, outermost = 0.5 * float(APERTURE_RAYS) * target.deviations;
    bool found = false;
    uint begin;
    for (uint end = target.node; end > 0u; end = begin) {
        begin = step_above(target.node, end);
        vec2 sent = abs(vec2(lines_sent(target, float(begin)), lines_sent(target, float(end))));
        float most = max(widest * lines_per_mm(float(begin), target.node), outermost * max(sent.x, sent.y));
        int reach = whole(ceil(clamp(most, 0.0, 1e6)));
        int low = max(target.l - reach, 0), high = min(target.l + reach, int(frame.scanlines) - 1);
        if (low >= high) continue;
        bool loses = false;
        for (uint band = begin; band < end; ++band) {
            uvec2 different = differs(low, high, band);
            bool turns = bends && different.y != 0u;
            if (turns) turn(target, band);
            loses = loses || different.x != 0u;
            found = found || loses || turns;
        }
        if (loses) lose(target, begin, end);
    }
    return found;
}

// The part of each ray that reaches the target; of those of one Gaussian aperture.
float weights[APERTURE_RAYS];

// Factor on the amplitude of speckle around a target, in nepers, by rays that miss it. A ray of the transmit aperture and one of
// the receive aperture hear together what both meet: the overlap of two Gaussians as wide as a focus, the mean over all pairs of
// rays, over that of rays which nothing bends. Never brighter.
float level_of(Target target) {
    float defocus = rows[target.row].defocus;
    float fall = 1.0 / (rows[target.row].variances - defocus * defocus);
    float most = 0.0;
    for (uint i = 0u; i < APERTURE_RAYS; ++i) most = max(most, max(missed[i] * missed[i], aside[i] * aside[i]) * fall);
    if (most < LEAST_MISSED) return 0.0;
    float sent = 0.0, heard = 0.0, met = 0.0;
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float from = target.deviations * place_of(i);
        weights[i] *= exp(-from * from);
        heard += weights[i];
    }
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float even = defocus * target.deviations * place_of(i);
        sent += weights[i] * exp(-even * even * fall);
        float overlaps = 0.0;
        for (uint j = 0u; j < APERTURE_RAYS; ++j) {
            float apart = even + aside[i] - missed[j];
            overlaps += weights[j] * exp(-apart * apart * fall);
        }
        met += weights[i] * overlaps;
    }
    float level = 0.5 * log(max(met, 1e-30) / max(sent * heard, 1e-30));
    return mix(LEAST_LEVEL, min(level, 0.0), level > LEAST_LEVEL);
}

// Gain and level of a target. The gain: for each of its apertures the mean over its rays of the part that reaches the target,
// over that of its own scanline; of the two-way amplitude that main paths carry, one way has the root.
vec2 converged(uint layer, int l, uint node, uint row, bool bends) {
    vec2 halves = vec2(rows[row].transmit_half, rows[row].receive_half);
    float widest = max(halves.x, halves.y);
    float spacing = 2.0 * widest / float(APERTURE_RAYS);
    float deviations = spacing / max(rows[row].receive_sine * frame.depth * float(node) / BAND_COUNT, LEAST_PITCH);
    Target target = Target(layer, l, node, row, spacing, deviations);
    if (!follow_rays(target, bends)) return vec2(0.0);
    // What would lie beyond the face is no element. A phased array is modelled as a point, its aperture is all there.
    float first = float(frame.first_line) + float(l) + 0.5;
    float at_face = mix(0.0, 1.0 / max(line_pitch().x, LEAST_PITCH), frame.kind != KIND_PHASED);
    vec2 sum = vec2(0.0), count = vec2(0.0);
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float beside = spacing * place_of(i);
        float element = first + beside * at_face;
        bool exists = element >= 0.0 && element <= float(face_lines());
        // The narrower aperture has some of the rays, the outermost in part.
        vec2 share = clamp((halves - abs(beside)) / spacing + 0.5, 0.0, 1.0) * mix(0.0, 1.0, exists);
        float reached = exp(-0.5 * lost[i]);
        weights[i] = mix(0.0, reached, exists);
        if (max(share.x, share.y) <= 0.0) continue;
        sum += share * reached;
        count += share;
    }
    float gain = log(max(sum.x, 1e-30) / count.x) + log(max(sum.y, 1e-30) / count.y);
    return vec2(gain, bends ? level_of(target) : 0.0);
}

// False around masks, where nobody hears the scanline: no main path reaches a place for which a gain or a level of this node is
// interpolated. These lie up to `reach` nodes away, on layers and scanlines fewer than `reach` away.
bool is_heard(uint layer, uint l, uint node, uint reach) {
    if ((frame.flags & FLAG_MASKED) == 0u) return true;
    uvec3 here = uvec3(layer, l, node), most = uvec3(frame.layers - 1u, frame.scanlines - 1u, APERTURE_BANDS);
    uvec3 low = here - min(here, uvec3(reach - 1u)), high = min(here + reach - 1u, most);
    low.z = node - min(node, reach);
    high.z = min(node + reach, APERTURE_BANDS);
    bool reached = false;
    for (uint at = low.x; at <= high.x; ++at) {
        for (uint beside = low.y; beside <= high.y; ++beside) {
            for (uint depth = low.z; depth <= high.z; ++depth) reached = reached || lost_at(at, int(beside), depth) > UNKNOWN;
        }
    }
    return reached;
}

void main() {
    uint thread = gl_LocalInvocationID.x;
    uint layer = gl_WorkGroupID.z;
    if (thread < APERTURE_BANDS / 32u + 1u) front_nodes[thread] = 0u;
    barrier();
    for (uint band = thread; band < APERTURE_BANDS; band += THREADS) find_unlike(layer, band);
    for (uint word = thread; 4u * word < frame.scanlines; word += THREADS) {
        uint packed = 0u;
        for (uint i = 0u; i < 4u; ++i) {
            int l = int(min(4u * word + i, frame.scanlines - 1u));
            uint front = find_front(layer, l);
            if (front <= APERTURE_BANDS) atomicOr(front_nodes[front >> 5u], 1u << (front & 31u));
            packed |= front << (8u * i);
        }
        fronts[word] = packed;
    }
    barrier();
    // Of LEVEL_STEP scanlines of a thread the first has levels: all threads do alike at a time.
    uint first = LEVEL_STEP * (gl_WorkGroupID.x * THREADS + thread) - frame.first_line % LEVEL_STEP;
    for (uint i = 0u; i < LEVEL_STEP; ++i) {
        // Below 0 it is beyond all.
        uint l = first + i;
        if (l >= frame.scanlines) continue;
        for (uint node = gl_WorkGroupID.y; node <= APERTURE_BANDS; node += gl_NumWorkGroups.y) {
            bool bends = i == 0u && node % LEVEL_STEP == 0u && layer % LEVEL_STEP == 0u;
            uint row = sample_at(frame.depth * float(node) / (BAND_COUNT * frame.sample_pitch));
            vec2 found = vec2(0.0);
            if (is_heard(layer, l, node, bends ? LEVEL_STEP : 1u)) found = converged(layer, int(l), node, row, bends);
            uint at = aperture_at(layer * frame.scanlines + l, node);
            apertures[at].gain = found.x;
            apertures[at].level = found.y;
        }
    }
}
