// Which of both images the pixels of each tile show, from the blocks of mask that they and the boxes around them may
// reach: one thread per tile. A tile may be said to have both where it does not, never the other way round.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"
#include "numbers.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer FusionBuffer { Fusion fusion; };
layout(std430, binding = 2) restrict readonly buffer BlockBuffer { uint mask_blocks[]; };
layout(std430, binding = 3) restrict buffer TileBuffer { uint tiles[]; };

layout(push_constant) uniform Push { uint complete; };   // 1: every intermediate image is wanted everywhere

#include "angles.glsl"

const vec2 ALL = vec2(-1e9, 1e9);

// Least and greatest column and row among the scanlines of the pixels from `first` to `last`, of both axes.
void range(vec2 first, vec2 last, out vec2 columns, out vec2 rows) {
    float left = frame.image_left + (first.x + 0.5) * frame.pixel_pitch;
    float right = frame.image_left + (last.x + 0.5) * frame.pixel_pitch;
    float top = frame.image_top + (first.y + 0.5) * frame.pixel_pitch;
    float bottom = frame.image_top + (last.y + 0.5) * frame.pixel_pitch;
    vec2 across, depth;
    if (frame.kind == KIND_LINEAR) {
        across = vec2(left, right) / frame.width;
        depth = vec2(top, bottom);
    } else {
        // Above the middle of the arc angles jump from one side to the other.
        top += frame.radius;
        bottom += frame.radius;
        across = ALL;
        if (top > 0.0) {
            across.x = min(arc(left, top), arc(left, bottom)) / frame.field_of_view;
            across.y = max(arc(right, top), arc(right, bottom)) / frame.field_of_view;
        }
        vec2 nearest = vec2(clamp(0.0, left, right), clamp(0.0, top, bottom));
        vec2 farthest = vec2(max(abs(left), abs(right)), max(abs(top), abs(bottom)));
        depth = vec2(length(nearest), length(farthest)) - frame.radius;
    }
    columns = (across + 0.5) * float(frame.scanlines) - 0.5;
    rows = depth / frame.sample_pitch;
}

// Numbers of the samples, of `count`, that bilinear interpolation reads at places from `places.x` to `places.y`, clamped
// at the ends; the second is below the first if none of these places lies in the sector, which ends at `ends`.
ivec2 read_between(vec2 places, vec2 ends, uint count) {
    const float ROUNDING = 0.01;
    if (places.y < ends.x - ROUNDING || places.x > ends.y + ROUNDING) return ivec2(0, -1);
    vec2 clamped = clamp(places + vec2(-ROUNDING, ROUNDING), vec2(0.0), vec2(float(count - 1u)));
    return ivec2(whole(floor(clamped.x)), min(whole(floor(clamped.y)) + 1, int(count) - 1));
}

void main() {
    uvec2 size = uvec2(frame.image_width, frame.image_height);
    uvec2 count = (size + TILE - 1u) / TILE;
    uvec2 here = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(here, count))) { return; }
    uint at = here.y * count.x + here.x;
    if (complete != 0u) {
        atomicOr(tiles[at], TILE_ACQUIRED | TILE_SIMULATED | TILE_BLURRED | TILE_WHOLE);
        return;
    }
    // Boxes reach as far up and to the left, and no farther down and to the right.
    ivec2 reach = ivec2(fusion.blur / 2u);
    ivec2 first = max(ivec2(here * TILE) - reach, ivec2(0));
    ivec2 last = min(ivec2((here + 1u) * TILE - 1u) + reach, ivec2(size) - 1);
    vec2 columns, rows;
    range(vec2(first), vec2(last), columns, rows);
    ivec2 lines = read_between(columns, vec2(-0.5, float(frame.scanlines) - 0.5), frame.scanlines);
    ivec2 samples = read_between(rows, vec2(0.0, frame.depth / frame.sample_pitch), frame.samples);
    uint blocks = (frame.samples + MASK_BLOCK - 1u) / MASK_BLOCK;
    uint seen = 0u;
    if (samples.y >= samples.x) {
        for (int line = lines.x; line <= lines.y; ++line) {
            for (uint block = uint(samples.x) / MASK_BLOCK; block <= uint(samples.y) / MASK_BLOCK; ++block) {
                seen |= mask_blocks[uint(line) * blocks + block];
            }
        }
    }
    atomicOr(tiles[at], seen);
    if (seen != (TILE_ACQUIRED | TILE_SIMULATED)) { return; }
    uvec2 from = uvec2(first) / TILE;
    uvec2 to = uvec2(last) / TILE;
    for (uint y = from.y; y <= to.y; ++y) {
        for (uint x = from.x; x <= to.x; ++x) { atomicOr(tiles[y * count.x + x], TILE_BLURRED); }
    }
}
