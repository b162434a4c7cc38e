#version 460
#extension GL_GOOGLE_include_directive : require
// The ray of every (scanline, layer), and its intersection with the face on the way back. It is no stage of a
// frame; a test uses it to compare probe.glsl with `Probe::ray`, and the harness to
// show that a kernel runs at all.
#include "shared.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
// Per line = e * scanlines + l: (origin, elevation), (direction, face_distance), (lateral, 0), (face_normal, 0).
// The face is searched from a point `depth` along the ray, backwards: it is exactly `depth` away, or a
// miss outside the face's height or for a point.
layout(std430, binding = 1) buffer RayBuffer { vec4 rays[]; };
layout(std430, binding = 2) readonly buffer ScanlineBuffer { Scanline scanlines[]; };

#include "probe.glsl"

void main() {
    uint line = gl_GlobalInvocationID.x;
    if (line >= frame.scanlines * frame.layers) { return; }
    uint l = line % frame.scanlines;
    uint e = line / frame.scanlines;
    vec3 origin;
    vec3 direction;
    vec3 lateral;
    probe_ray(l, e, origin, direction, lateral);
    rays[4u * line] = vec4(origin, elevation(e));
    rays[4u * line + 1u] = vec4(direction, face_distance(origin + frame.depth * direction, -direction));
    rays[4u * line + 2u] = vec4(lateral, 0.0);
    rays[4u * line + 3u] = vec4(face_normal(origin), 0.0);
}
