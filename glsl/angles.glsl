#ifndef ANGLES_GLSL
#define ANGLES_GLSL
// Sine, cosine and arctangent computed from sums and products alone, so that every device gives the same.
// Vulkan lets a device's own sin and cos err by 2^-11, and only within [-pi, pi], and its atan by
// 4096 units in the last place; sums and products it must round correctly, and `precise` keeps them
// from being fused. tools/reference/angles.rs mirrors every operation and measures the errors.

const float TURNS = 0.1591549431;   // in a radian

// Point of the unit circle at an angle in turns: (cosine, sine), within 2.5e-7, for |turns| up to 2^22.
vec2 phasor(float turns) {
    // Reduced to at most half a turn; for more than a quarter, sin(x) = sin(half a turn - x).
    precise float t = turns - floor(turns + 0.5);
    precise float half_turn = mix(0.5, -0.5, t < 0.0);
    precise vec2 z = vec2(0.25 - abs(t), mix(t, half_turn - t, abs(t) > 0.25));
    precise vec2 w = z * z;
    precise vec2 p = z * (6.283185005 + w * (-41.34165573 + w * (81.60100555 + w * (-76.54978180 + w * 39.53670502))));
    return p;
}

// Angle of the point (x, y) from the x axis towards y, radians in [-pi, pi], within 4e-7; 0 at (0, 0).
float arc(float y, float x) {
    float a = abs(x), b = abs(y);
    float longer = max(a, b);
    precise float z = mix(0.0, min(a, b) / longer, longer > 0.0);
    precise float w = z * z;
    precise float angle = z * (0.9999993443 + w * (-0.3332985938 + w * (0.1994656622 + w * (-0.1390862912
        + w * (0.09642197192 + w * (-0.05591232330 + w * (0.02186295576 - w * 0.004054566845)))))));
    angle = mix(angle, 1.570796327 - angle, b > a);
    angle = mix(angle, 3.141592654 - angle, x < 0.0);
    return mix(angle, -angle, y < 0.0);
}

// Arcsine of s in [-1, 1], radians, within 5e-7.
float arcsine(float s) { return arc(s, sqrt(max((1.0 - s) * (1.0 + s), 0.0))); }
#endif
