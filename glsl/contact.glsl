// Contact of the probe with the skin. The includer declares frame and contact[].

// Number of elements before the place `at` (in elements from the face's edge) that are not coupled.
float air_before(float at) {
    uint lines = frame.scanlines + frame.lines_beside;
    uint i = min(uint(at), lines - 1u);
    float here = contact[lines + i];
    return here + (at - float(i)) * (contact[lines + i + 1u] - here);
}

// The factor on the echoes of scanline l if `reach` elements on either side receive: coupled share of the transmit
// aperture times that of the receive aperture.
float coupling(uint l, float reach) {
    uint line = frame.first_line + l, lines = frame.scanlines + frame.lines_beside;
    float sends = contact[line];
    float count = float(lines);
    if (contact[2u * lines] == 0.0) { return sends; }
    float middle = frame.kind == KIND_PHASED ? 0.5 * count : float(line) + 0.5;
    float left = max(middle - reach, 0.0);
    float right = min(middle + reach, count);
    return sends * (1.0 - (air_before(right) - air_before(left)) / (right - left));
}
