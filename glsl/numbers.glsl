// By its bits: a compiler that assumes finite numbers may drop isnan().
bool not_a_number(float x) { return (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u; }
