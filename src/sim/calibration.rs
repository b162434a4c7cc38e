//! Calibration: the gains with which speckle, points, surfaces and noise have their stated brightness.
//!
//! Everything is relative to a perfect flat mirror, which deposits 1 and shows envelope 1.

mod headroom;
mod strip;
mod work;

pub use strip::Strip;
pub use work::Work;

use std::f64::consts::{LN_10, PI, TAU};

use super::layout::{AXIAL_REACH, LATERAL_REACH, LEVELS_PER_OCTAVE, SAMPLE_BLEND};
use super::special::{erf, sinc};
use crate::scene::{Scene, Tissue};
use crate::settings::ScatterMode;

/// RMS envelope of unattenuated liver relative to a perfect mirror, dB. No source gives it; at
/// this level a fat/muscle interface (-19.7 dB) stands 25 dB above liver.
const LIVER_LEVEL: f64 = -45.0;
/// Largest compensation of surface echoes at deposit, dB. They are up to 45 dB above speckle, so
/// that they need less to stay above the rounding, and more would cost headroom.
const SURFACE_COMPENSATION_LIMIT: f64 = 42.0;
/// Distance of a layer from the image plane from which on its scatterers do not count, in sigmas of the beam in elevation
/// (amplitude .044 there).
pub const ELEVATION_CUT: f64 = 2.5;
/// Largest brightening of layers that sample only a part of the beam, as a power: 30 dB. Beyond,
/// the layers miss the beam altogether and darkness is the honest picture.
const ELEVATION_GAIN_LIMIT: f64 = 1000.0;

/// 10^(dB/20).
pub fn amplitude(decibel: f64) -> f64 {
    (decibel * LN_10 / 20.0).exp()
}

/// Edge of the cells in which incoherent surface echoes share a phase, mm (docs/kernels.md).
const PHASE_CELL: f64 = 0.5;

/// Weights w_0 ..= w_R of the lateral smoothing; symmetric. No smoothing below 0.05 lines.
pub fn lateral_taps(lines: f64) -> Vec<f64> {
    if lines < 0.05 {
        return vec![1.0];
    }
    gaussian_taps(lines, ((3.0 * lines).ceil() as i32).min(LATERAL_REACH))
}

fn gaussian_taps(sigma: f64, radius: i32) -> Vec<f64> {
    (0..=radius).map(|j| (-f64::from(j * j) / (2.0 * sigma * sigma)).exp()).collect()
}

/// Autocorrelation at lag `m` of a symmetric kernel given by its right half.
fn autocorrelation(taps: &[f64], m: usize) -> f64 {
    let radius = taps.len() as i64 - 1;
    let at = |j: i64| taps.get(j.unsigned_abs() as usize).copied().unwrap_or(0.0);
    (-radius..=radius).map(|j| at(j) * at(j + m as i64)).sum()
}

/// The levels of one scene. Lengths in mm, gains linear.
pub struct Calibration<'a> {
    scene: &'a Scene,
    /// Sigma of the axial kernel, samples.
    pub axial_sigma: f64,
    axial_taps: Vec<f64>,
}

impl<'a> Calibration<'a> {
    /// Levels of `scene`.
    pub fn new(scene: &'a Scene) -> Self {
        let sigma = scene.probe.sigma_axial() * scene.imaging.psf_scale[0];
        let samples = sigma / scene.probe.sample_pitch();
        // A pulse much narrower than a sample cannot be represented.
        let axial_sigma = samples.max(0.1);
        let radius = ((4.0 * axial_sigma).ceil() as i32).min(AXIAL_REACH);
        Self { scene, axial_sigma, axial_taps: gaussian_taps(axial_sigma, radius) }
    }

    /// Two-way lateral sigma at depth `z`, mm, with the user's scale.
    pub fn sigma_lateral(&self, z: f64) -> f64 {
        self.scene.probe.sigma_lateral(z) * self.scene.imaging.psf_scale[1]
    }

    /// Two-way elevational sigma at depth `z`, mm, with the user's scale.
    pub fn sigma_elevation(&self, z: f64) -> f64 {
        self.scene.probe.sigma_elevation(z) * self.scene.imaging.psf_scale[2]
    }

    /// Lateral sigma in scanline pitches; at most 1000, for a phased array's lines meet at z = 0.
    pub fn lateral_lines(&self, z: f64) -> f64 {
        (self.sigma_lateral(z) / self.scene.probe.line_pitch(z).max(1e-9)).min(1000.0)
    }

    /// Two-way attenuation that the machine assumes down to depth `z`, dB, up to the TGC's limit.
    pub fn compensation_db(&self, z: f64) -> f64 {
        let imaging = &self.scene.imaging;
        (2.0 * imaging.tgc_attenuation * self.scene.probe.frequency * z / 10.0)
            .min(imaging.tgc_limit)
    }

    /// Compensation of surface echoes at deposit, dB.
    pub fn surface_compensation_db(&self, z: f64) -> f64 {
        self.compensation_db(z).min(SURFACE_COMPENSATION_LIMIT)
    }

    /// TGC at depth `z`, dB: compensation plus sliders.
    pub fn tgc_db(&self, z: f64) -> f64 {
        let sliders = &self.scene.imaging.tgc_sliders;
        let position = (z / self.scene.probe.depth).clamp(0.0, 1.0) * (sliders.len() - 1) as f64;
        let i = (position as usize).min(sliders.len() - 2);
        let f = position - i as f64;
        self.compensation_db(z) + sliders[i] * (1.0 - f) + sliders[i + 1] * f
    }

    /// Level of the noise in the samples of an image, dB; that of the echo of a perfect mirror is 0.
    pub fn noise_level(&self) -> f64 {
        self.scene.imaging.noise - self.scene.imaging.power
    }

    /// Standard deviation of each component of the noise per sample, such that the axial kernel
    /// brings its RMS magnitude to the wanted level, in units of the echo of a perfect mirror.
    pub fn noise(&self) -> f64 {
        amplitude(self.noise_level()) / (2.0 * autocorrelation(&self.axial_taps, 0)).sqrt()
    }

    /// Factor on what is received, TGC applied, after which 1 is white.
    pub fn display_gain(&self) -> f64 {
        amplitude(self.scene.imaging.gain + self.scene.imaging.power)
    }

    /// Elevational half-width in which one layer sees scatterers, mm: its share of the slice.
    pub fn elevation_reach(&self) -> f64 {
        let probe = &self.scene.probe;
        probe.slice_thickness / (2.0 * f64::from(probe.elevation_layers))
    }

    fn elevations(&self) -> impl Iterator<Item = f64> + Clone + '_ {
        let probe = &self.scene.probe;
        (0..probe.elevation_layers).map(|e| probe.elevation(e))
    }

    /// Sum over the layers of a surface echo's weights exp(-y_e^2 / 2 sigma_e^2).
    pub fn elevation_weights(&self, z: f64) -> f64 {
        let sigma = self.sigma_elevation(z);
        let sum: f64 = self.elevations().map(|y| (-y * y / (2.0 * sigma * sigma)).exp()).sum();
        sum.max(1e-12)
    }

    /// The gain that keeps the energy of an incoherent surface echo through the averages over layers and
    /// over neighbouring scanlines: 1 / sqrt(P_e P_l), P = sum_ij w_i w_j c(|i - j| pitch) /
    /// (sum w)^2 with c the probability that two points lie in one phase cell, 1 - distance / cell.
    /// Without it interfaces would become darker with more layers.
    pub fn incoherent_gain(&self, z: f64) -> f64 {
        let kept = |weights: &[f64], pitch: f64| {
            let chance =
                |i: usize, j: usize| (1.0 - i.abs_diff(j) as f64 * pitch / PHASE_CELL).max(0.0);
            let sum: f64 = weights.iter().sum();
            let pairs: f64 = (0..weights.len())
                .flat_map(|i| (0..weights.len()).map(move |j| (i, j)))
                .map(|(i, j)| weights[i] * weights[j] * chance(i, j))
                .sum();
            pairs / (sum * sum).max(1e-24)
        };
        let probe = &self.scene.probe;
        let sigma = self.sigma_elevation(z);
        let layers: Vec<f64> =
            self.elevations().map(|y| (-y * y / (2.0 * sigma * sigma)).exp()).collect();
        let half = lateral_taps(self.lateral_lines(z));
        let lines: Vec<f64> = half.iter().skip(1).rev().chain(&half).copied().collect();
        let layer_pitch = probe.slice_thickness / f64::from(probe.elevation_layers);
        (kept(&layers, layer_pitch) * kept(&lines, probe.line_pitch(z))).sqrt().recip()
    }

    /// The part of the energy of the two-way beam in elevation, sqrt(pi) sigma_e, that each layer receives at depth `z`: its
    /// slab, if some of it lies within [`ELEVATION_CUT`] sigmas.
    fn heard(&self, z: f64) -> impl Iterator<Item = f64> + '_ {
        let (sigma, reach) = (self.sigma_elevation(z), self.elevation_reach());
        self.elevations().map(move |y| {
            let heard = y.abs() - reach < ELEVATION_CUT * sigma;
            let part = (erf((y + reach) / sigma) - erf((y - reach) / sigma)) / 2.0;
            if heard { part } else { 0.0 }
        })
    }

    /// Energy of the two-way beam in elevation, divided by the part that the layers receive.
    pub fn beam_power(&self, z: f64) -> f64 {
        (1.0 / self.heard(z).sum::<f64>().max(1e-12)).min(ELEVATION_GAIN_LIMIT)
    }

    /// The resolution cell at depth `z`, mm^3: the volume whose scatterers make as much of the fourth
    /// moment as all under the point-spread function h, (int h^2)^2 / int h^4; sqrt(2 pi) sigma per axis, less
    /// where the slice ends within the beam.
    pub fn resolution_cell(&self, z: f64) -> f64 {
        let sigma = self.sigma_elevation(z);
        let end = self.scene.probe.slice_thickness / 2.0 / sigma;
        let up = TAU.sqrt() * sigma * erf(end).powi(2) / erf(std::f64::consts::SQRT_2 * end);
        let axial = self.scene.probe.sigma_axial() * self.scene.imaging.psf_scale[0];
        TAU * self.sigma_lateral(z) * axial * up
    }

    /// Level of the lattice that is as dense as speckle needs at depth `z`: the log2 of the largest volume
    /// of a cell, in cells of the finest lattice. Minus infinity: scatterers must not be thinned out.
    pub fn lattice_level(&self, z: f64) -> f64 {
        let simulation = &self.scene.simulation;
        if simulation.scatterers_per_resolution_cell <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let volume = self.resolution_cell(z) / simulation.scatterers_per_resolution_cell;
        (volume / simulation.cell.powi(3)).log2()
    }

    /// The level that shows as black at depth `z`: one-way weight times echogenicity, log2. Minus infinity
    /// where nothing may be left out. Where N paths share an echo, the level is divided by N.
    pub fn black(&self, z: f64) -> f64 {
        let (imaging, simulation) = (&self.scene.imaging, &self.scene.simulation);
        if simulation.scatterers_per_resolution_cell <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let shown = amplitude(-imaging.dynamic_range) / self.display_gain();
        let level = shown / (self.speckle_target() * amplitude(self.tgc_db(z)));
        let paths = f64::from(simulation.paths.max(1));
        let share = if simulation.has_one_main_path() { 1.0 } else { paths };
        (level / share).log2()
    }

    /// Density of scatterers of one amplitude and either sign, per lattice cell, whose speckle has the
    /// fourth moment of `tissue`'s own: rho over the kurtosis of a normal amplitude of mean mu,
    /// (m^4 + 6 m^2 + 3) / (1 + m^2)^2 with m = mu / sigma.
    pub fn scatterer_density(&self, tissue: &Tissue) -> f64 {
        let rho = tissue.density_of_scatterers * self.scene.simulation.thinning();
        let square = tissue.mean_over_sigma.powi(2);
        rho * (1.0 + square).powi(2) / (square * square + 6.0 * square + 3.0)
    }

    /// Octaves by which the volume of the cells of `tissue` at depth `z` exceeds that of the finest, where nothing
    /// drowns it.
    fn lattice_octaves(&self, tissue: &Tissue, z: f64) -> f64 {
        let density = self.scatterer_density(tissue);
        let steps = f64::from(LEVELS_PER_OCTAVE);
        let octaves = match self.lattice_level(z) {
            f64::NEG_INFINITY => 0.0,
            // A sparse tissue has coarser cells, as long as there are eight for each of its scatterers.
            thinned => thinned.max(-(8.0 * density).log2()).max(0.0),
        };
        (steps * octaves).floor() / steps
    }

    /// Scatterers of `tissue` in a resolution cell at depth `z`, where nothing drowns it and one lattice sounds alone.
    pub fn scatterers_at(&self, tissue: &Tissue, z: f64) -> f64 {
        let density = self.scatterer_density(tissue);
        let volume = self.lattice_octaves(tissue, z).exp2();
        let cells = self.resolution_cell(z) / self.scene.simulation.cell.powi(3);
        cells * density.min(1.0 / volume)
    }

    /// RMS of a lattice cell of `tissue`, without its low-frequency texture, whose power is 1 + k^2.
    pub fn cell_amplitude(&self, tissue: &Tissue) -> f64 {
        amplitude(tissue.echogenicity) / (1.0 + tissue.texture_depth.powi(2)).sqrt()
    }

    /// int u^2 over the continuous position of an echo, u the axial kernel about the sample nearest to it,
    /// at integer lag `m` between two echoes; samples. Two that share an echo by a and 1 - a, a anything from
    /// 0 to 1, keep 2/3 of its energy and 1/3 of that of neighbours.
    fn axial_energy(&self, m: usize) -> f64 {
        let at = |m| autocorrelation(&self.axial_taps, m);
        let shared = if m == 0 { at(0) - at(1) } else { 0.0 };
        at(m) - f64::from(SAMPLE_BLEND) / 3.0 * shared
    }

    fn speckle_target(&self) -> f64 {
        amplitude(LIVER_LEVEL + self.scene.simulation.speckle_gain)
    }

    /// Expected power per sample, at depth `z`, of the speckle of a tissue of 0 dB that nothing weakens, of each elevation
    /// layer; together that of [`Self::speckle_gain`].
    pub fn speckle_powers(&self, z: f64) -> Vec<f64> {
        let target = self.speckle_target().powi(2);
        let heard: Vec<f64> = match self.scene.simulation.scatter_mode {
            ScatterMode::Lattice => {
                let lost = self.beam_power(z);
                self.heard(z).map(|share| share * lost).collect()
            }
            ScatterMode::Voxel => {
                let sigma = self.sigma_elevation(z);
                let layers = self.elevations().map(|y| (-y * y / (sigma * sigma)).exp());
                let sum = layers.clone().sum::<f64>().max(1e-12);
                layers.map(|share| share / sum).collect()
            }
        };
        heard.into_iter().map(|share| target * share).collect()
    }

    /// The factor on a scatterer's calibrated amplitude at depth `z`, before attenuation compensation.
    ///
    /// Lattice: E|IQ|^2 = C^2 v h^-3 (int u^2 dz) (int K^2 dx) sqrt(pi) sigma_e over [`Self::beam_power`], v the power
    /// of a cell; v = 1 is liver; K is what a line hears across ([`Strip`]).
    /// Voxel: E|IQ|^2 = C^2 v S_lateral S_axial sum_e w_e^2; lookups in one voxel are equal, so
    /// both sums run over pairs, weighted with the probability 1 - distance/h that a lattice
    /// along the beam puts both into one voxel.
    pub fn speckle_gain(&self, z: f64) -> f64 {
        let simulation = &self.scene.simulation;
        let (h, dz) = (simulation.cell, self.scene.probe.sample_pitch());
        let energy = match simulation.scatter_mode {
            ScatterMode::Lattice => {
                let across = self.strip(z).energy() * self.pitch(z);
                let up = PI.sqrt() * self.sigma_elevation(z) / self.beam_power(z);
                h.powi(-3) * self.axial_energy(0) * dz * across * up
            }
            ScatterMode::Voxel => {
                let same = |distance: f64| (1.0 - distance / h).max(0.0);
                let pair = |m: usize| if m == 0 { 1.0 } else { 2.0 };
                let phase = self.scene.probe.phase_per_mm() * dz;
                let axial: f64 = (0..2 * self.axial_taps.len())
                    .map(|m| {
                        let m_dz = m as f64;
                        let carrier = (phase * m_dz).cos() * same(m_dz * dz);
                        pair(m) * carrier * self.axial_energy(m)
                    })
                    .sum();
                let taps = lateral_taps(self.lateral_lines(z));
                let pitch = self.scene.probe.line_pitch(z);
                let lateral: f64 = (0..2 * taps.len())
                    .map(|m| pair(m) * same(m as f64 * pitch) * autocorrelation(&taps, m))
                    .sum();
                let sigma = self.sigma_elevation(z);
                let layers: f64 = self.elevations().map(|y| (-y * y / (sigma * sigma)).exp()).sum();
                // Voxels far longer than the pulse have almost no energy at the carrier frequency; they may
                // be dark rather than amplified without limit.
                axial.max(0.01 * self.axial_energy(0)) * lateral * layers.max(1e-12)
            }
        };
        self.speckle_target() / energy.sqrt()
    }

    /// The factor on a point's stated amplitude at depth `z`, before compensation: like
    /// scatterers it brightens where the beam is narrow, 1/sqrt(sigma_x sigma_e), and shows its
    /// stated amplitude at the transmit focus. sigma_e is taken there too: where the lens focuses
    /// at another depth, points between the two foci are brighter than stated.
    pub fn point_gain(&self, z: f64) -> f64 {
        let area = |z| self.sigma_lateral(z) * self.sigma_elevation(z);
        (area(self.scene.probe.focus) / area(z)).sqrt()
    }

    /// Mean and standard deviation of a tissue's amplitudes in the voxel grid, scaled such that the power
    /// v (1 + k^2) is its echogenicity, with v = rho (sigma^2 + mu^2) - (rho mu)^2 |Phi|^2: the
    /// carrier kills what repeats from voxel to voxel. Phi is the characteristic function of the
    /// uniform position inside a sample; k is the depth of the low-frequency texture of unit variance.
    pub fn scatterer_amplitudes(&self, tissue: &Tissue) -> (f64, f64) {
        let probe = &self.scene.probe;
        let phi = sinc(2.0 * probe.frequency * probe.sample_pitch() / probe.speed);
        let rho = tissue.density_of_scatterers * self.scene.simulation.thinning();
        let m = tissue.mean_over_sigma;
        let variance = rho * (1.0 + m * m) - (rho * m * phi).powi(2);
        let power = amplitude(tissue.echogenicity).powi(2);
        if variance <= 0.0 || power == 0.0 {
            return (0.0, 0.0);
        }
        let sigma = (power / (variance * (1.0 + tissue.texture_depth.powi(2)))).sqrt();
        (m * sigma, sigma)
    }

    /// Level of all surface echoes, linear.
    pub fn surface_level(&self) -> f64 {
        amplitude(self.scene.simulation.surface_gain)
    }
}

#[cfg(test)]
mod tests {
    use super::Calibration;
    use crate::probe::Probe;
    use crate::scene::{Scene, Tissue};

    /// Less transmit power lowers the echoes; the noise that is shown stays the same.
    #[test]
    fn with_less_power_echoes_sink_into_the_same_noise() {
        let mut scene =
            Scene::homogeneous(Tissue::shipped("liver").expect("shipped"), Probe::linear());
        let shown = |scene: &Scene| {
            let calibration = Calibration::new(scene);
            let gain = calibration.display_gain();
            [gain, calibration.noise() * gain].map(|v| 20.0 * v.log10())
        };
        let [echo, noise] = shown(&scene);
        scene.imaging.power = -9.0;
        let [weaker, same] = shown(&scene);
        approx::assert_abs_diff_eq!(weaker - echo, -9.0, epsilon = 1e-9);
        approx::assert_abs_diff_eq!(same, noise, epsilon = 1e-9);
        // If the gain compensates for the lower power, the noise is brighter.
        scene.imaging.gain += 9.0;
        let [back, brighter] = shown(&scene);
        approx::assert_abs_diff_eq!(back, echo, epsilon = 1e-9);
        approx::assert_abs_diff_eq!(brighter - noise, 9.0, epsilon = 1e-9);
    }
}
