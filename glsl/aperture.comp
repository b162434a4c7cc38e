#version 460
// The aperture's way to a target. A target is lit and heard by an aperture that converges on it; the rays from there cross the
// paths of neighbouring scanlines, lose what these lose there, and are turned as these are. One thread has a scanline, at some of
// the nodes of depth.
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
const uint WORDS = 32u;
// Beyond as many pairs of neighbours two share a bit.
const uint PAIRS = 32u * WORDS;

// For each band a bit for each pair of neighbouring scanlines that lose differently, or turn rays differently.
shared uint unlike[APERTURE_BANDS * WORDS];
// For each scanline the first node behind a surface that lets hardly anything through, four to a word.
shared uint fronts[MAX_SCANLINES / 4u];
// A bit for each node that is one.
shared uint front_nodes[APERTURE_BANDS / 32u + 1u];

uint node_of(uint layer, int l, uint node) { return (layer * (APERTURE_BANDS + 1u) + node) * frame.scanlines + uint(l); }

// Nepers that the main path of scanline l of a layer has lost down to a node.
float lost_at(uint layer, int l, uint node) { return apertures[node_of(layer, l, node)].lost; }

// What it loses between two nodes; UNKNOWN where it was not followed.
float lost_between(float above, float below) { return mix(below - above, UNKNOWN, min(above, below) <= UNKNOWN); }

float lost_in(uint layer, int l, uint begin, uint end) {
    return lost_between(lost_at(layer, l, begin), lost_at(layer, l, end));
}

// Sine by which it turns rays there.
float bent_in(uint layer, int l, uint begin, uint end) {
    return apertures[node_of(layer, l, end)].bent - apertures[node_of(layer, l, begin)].bent;
}

// The same `lines` beside scanline l, between two. Rounded alike wherever the frame's first scanline is.
float bent_between(uint layer, int l, float lines, uint begin, uint end) {
    float low = floor(clamp(lines, -1e6, 1e6));
    int last = int(frame.scanlines) - 1, at = l + whole(low);
    return mix(bent_in(layer, clamp(at, 0, last), begin, end), bent_in(layer, clamp(at + 1, 0, last), begin, end), min(lines - low, 1.0));
}

// Bit of the pair of scanline l and the next.
uint bit_of(int l) { return uint(l) >> (frame.scanlines > PAIRS ? 1u : 0u); }

void find_unlike(uint layer, uint band) {
    uint at = 0u, found = 0u;
    float before = lost_in(layer, 0, band, band + 1u), turned = bent_in(layer, 0, band, band + 1u);
    for (int l = 1; l < int(frame.scanlines); ++l) {
        uint bit = bit_of(l - 1);
        if (bit >> 5u != at) {
            unlike[band * WORDS + at] = found;
            found = 0u;
            at = bit >> 5u;
        }
        float lost = lost_in(layer, l, band, band + 1u), bent = bent_in(layer, l, band, band + 1u);
        // NaN, too, is unlike.
        if (!(abs(lost - before) <= APERTURE_ALIKE && abs(bent - turned) <= BENT_ALIKE)) found |= 1u << (bit & 31u);
        before = lost;
        turned = bent;
    }
    unlike[band * WORDS + at] = found;
}

// True if neighbours from the first scanline to the last differ in some band of a step.
bool differs(int first, int last, uint begin, uint end) {
    uint low = bit_of(first), high = bit_of(last - 1);
    uint found = 0u;
    for (uint word = low >> 5u; word <= high >> 5u; ++word) {
        uint mask = 0xffffffffu << (word == low >> 5u ? low & 31u : 0u);
        mask &= 0xffffffffu >> (word == high >> 5u ? 31u - (high & 31u) : 0u);
        for (uint band = begin; band < end; ++band) found |= unlike[band * WORDS + word] & mask;
    }
    return found != 0u;
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

// Scanlines beside the target's that a ray has crossed at a depth, in nodes, for each mm beside it on the aperture.
float lines_per_mm(float at, uint node) {
    vec2 pitch = line_pitch();
    return (1.0 - at / float(node)) / max(pitch.x + frame.depth * at / BAND_COUNT * pitch.y, LEAST_PITCH);
}

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

// Nepers that each ray loses on its way to the target, over what the scanline's own path does.
float lost[APERTURE_RAYS];
// By how much each ray of the receive aperture misses the target, mm, over what one on that path does; and how far from the axis
// there that is which comes from as many deviations beside the axis on the transmit aperture, whose focus is another.
float missed[APERTURE_RAYS];
float aside[APERTURE_RAYS];

// Scanlines beside the target's that a ray crosses at a depth, in nodes, for each deviation beside it on the transmit aperture.
float lines_sent(uint row, uint node, float at) {
    vec2 pitch = line_pitch();
    float way = frame.depth / BAND_COUNT * (float(node) - at);
    return (rows[row].defocus + rows[row].transmit_sine * way) / max(pitch.x + frame.depth * at / BAND_COUNT * pitch.y, LEAST_PITCH);
}

// Follows the rays, `spacing` mm apart on the aperture, from the target up; `different` has a bit for each step in which
// scanlines lose differently. What all rays of a step share is computed once.
void follow_rays(uint layer, int l, uint node, uint row, float spacing, float deviations, uint different) {
    float first = 0.5 * (1.0 - float(APERTURE_RAYS));
    float middle = float(l) + 0.5, last = float(frame.scanlines - 1u);
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        lost[i] = missed[i] = 0.0;
        aside[i] = rows[row].defocus * deviations * (first + float(i));
    }
    uint begin;
    for (uint end = node; end > 0u && different != 0u; end = begin) {
        begin = step_above(node, end);
        bool counts = (different & 1u) != 0u;
        different >>= 1u;
        if (!counts) continue;
        float half_way = spacing * lines_per_mm(0.5 * float(begin + end), node);
        float own = lost_in(layer, l, begin, end), turned = bent_in(layer, l, begin, end);
        float way = frame.depth / BAND_COUNT * (float(node) - 0.5 * float(begin + end));
        float sent_half_way = deviations * lines_sent(row, node, 0.5 * float(begin + end));
        for (uint i = 0u; i < APERTURE_RAYS; ++i) {
            float crossed = clamp(floor((first + float(i)) * half_way + middle), 0.0, last);
            float there = lost_in(layer, whole(crossed), begin, end);
            lost[i] += mix(there - own, 0.0, min(there, own) <= UNKNOWN);
            missed[i] += (bent_between(layer, l, (first + float(i)) * half_way, begin, end) - turned) * way;
            aside[i] += (bent_between(layer, l, (first + float(i)) * sent_half_way, begin, end) - turned) * way;
        }
        if (!front_near(begin, end)) continue;
        vec2 ends = spacing * vec2(lines_per_mm(float(begin), node), lines_per_mm(float(end), node));
        for (uint i = 0u; i < APERTURE_RAYS; ++i) {
            vec2 crossed = clamp(floor((first + float(i)) * ends + middle), vec2(0.0), vec2(last));
            lost[i] += mix(0.0, lost_of(0.0), crosses_front(whole(crossed.x), begin, whole(crossed.y), end));
        }
    }
}

// The part of each ray that reaches the target; of those of one Gaussian aperture.
float weights[APERTURE_RAYS];

// Factor on the amplitude of speckle around a target, in nepers, by rays that miss it. A ray of the transmit aperture and one of
// the receive aperture hear together what both meet: the overlap of two Gaussians as wide as a focus, the mean over all pairs of
// rays, over that of rays which nothing bends. Never brighter. `deviations` lie between two rays.
float level_of(uint row, float deviations) {
    float first = 0.5 * (1.0 - float(APERTURE_RAYS));
    float defocus = rows[row].defocus;
    float fall = 1.0 / (rows[row].variances - defocus * defocus);
    float most = 0.0;
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float more = aside[i] - defocus * deviations * (first + float(i));
        most = max(most, max(missed[i] * missed[i], more * more) * fall);
    }
    if (most < LEAST_MISSED) return 0.0;
    float sent = 0.0, heard = 0.0, met = 0.0;
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float from = deviations * (first + float(i));
        weights[i] *= exp(-from * from);
        heard += weights[i];
    }
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float even = defocus * deviations * (first + float(i));
        sent += weights[i] * exp(-even * even * fall);
        float overlaps = 0.0;
        for (uint j = 0u; j < APERTURE_RAYS; ++j) {
            float apart = aside[i] - missed[j];
            overlaps += weights[j] * exp(-apart * apart * fall);
        }
        met += weights[i] * overlaps;
    }
    float level = 0.5 * log(max(met, 1e-30) / max(sent * heard, 1e-30));
    return mix(LEAST_LEVEL, min(level, 0.0), level > LEAST_LEVEL);
}

// What the apertures of a target have on the way. `gain`: for each the mean over its rays of the part that reaches the target,
// over that of its own scanline; of the two-way amplitude that main paths carry, one way has the root.
vec2 converged(uint layer, int l, uint node, uint row) {
    vec2 halves = vec2(rows[row].transmit_half, rows[row].receive_half);
    float widest = max(halves.x, halves.y);
    float spacing = 2.0 * widest / float(APERTURE_RAYS);
    float deviations = spacing / max(rows[row].receive_sine * frame.depth * float(node) / BAND_COUNT, LEAST_PITCH);
    uint different = 0u, begin, bit = 1u;
    for (uint end = node; end > 0u; end = begin) {
        begin = step_above(node, end);
        vec2 sent = abs(vec2(lines_sent(row, node, float(begin)), lines_sent(row, node, float(end))));
        float most = max(widest * lines_per_mm(float(begin), node), 0.5 * float(APERTURE_RAYS) * deviations * max(sent.x, sent.y));
        int reach = whole(ceil(clamp(most, 0.0, 1e6)));
        int low = max(l - reach, 0), high = min(l + reach, int(frame.scanlines) - 1);
        if (low < high && differs(low, high, begin, end)) different |= bit;
        bit <<= 1u;
    }
    if (different == 0u) return vec2(0.0);
    // What would lie beyond the face is no element. A phased array is modelled as a point, its aperture is all there.
    float first = float(frame.first_line) + float(l) + 0.5;
    float at_face = mix(0.0, 1.0 / max(line_pitch().x, LEAST_PITCH), frame.kind != KIND_PHASED);
    follow_rays(layer, l, node, row, spacing, deviations, different);
    vec2 sum = vec2(0.0), count = vec2(0.0);
    for (uint i = 0u; i < APERTURE_RAYS; ++i) {
        float beside = spacing * (float(i) + 0.5) - widest;
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
    return vec2(gain, level_of(row, deviations));
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
    uint l = gl_WorkGroupID.x * THREADS + thread;
    if (l >= frame.scanlines) return;
    uint line = layer * frame.scanlines + l;
    for (uint node = gl_WorkGroupID.y; node <= APERTURE_BANDS; node += gl_NumWorkGroups.y) {
        uint row = sample_at(frame.depth * float(node) / (BAND_COUNT * frame.sample_pitch));
        vec2 found = converged(layer, int(l), node, row);
        uint at = aperture_at(line, node);
        apertures[at].gain = found.x;
        apertures[at].level = found.y;
    }
}
