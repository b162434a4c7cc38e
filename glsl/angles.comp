// Sines, cosines and arcs of a list of arguments. It is no stage of a frame; a test uses it to compare
// angles.glsl with its twin: one thread per argument.
#version 460
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;
// Turns; a point's y and x; a sine.
layout(std430, binding = 0) readonly buffer ArgumentBuffer { vec4 arguments[]; };
// Cosine and sine; the point's angle; the arcsine.
layout(std430, binding = 1) buffer ResultBuffer { vec4 results[]; };

#include "angles.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= uint(arguments.length())) { return; }
    vec4 given = arguments[i];
    results[i] = vec4(phasor(given.x), arc(given.y, given.z), arcsine(given.w));
}
