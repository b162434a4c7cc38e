//! Helpers of tests of levels and image formation: a scene of one tissue, random numbers.

use insonify::probe::Probe;
use insonify::scene::{Scene, Tissue};

/// A tissue of fully developed speckle, with liver's attenuation, at `echogenicity` dB, without texture.
pub fn tissue(echogenicity: f64) -> Tissue {
    Tissue {
        speed: 1.54,
        echogenicity,
        density_of_scatterers: 1.0,
        mean_over_sigma: 0.0,
        texture_depth: 0.0,
        ..Tissue::shipped("liver").expect("the shipped table has liver")
    }
}

/// A scene of that tissue everywhere, seen with `probe`.
pub fn scene(probe: Probe) -> Scene {
    Scene::homogeneous(tissue(0.0), probe)
}

/// SplitMix64: independent of the kernels' generator.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal.
    pub fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
