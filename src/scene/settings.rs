//! What a scene file sets besides anatomy: path tracing, scatterers, image formation.

/// Which paths are followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The transmitted path always continues; reflected branches are spawned. Our default, a
    /// stand-in for the adaptive scheme of Mattausch et al. 2018.
    MainPath,
    /// N independent paths, one stochastic choice per interaction (S0, the paper's text).
    Plain,
    /// One shared primary, split into N paths at the first interaction (S1).
    SharedPrimary,
}

/// Where the paths' random decisions come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sequence {
    /// A Sobol sequence over the paths, Owen-scrambled: less noise with as many paths.
    Sobol,
    /// Independent numbers.
    Random,
}

/// What thickness does to the phase of a surface echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coherence {
    /// Coherent part at the surface, the rest as static speckle; energy independent of N.
    Split,
    /// Every echo at its displaced point with weight 1/N, as the paper describes.
    Coherent,
}

/// Where scatterers come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScatterMode {
    /// One point scatterer per cell of a lattice fixed to the tissue.
    Lattice,
    /// Equally spaced samples looked up in a voxel grid, lateral convolution afterwards (paper).
    Voxel,
}

/// To what the scatterer lattice is fixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TextureSpace {
    /// To the tissue: speckle moves with the anatomy and, where keyframes share their topology,
    /// deforms with it.
    Tissue,
    /// To the instance: speckle moves with it as a whole; what changes its shape slides through it.
    Object,
    /// To the world: anatomy slides through the speckle, as in the paper.
    World,
}

/// Path tracing and scatterers.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Path samples N per (scanline, elevation layer), at least 1.
    pub paths: u32,
    /// Sampling scheme.
    pub sampling: Sampling,
    /// Where their random decisions come from.
    pub sequence: Sequence,
    /// Most interactions of one path (B_max), transmissions included: an abdominal wall alone has
    /// nine interfaces.
    pub max_interactions: u32,
    /// Most reflections of one path.
    pub max_reflections: u32,
    /// Paths lighter than this end.
    pub min_weight: f64,
    /// Coherence of thick surfaces.
    pub coherence: Coherence,
    /// Whether transmitted rays refract at the sampled micro-normal (off: at the smooth normal).
    pub rough_transmission: bool,
    /// Whether a reflected path that returns to the transducer's face bounces off it.
    pub face_reflection: bool,
    /// Whether a curved surface reflects by its mean over the beam's lateral width (off: as the ray
    /// meets it, geometric acoustics).
    pub beam_footprint: bool,
    /// Standard deviation of the lateral origin jitter, mm.
    pub origin_jitter: f64,
    /// Exponent of the cosine lobe about the scanline in which paths start; infinity: along it.
    pub emission_lobe: f64,
    /// Standard deviation, mm, of the weight of echoes off the geometric scanline, where refraction
    /// and reflection lead; infinity: all count alike.
    pub beam_width: f64,
    /// Scatterer mode.
    pub scatter_mode: ScatterMode,
    /// Edge of a lattice cell or voxel, mm.
    pub cell: f64,
    /// Scatterers per resolution cell down to which lattices are thinned, where they hold more: those of
    /// tissue that is sparser stay. 0 thins nothing.
    pub scatterers_per_resolution_cell: f64,
    /// What the lattice is fixed to.
    pub texture_space: TextureSpace,
    /// Reflected paths whose attenuation-compensated weight falls below this level, dB, carry no
    /// volume echoes: they would lie under the display's floor.
    pub volume_floor: f64,
    /// Reflected paths that begin below this level, dB, attenuation made up for, are followed by chance, the
    /// rarer the fainter, and count for as many. Minus infinity: all are followed.
    pub branch_floor: f64,
    /// Speckle level, dB relative to the calibration (liver 45 dB under a perfect mirror).
    pub speckle_gain: f64,
    /// Level of all surface echoes, dB.
    pub surface_gain: f64,
    /// Factor on the scatterers per volume of every tissue, more than 0. What exceeds 1 is in
    /// [`Self::cell`] already; below 1 the scatterers are thinned out ([`Self::thinning`]).
    pub density_scale: f64,
    /// Factor on the roughness exponent of every surface, more than 0.
    pub roughness_scale: f64,
    /// Factor on the thickness of every surface.
    pub thickness_scale: f64,
    /// Seed of every random number.
    pub seed: u32,
}

/// Image formation.
#[derive(Clone, Debug, PartialEq)]
pub struct Imaging {
    /// Gain, dB: an echo this far below a perfect mirror is white at zero depth.
    /// e_ref = 10^(-gain/20).
    pub gain: f64,
    /// Displayed dynamic range, dB.
    pub dynamic_range: f64,
    /// Attenuation that the time-gain compensation assumes, dB/(cm MHz).
    pub tgc_attenuation: f64,
    /// Largest compensation, dB.
    pub tgc_limit: f64,
    /// The eight sliders, dB, evenly spaced from face to full depth, interpolated linearly.
    pub tgc_sliders: [f64; 8],
    /// RMS of the electronic noise before TGC, dB relative to a perfect mirror; -inf is off.
    pub noise: f64,
    /// Exponent of the grey map: v^gamma.
    pub grey_gamma: f64,
    /// Scales of the point-spread function: axial, lateral, elevational.
    pub psf_scale: [f64; 3],
    /// Height of the B-mode image, pixels; the width follows from the sector.
    pub image_height: u32,
}

/// How the window and `serve` keep pace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Live {
    /// What an image may take while something moves, s; none: what suits the device.
    pub budget: Option<f64>,
}

impl Live {
    /// The budget, ms: 15 images a second where a software driver does the work, 60 on a GPU, unless the
    /// scene says it.
    pub fn budget_ms(&self, machine: Machine) -> f64 {
        let default = match machine {
            Machine::Software => 0.066,
            Machine::Gpu => 0.016,
        };
        1e3 * self.budget.unwrap_or(default)
    }
}

/// How much work a frame is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// As fast as can be, for trying things out.
    Draft,
    /// What the machine does in reasonable time.
    Standard,
    /// A proof, on any machine: many paths, a fine lattice, the whole slice.
    Reference,
}

/// What does the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Machine {
    /// A software driver: every path and scatterer costs time.
    Software,
    /// A GPU: a frame of few paths leaves most of it idle.
    Gpu,
}

impl Simulation {
    /// Edge of a lattice cell, mm, where nobody says it: it follows the wavelength, 0.15 mm at 7 MHz,
    /// as far as a scene file may say it. `frequency` in MHz.
    pub fn default_cell(frequency: f64) -> f64 {
        (1.05 / frequency).min(10.0)
    }

    /// Share of its scatterers that a tissue keeps, 0..=1.
    pub fn thinning(&self) -> f64 {
        self.density_scale.min(1.0)
    }

    /// By what a cell is smaller than it would be without [`Self::density_scale`]: it holds one
    /// scatterer at most, so more of them need more cells.
    pub fn crowding(&self) -> f64 {
        self.density_scale.max(1.0).cbrt()
    }

    /// Replaces the scene's path and scatterer counts by those of the table in docs/quality.md.
    pub fn set_quality(&mut self, quality: Quality, machine: Machine) {
        let (paths, cell, scatterers, volume_floor, branch_floor) = match (quality, machine) {
            (Quality::Draft, Machine::Software) => (2, 1.0, 5.0, -50.0, -30.0),
            (Quality::Standard, Machine::Software) | (Quality::Draft, Machine::Gpu) => {
                (8, 1.0, 8.0, -50.0, -35.0)
            }
            (Quality::Standard, Machine::Gpu) => (32, 1.0, 16.0, -60.0, -45.0),
            (Quality::Reference, _) => (128, 2.0 / 3.0, 0.0, -80.0, f64::NEG_INFINITY),
        };
        self.paths = paths;
        self.scatterers_per_resolution_cell = scatterers;
        self.volume_floor = volume_floor;
        self.branch_floor = branch_floor;
        // A voxel's edge is a look, not a cost: there is one lookup per sample whatever its size.
        if self.scatter_mode == ScatterMode::Lattice {
            self.cell *= cell;
        }
    }
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            paths: 8,
            sampling: Sampling::MainPath,
            sequence: Sequence::Sobol,
            max_interactions: 32,
            max_reflections: 3,
            min_weight: 1e-6,
            coherence: Coherence::Split,
            rough_transmission: false,
            face_reflection: false,
            beam_footprint: true,
            origin_jitter: 0.0,
            emission_lobe: f64::INFINITY,
            beam_width: f64::INFINITY,
            scatter_mode: ScatterMode::Lattice,
            cell: 0.15,
            scatterers_per_resolution_cell: 8.0,
            texture_space: TextureSpace::Tissue,
            volume_floor: -50.0,
            branch_floor: -35.0,
            speckle_gain: 0.0,
            surface_gain: 0.0,
            density_scale: 1.0,
            roughness_scale: 1.0,
            thickness_scale: 1.0,
            seed: 1,
        }
    }
}

impl Default for Imaging {
    fn default() -> Self {
        Self {
            gain: 16.0,
            dynamic_range: 60.0,
            tgc_attenuation: 0.5,
            tgc_limit: 80.0,
            tgc_sliders: [0.0; 8],
            noise: -116.0,
            grey_gamma: 1.0,
            psf_scale: [1.0; 3],
            image_height: 800,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quality_does_more_than_the_one_before_and_a_gpu_no_less() {
        use Machine::{Gpu, Software};
        let made = |quality, machine| {
            let mut simulation = Simulation::default();
            simulation.set_quality(quality, machine);
            simulation
        };
        let more = |a: &Simulation, b: &Simulation| {
            let scatterers = |s: &Simulation| match s.scatterers_per_resolution_cell {
                0.0 => f64::INFINITY,
                n => n,
            };
            a.paths <= b.paths && a.cell >= b.cell && scatterers(a) <= scatterers(b)
        };
        for machine in [Software, Gpu] {
            let [draft, standard, proof] =
                [Quality::Draft, Quality::Standard, Quality::Reference].map(|q| made(q, machine));
            assert!(more(&draft, &standard) && draft != standard);
            assert!(more(&standard, &proof) && standard != proof);
        }
        let standard = made(Quality::Standard, Software);
        assert_eq!(standard, Simulation::default(), "the defaults suit a software driver");
        assert!(more(&standard, &made(Quality::Standard, Gpu)));
        assert_eq!(made(Quality::Reference, Software), made(Quality::Reference, Gpu));
    }

    #[test]
    fn voxels_keep_their_size() {
        let mut simulation =
            Simulation { scatter_mode: ScatterMode::Voxel, ..Simulation::default() };
        simulation.set_quality(Quality::Reference, Machine::Gpu);
        assert_eq!(simulation.cell, Simulation::default().cell);
    }
}
