// The generating kernel of the blend's pyramid along one axis, at offset -2..2: (1, 4, 6, 4, 1) / 16.
float generating(int offset) {
    return offset == 0 ? 0.375 : (abs(offset) == 1 ? 0.25 : 0.0625);
}
