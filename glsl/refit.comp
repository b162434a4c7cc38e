// Fits the boxes of one level of an eight-wide hierarchy to the present triangles. The
// triangles and children of a node, and the order in which they are visited, stay as built.
//
// Eight threads per node, one per child, for which the node format (intersect_bvh.glsl) has a place.
#version 460
#extension GL_GOOGLE_include_directive : require

const uint NODES = 8u;             // per workgroup
const uint LEAST_EXPONENT = 53u;   // of a quantum, biased: 2^-74 mm for a node without extent
const float NOTHING = 3.4e38;

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint first;        // in order[]
    uint count;        // nodes, all of whose inner children are done
} push;

layout(std430, binding = 0) buffer Nodes { uvec4 nodes[]; };
layout(std430, binding = 1) readonly buffer Vertices { float vertices[]; };
layout(std430, binding = 2) readonly buffer Triangles { uint triangles[]; };
layout(std430, binding = 3) buffer Boxes { float boxes[]; };     // per node: low, high
layout(std430, binding = 4) readonly buffer Order { uint order[]; };

// Box of each child; then the unions of the boxes in the first 4, 2, 1 threads of a node.
shared vec3 lows[64];
shared vec3 highs[64];
// Quantised planes of each child, one axis per word: lower plane in the low byte, upper above it.
shared uvec3 planes[64];

struct Box { vec3 low; vec3 high; };

Box with_vertex(Box box, uint index) {
    vec3 p = vec3(vertices[3u * index], vertices[3u * index + 1u], vertices[3u * index + 2u]);
    return Box(min(box.low, p), max(box.high, p));
}

Box with_triangle(Box box, uint triangle) {
    Box a = with_vertex(box, triangles[3u * triangle]);
    Box b = with_vertex(a, triangles[3u * triangle + 1u]);
    return with_vertex(b, triangles[3u * triangle + 2u]);
}

Box child_box(uint node, uint child) {
    Box box = Box(vec3(NOTHING), vec3(-NOTHING));
    uvec4 links = nodes[5u * node + 1u];
    uint meta = (child < 4u ? links.z >> (8u * child) : links.w >> (8u * child - 32u)) & 0xffu;
    uint inner = nodes[5u * node].w >> 24u;
    if ((inner >> child & 1u) != 0u) {
        uint at = 6u * (links.x + uint(bitCount(inner & ((1u << child) - 1u))));
        return Box(vec3(boxes[at], boxes[at + 1u], boxes[at + 2u]), vec3(boxes[at + 3u], boxes[at + 4u], boxes[at + 5u]));
    }
    uint primitive = links.y + (meta & 31u);
    if ((meta & 0x20u) != 0u) box = with_triangle(box, primitive);
    if ((meta & 0x40u) != 0u) box = with_triangle(box, primitive + 1u);
    if ((meta & 0x80u) != 0u) box = with_triangle(box, primitive + 2u);
    return box;
}

// The rounding error of a - b: the exact difference minus the rounded one (Knuth 1969).
vec3 lost(vec3 a, vec3 b, vec3 difference) {
    precise vec3 minus_b = difference - a;
    precise vec3 rest = (a - (difference - minus_b)) - (b + minus_b);
    return rest;
}

// Biased exponent of the smallest power of two of which 255 cover the exact difference high - low.
uvec3 exponents(vec3 low, vec3 high) {
    precise vec3 extent = high - low;
    vec3 rest = lost(high, low, extent);
    uvec3 bits = floatBitsToUint(extent);
    uvec3 exponent = max(bits >> 23u, uvec3(LEAST_EXPONENT + 7u)) - 7u;
    vec3 covered = 255.0 * uintBitsToFloat(exponent << 23u);
    bvec3 beyond = greaterThan(extent, covered);
    bvec3 just = equal(extent, covered);
    bvec3 more = greaterThan(rest, vec3(0.0));
    return exponent + uvec3(
        beyond.x || (just.x && more.x) ? 1u : 0u, beyond.y || (just.y && more.y) ? 1u : 0u,
        beyond.z || (just.z && more.z) ? 1u : 0u);
}

// Largest number of quanta not above low - corner, smallest not below high - corner, both exact.
uvec3 quantised(vec3 corner, uvec3 exponent, vec3 low, vec3 high) {
    vec3 per_quantum = uintBitsToFloat((254u - exponent) << 23u);
    precise vec3 from = low - corner;
    precise vec3 to = high - corner;
    vec3 first = floor(from * per_quantum);
    vec3 last = ceil(to * per_quantum);
    // Corrects for a difference that rounding has moved onto a plane, from above or from below.
    vec3 under = min(sign(lost(low, corner, from)), vec3(0.0));
    vec3 over = max(sign(lost(high, corner, to)), vec3(0.0));
    first += mix(vec3(0.0), under, equal(first, from * per_quantum));
    last += mix(vec3(0.0), over, equal(last, to * per_quantum));
    uvec3 a = uvec3(clamp(first, vec3(0.0), vec3(255.0)));
    uvec3 b = uvec3(clamp(last, vec3(0.0), vec3(255.0)));
    return a | b << 8u;
}

void unite(uint lane, uint others) {
    barrier();
    if ((lane & 7u) < others) {
        lows[lane] = min(lows[lane], lows[lane + others]);
        highs[lane] = max(highs[lane], highs[lane + others]);
    }
}

// Byte `which` of four children's words.
uint gather(uint first, uint axis, uint which) {
    uint shift = 8u * which;
    return (planes[first][axis] >> shift & 0xffu) | (planes[first + 1u][axis] >> shift & 0xffu) << 8u
        | (planes[first + 2u][axis] >> shift & 0xffu) << 16u | (planes[first + 3u][axis] >> shift & 0xffu) << 24u;
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint child = lane & 7u;
    uint first = lane - child;
    uint place = gl_WorkGroupID.x * NODES + lane / 8u;
    bool used = place < push.count;
    uint node = used ? order[push.first + place] : 0u;

    Box box = Box(vec3(NOTHING), vec3(-NOTHING));
    if (used) box = child_box(node, child);
    lows[lane] = box.low;
    highs[lane] = box.high;
    unite(lane, 4u);
    unite(lane, 2u);
    unite(lane, 1u);
    barrier();
    vec3 low = lows[first];
    vec3 high = highs[first];
    uvec3 exponent = exponents(low, high);
    planes[lane] = box.low.x <= box.high.x ? quantised(low, exponent, box.low, box.high) : uvec3(0u);
    barrier();

    if (!used) return;
    if (child < 3u) {
        boxes[6u * node + child] = low[child];
        boxes[6u * node + 3u + child] = high[child];
        nodes[5u * node + 2u + child] = uvec4(gather(first, child, 0u), gather(first + 4u, child, 0u),
            gather(first, child, 1u), gather(first + 4u, child, 1u));
    }
    if (child == 3u) {
        uint inner = nodes[5u * node].w & 0xff000000u;
        nodes[5u * node] = uvec4(floatBitsToUint(low), exponent.x | exponent.y << 8u | exponent.z << 16u | inner);
    }
}
