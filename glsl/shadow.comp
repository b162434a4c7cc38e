// variants: bvh query(RAY_QUERY)
#version 460
// Shadows: the loss of sound in the anatomy inside the mask beyond the loss that the tissue around the mask would
// cause. The level along the transmitted path of each line is written as pieces of straight lines.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) restrict readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 4) restrict readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 5) restrict readonly buffer SmoothedBuffer { uvec4 smoothed[]; };
layout(std430, binding = 6) restrict readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 7) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 7) restrict readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 8) restrict readonly buffer StackBuffer { uint stacks[]; };
layout(std430, binding = 9) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 10) restrict buffer PieceBuffer { vec4 pieces[]; };
layout(std430, binding = 11) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 12) restrict buffer ShadeBuffer { Aperture shades[]; };

#include "triangle.glsl"
#ifdef RAY_QUERY
#define RAY_MASK frame.ray_mask
#define RAY_SLOTS ((frame.flags & FLAG_SLOTS) != 0u)
#include "intersect_query.glsl"
#else
#include "intersect_bvh.glsl"
#endif
#include "surface.glsl"
#include "probe.glsl"
#include "transform.glsl"
#include "acoustics.glsl"
#include "footprint.glsl"
#include "media.glsl"
#include "path.glsl"
#include "start.glsl"
#include "wavefront.glsl"
#define APERTURES shades
#include "aperture.glsl"

// Level, in nepers of amplitude, that stands for no sound at all.
const float DARK = -200.0;
const float NOTHING = 1e-30;

// The middle of the beam: the path of `trace` before anything random.
void middle(uint line, out Path path, inout Media media) {
    start(line, 0u, path, media);
    vec3 o, d, lateral;
    probe_ray(line % frame.scanlines, line / frame.scanlines, o, d, lateral);
    path.direction = world_vector(d);
    path.lateral = world_vector(lateral);
    path.origin = world_point(o) + path.time * frame.speed * path.direction;
    path.spread = vec3(0.0);
}

uint next, last;             // the line's next piece, and its last
float level = 0.0;
float surrounding;           // absorption of the tissue around the mask
float excess = 0.0;          // absorption beyond that
bool heard_before = true;

#include "transmitted.glsl"

bool is_over(Path path) { return next + 1u == last; }

void begin_way(Path path, uint instance, Medium way, bool heard, bool ends) {
    if (!heard) surrounding = way.absorption;
    excess = heard ? way.absorption - surrounding : 0.0;
    if (heard || heard_before || ends) {
        float kappa = next + MAX_PIECES - 1u == last ? 0.0 : frame.speed * path.time / frame.sample_pitch;
        float slope = ends ? 0.0 : excess * way.speed * frame.sample_pitch / frame.speed;
        pieces[next] = vec4(kappa, level, slope, 0.0);
        next += 1u;
    }
    heard_before = heard;
}

void pass_way(float t) { level -= excess * t; }

void pass_surface(Path path, vec3 normal, float transmitted) {
    level = transmitted <= 0.0 ? DARK : level + log(max(transmitted, NOTHING));
}

// Marks the end of the list; the last piece extends to the end of the line.
void end_ways() { pieces[next] = vec4(FAR_PIECE, 0.0, 0.0, 0.0); }

void main() {
    uint line = gl_GlobalInvocationID.x;
    if (line >= frame.scanlines * frame.layers) return;
    Path path;
    Media media;
    middle(line, path, media);
    next = line * MAX_PIECES;
    last = next + MAX_PIECES - 1u;
    surrounding = tissues[frame.background].absorption;
    follow(path, media);
    if (!loses_by_aperture()) return;
    uint piece = line * MAX_PIECES;
    for (uint node = 0u; node <= APERTURE_BANDS; ++node) {
        float kappa = float(node) * float(frame.samples) / float(APERTURE_BANDS);
        while (pieces[piece + 1u].x <= kappa) piece += 1u;
        uint at = aperture_at(line, node);
        shades[at].lost = shade_lost(pieces[piece], kappa);
        shades[at].bent = 0.0;
    }
}
