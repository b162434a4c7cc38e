//! Headroom: bounds on the sums of echoes, and the fixed-point scales that keep them below 2^30.

use std::f64::consts::TAU;

use super::{Calibration, amplitude};
use crate::layout::{ECHO_LIMIT, LEVELS_PER_OCTAVE, STRIP_LIMIT};
use crate::scene::Tissue;
use crate::settings::ScatterMode;
use crate::tables::wire_spacing;

/// Largest fixed-point scale of surfaces: one unit is -120 dB re a perfect mirror.
const LARGEST_SCALE: f64 = (1u32 << 20) as f64;
/// Largest fixed-point scale of scatterers: near a phased array, where lines lie close together, each deposits an eighth of
/// what its neighbours make of it.
const LARGEST_VOLUME_SCALE: f64 = (1u32 << 23) as f64;

/// Largest value of the kernels' Gaussian numbers: Box-Muller on u >= 2^-17.
fn largest_gaussian() -> f64 {
    (2.0 * 131_072f64.ln()).sqrt()
}

/// Largest value of the low-frequency texture: both octaves of value noise at their extreme.
const LARGEST_TEXTURE: f64 = 1.5 / 0.413_29;

impl Calibration<'_> {
    /// Largest amplitude and power over all tissues at depth `z`. Tissue masked by a louder one has fewer
    /// scatterers, each louder in proportion.
    fn loudest(&self, z: f64) -> (f64, f64) {
        let voxel = self.scene.simulation.scatter_mode == ScatterMode::Voxel;
        // The level is that of the next lattice at the end of the cross-fade.
        let step = 1.0 / f64::from(LEVELS_PER_OCTAVE);
        let thinned = self.lattice_level(z).max(0.0) + step;
        let over = |(a, p): (f64, f64), tissue: &Tissue| {
            let (mean, sigma) = self.scatterer_amplitudes(tissue);
            if sigma == 0.0 {
                return (a, p);
            }
            let bare = match voxel {
                true => mean.abs() + largest_gaussian() * sigma,
                false => {
                    let density = self.scatterer_density(tissue);
                    self.cell_amplitude(tissue) * thinned.exp2().max(1.0 / density).sqrt()
                }
            };
            let largest = bare * (1.0 + tissue.texture_depth * LARGEST_TEXTURE);
            // A sample is longer, in mm, where sound is faster.
            let power =
                amplitude(tissue.echogenicity).powi(2) * tissue.speed / self.scene.probe.speed;
            (f64::max(a, largest), f64::max(p, power))
        };
        self.scene.tissues.iter().fold((0.0, 0.0), over)
    }

    /// Bound on one component of the sum of the scatterers that a line hears itself, in one sample at depth `z`,
    /// compensated.
    ///
    /// Lattice: the terms are independent, of zero mean (random phase), at most M each and of
    /// total variance V, so Bernstein's inequality bounds the sum by L M / 3 + sqrt((L M / 3)^2 +
    /// 2 L V) but for a probability of 2 exp(-L) per sample; L = 35 makes that 1e-15, never in
    /// 1e9 samples. (About 8.4 standard deviations plus 23 times the loudest scatterer.) The
    /// absolute sum would be an order of magnitude more, for phases that cannot all agree.
    /// Voxel: per layer one lookup reaches a sample: absolute.
    /// Twice either, since reflected branches may add at most as much again.
    pub fn scatterer_bound(&self, z: f64) -> f64 {
        let (largest, power) = self.loudest(z);
        let gain = self.speckle_gain(z) * amplitude(self.compensation_db(z));
        if self.scene.simulation.scatter_mode == ScatterMode::Voxel {
            return 2.0 * largest * gain * self.elevation_weights(z);
        }
        let (sigma, reach) = (self.sigma_elevation(z), self.elevation_reach());
        let nearest = self.elevations().fold(f64::INFINITY, |n, y| n.min(y.abs()));
        let beside = (nearest - reach).max(0.0) / sigma;
        // In a narrower strip each scatterer is louder.
        let narrowest = f64::from(STRIP_LIMIT).sqrt();
        let m = narrowest * largest * gain * (-beside * beside / 2.0).exp();
        // Half the power is in each component; what smoothing over lines adds is not in the sum.
        let strip = self.strip(z);
        let own = strip.own_energy() / strip.energy();
        let rms = self.speckle_target() * amplitude(self.compensation_db(z));
        let v = own * power * rms * rms / self.axial_energy(0) / 2.0;
        let l = 35.0;
        2.0 * (l * m / 3.0 + ((l * m / 3.0).powi(2) + 2.0 * l * v).sqrt())
    }

    /// Bound on one component of the points' sum in one sample at depth `z`, compensated. Points
    /// of a wire, weighted with a Gaussian of at most sigma = max(sigma_x, sigma_e, dz), sum to at
    /// most 1 + sqrt(2 pi) sigma / spacing; the two loudest wires may cross there.
    pub fn point_bound(&self, z: f64) -> f64 {
        let widest =
            self.sigma_lateral(z).max(self.sigma_elevation(z)).max(self.scene.probe.sample_pitch());
        let mut sums: Vec<f64> = self
            .scene
            .wires
            .iter()
            .map(|wire| {
                let count = f64::from(wire.steps()) + 1.0;
                let spacing = wire_spacing(wire);
                let weights = 1.0 + TAU.sqrt() * widest / spacing.max(1e-9);
                wire.amplitude.abs() * weights.min(count)
            })
            .collect();
        sums.sort_by(|a, b| b.total_cmp(a));
        let sum: f64 = sums.iter().take(2).sum();
        sum * self.point_gain(z) * amplitude(self.compensation_db(z))
    }

    /// Bound on one component of the surface echoes' sum in one sample at depth `z`, compensated.
    /// N paths of share 1/N add gamma A at most coherently and sqrt(1 - gamma^2) sqrt(N) A when
    /// all incoherent phases agree, times their gain G, A <= gain; sum <= sqrt(1 + N G^2) (Cauchy
    /// and Schwarz). The layers' weights sum to 1. Two such interfaces may share a sample.
    pub fn surface_bound(&self, z: f64) -> f64 {
        let loudest = self
            .scene
            .instances
            .iter()
            .flat_map(|instance| instance.surface)
            .fold(0.0, |gain, surface| f64::max(gain, amplitude(surface.gain)));
        let incoherent = f64::from(self.scene.simulation.paths) * self.incoherent_gain(z).powi(2);
        2.0 * (1.0 + incoherent).sqrt()
            * loudest
            * self.surface_level()
            * amplitude(self.surface_compensation_db(z))
    }

    /// Fixed-point scales of surface and volume: the largest powers of two up to 2^20 and 2^23 with which the bounds above
    /// stay below 2^30 in every sample. The kernels clamp and count what is beyond. Scatterers and points, each with sums of
    /// their own, have the same.
    pub fn scales(&self) -> (f64, f64) {
        let pitch = self.scene.probe.sample_pitch();
        let (mut surface, mut volume) = (0f64, 0f64);
        // The bounds vary with the beam's width, slowly: every sixteenth sample, with 5 % spare.
        for k in (0..self.scene.probe.samples + 16).step_by(16) {
            let z = f64::from(k.min(self.scene.probe.samples)) * pitch;
            surface = surface.max(self.surface_bound(z));
            volume = volume.max(self.scatterer_bound(z)).max(self.point_bound(z));
        }
        (scale(LARGEST_SCALE, 1.05 * surface), scale(LARGEST_VOLUME_SCALE, 1.05 * volume))
    }
}

/// Largest power of two up to `largest`, itself one, whose product with `bound` is below 2^30.
fn scale(largest: f64, bound: f64) -> f64 {
    let mut scale = largest;
    while scale * bound >= ECHO_LIMIT {
        scale /= 2.0;
    }
    scale
}
