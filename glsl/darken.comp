// The acquired volume along the scanlines, darkened by what the simulated anatomy absorbs and reflects of the
// sound: one thread per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) readonly buffer PieceBuffer { vec4 pieces[]; };
layout(std430, binding = 2) readonly buffer PrescanBuffer { float prescan[]; };
layout(std430, binding = 3) buffer ShadedBuffer { float shaded[]; };
layout(std430, binding = 4) readonly buffer ShadeBuffer { Aperture shades[]; };

#include "numbers.glsl"
#define APERTURES shades
#include "aperture.glsl"

void main() {
    uint k = gl_GlobalInvocationID.x;
    uint l = gl_GlobalInvocationID.y;
    if (k >= frame.samples || l >= frame.scanlines) { return; }
    float sum = 0.0;
    for (uint e = 0u; e < frame.layers; ++e) {
        uint first = (e * frame.scanlines + l) * MAX_PIECES;
        for (uint i = first; i + 1u < first + MAX_PIECES; ++i) {
            if (pieces[i + 1u].x > float(k)) {
                vec4 piece = pieces[i];
                float left = clamp(piece.y - piece.z * (float(k) - piece.x), -80.0, 80.0);
                if (loses_by_aperture()) {
                    float lost = shade_lost(piece, float(k));
                    left = aperture_nepers(e * frame.scanlines + l, float(k) * frame.sample_pitch / frame.speed, lost) - lost;
                }
                sum += exp(left);
                break;
            }
        }
    }
    uint at = 2u * (l * frame.samples + k);
    float level = prescan[at + 1u];
    // 20 / ln 10. Nothing is brightened: the darkest parts of a recording have more noise than echo.
    float left = clamp(sum / float(frame.layers), 1e-30, 1.0);
    float change = 8.685889638 * log(left) * frame.inverse_range;
    shaded[at] = prescan[at];
    shaded[at + 1u] = level > 0.0 ? max(level + change, 0.0) : 0.0;
}
