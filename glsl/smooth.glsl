// Gaussians by which neighbours are smoothed, cut at three deviations.

// Neighbours on each side over which a Gaussian of this deviation smooths.
int reach_of(float sigma, int most) { return sigma < 0.05 ? 0 : int(min(ceil(3.0 * sigma), float(most))); }

// Its exponent per squared neighbour. Without smoothing that of the only tap, j = 0, is 0 whatever this is.
float falloff_of(float sigma) { return -0.5 / max(sigma * sigma, 0.0025); }
