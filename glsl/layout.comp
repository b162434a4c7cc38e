// keep names
#version 460
// Mentions every structure of shared.glsl, and is compiled without optimisation so that their
// names survive: the layout test reflects this module, nothing runs it.
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 1) in;

layout(std430, binding = 0) buffer FrameBuffer { Frame frames[]; };
layout(std430, binding = 1) buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) buffer SurfaceBuffer { Surface surfaces[]; };
layout(std430, binding = 3) buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 4) buffer RowBuffer { Row rows[]; };
layout(std430, binding = 5) buffer SegmentBuffer { Segment segments[]; };
layout(std430, binding = 6) buffer CountersBuffer { Counters counters[]; };
layout(std430, binding = 7) buffer FusionBuffer { Fusion fusions[]; };
layout(std430, binding = 8) buffer View3dBuffer { View3d views[]; };
layout(std430, binding = 9) buffer InteractionBuffer { Interaction interactions[]; };
layout(std430, binding = 10) buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 11) buffer LabelBuffer { Label labels[]; };
layout(std430, binding = 12) buffer ApertureBuffer { Aperture apertures[]; };

void main() {
    frames[0].kind = 0u;
    tissues[0].seed = 0u;
    surfaces[0].gain = 0.0;
    instances[0].tissue = 0u;
    rows[0].tgc = 0.0;
    segments[0].line = 0u;
    counters[0].rays = 0u;
    fusions[0].blur = 0u;
    views[0].flags = 0u;
    interactions[0].path = 0u;
    scanlines[0].x = 0.0;
    labels[0].tissue = 0u;
    apertures[0].gain = 0.0;
}
