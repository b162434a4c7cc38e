//! Path tracing and scatterers.

use super::group;
use super::imaging::Machine;
use super::key::Group;
use super::units::{LENGTH, LEVEL};
use super::words;

const INF: f64 = f64::INFINITY;
const OFF: f64 = f64::NEG_INFINITY;
/// Upper limit of levels, dB; there is no lower one, as minus infinity switches them off.
const LOUDEST: f64 = 200.0;

words! {
    /// The scheme by which paths are followed.
    pub enum Sampling {
        /// The transmitted path always continues; reflected branches are spawned. Our default, a
        /// stand-in for the adaptive scheme of Mattausch et al. 2018.
        MainPath = "main-path",
        /// N independent paths, one stochastic choice per interaction (S0, the paper's text).
        Plain = "plain",
        /// One shared primary, split into N paths at the first interaction (S1).
        SharedPrimary = "shared-primary",
    }
}

words! {
    /// The source of the paths' random numbers.
    pub enum Sequence {
        /// A Sobol sequence over the paths, Owen-scrambled: less noise with as many paths.
        Sobol = "sobol",
        /// Independent numbers.
        Random = "random",
    }
}

words! {
    /// The effect of a surface's thickness on the phase of its echo.
    pub enum Coherence {
        /// Coherent part at the surface, the rest as static speckle; energy independent of N.
        Split = "split",
        /// Every echo at its displaced point with weight 1/N, as the paper describes.
        Coherent = "coherent",
    }
}

words! {
    /// The slope by which a path refracts at a surface.
    pub enum Refraction {
        /// The mean slope over the width of the wavefront that forms the image behind it.
        Beam = "beam",
        /// The slope where the ray meets it, geometric acoustics.
        Ray = "ray",
    }
}

words! {
    /// The losses that count on the way to a target.
    pub enum Loss {
        /// The mean over the aperture that converges on it: shadows and borders have penumbras.
        Beam = "beam",
        /// Those that the scanline alone meets.
        Ray = "ray",
    }
}

words! {
    /// The model of the scatterers.
    pub enum ScatterMode {
        /// One point scatterer per cell of a lattice fixed to the tissue.
        Lattice = "lattice",
        /// Equally spaced samples looked up in a voxel grid, lateral convolution afterwards (paper).
        Voxel = "voxel",
    }
}

words! {
    /// The frame in which the scatterer lattice rests.
    pub enum TextureSpace {
        /// The tissue: speckle moves with the anatomy and, if keyframes share their topology,
        /// deforms with it.
        Tissue = "tissue",
        /// The instance: speckle moves with it as a whole; an anatomy that changes its shape slides through it.
        Object = "object",
        /// The world: anatomy slides through the speckle, as in the paper.
        World = "world",
    }
}

group! {
    /// Path tracing and scatterers.
    pub struct Simulation in "simulation" {
        /// Paths of each scanline and elevation layer.
        paths: u32 = 8,
            Facts::whole(1, 65_535).label("Paths").usual(1.0, 128.0);
        /// The transmitted path always continues and reflections branch off; independent paths, each choosing at
        /// random; or one path to the first interface, independent ones from there.
        sampling: Sampling = Sampling::MainPath,
            Facts::word::<Sampling>().under("Paths").label("Sampling");
        /// The paths' random decisions: an Owen-scrambled Sobol sequence over the paths, less noise with as many of
        /// them; or independent numbers.
        sequence: Sequence = Sequence::Sobol,
            Facts::word::<Sequence>().under("Paths").label("Sequence");
        /// Most interfaces that one path meets, transmissions included.
        max_interactions: u32 = 32,
            Facts::whole(1, 256).under("Paths").label("Interactions").usual(1.0, 64.0);
        /// Most reflections of one path.
        max_reflections: u32 = 3,
            Facts::whole(0, 256).under("Paths").label("Reflections").usual(0.0, 16.0);
        /// Paths of less weight end; a path starts with 1. The main path goes on without echoes, as far as its own beam
        /// is concerned (`loss`).
        min_weight: f64 = 1e-6,
            Facts::number(0.0, 1.0).under("Paths").label("Least weight").usual(1e-9, 1e-2);
        /// Echo of a thick surface: a coherent part at the surface and the rest as static speckle; or every path at
        /// its own displaced point.
        coherence: Coherence = Coherence::Split,
            Facts::word::<Coherence>().under("Paths").label("Coherence");
        /// Refract at the rough surface's sampled normal, not at the smooth one.
        rough_transmission: bool = false,
            Facts::switch().under("Paths").label("Rough refraction");
        /// Paths that return to the probe's face bounce off it and are an echo themselves (reverberation). Off: they
        /// end there. Phased probes have no face.
        face_reflection: bool = false,
            Facts::switch().under("Paths").label("Face reflects");
        /// A curved interface reflects by its mean over the beam's width. Off: as the single ray meets it, geometric
        /// acoustics.
        beam_footprint: bool = true,
            Facts::switch().under("Paths").label("Footprint");
        /// `"beam"`: a surface refracts by its mean slope over the width of the wavefront that forms the image behind it,
        /// as wide as the aperture near the face, so that bumps and edges smaller than that do not steer. `"ray"`: by
        /// its slope where the ray meets it, geometric acoustics.
        refraction: Refraction = Refraction::Beam,
            Facts::word::<Refraction>().under("Paths").label("Refraction");
        /// `"beam"`: what absorption and reflection take away counts by the part of the aperture that it lies in front of, so
        /// that shadows have penumbras as wide as sound makes them. `"ray"`: what the scanline alone meets. Paths that do
        /// not start alike, or choose their way at random, are rays.
        loss: Loss = Loss::Beam,
            Facts::word::<Loss>().under("Paths").label("Loss");
        /// Standard deviation of the paths' lateral start about the scanline.
        origin_jitter: f64 = 0.0,
            Facts::quantity(&LENGTH, 0.0, 100.0).under("Paths").label("Origin jitter").usual(0.0, 2.0);
        /// Exponent of the cosine lobe about the scanline in which paths start; `inf`: all along it.
        emission_lobe: f64 = INF,
            Facts::number(1.0, INF).under("Paths").label("Emission lobe").usual(1.0, 10_000.0).off(INF, "off");
        /// Standard deviation of the weight of echoes by their distance from the straight scanline, where refraction
        /// and reflection lead; `inf`: all count alike.
        beam_width: f64 = INF,
            Facts::quantity(&LENGTH, 0.01, INF).under("Paths").label("Beam width").usual(0.1, 10.0).off(INF, "off");
        /// Point scatterers in a lattice's cells, each summed over the beam; or a voxel grid sampled along the ray
        /// and convolved laterally.
        scatter_mode: ScatterMode = ScatterMode::Lattice,
            Facts::word::<ScatterMode>().label("Lookup");
        /// Edge of a lattice cell or voxel.
        cell: f64 = 0.15,
            Facts::quantity(&LENGTH, 0.01, 10.0).by_default("1.05 mm / frequency in MHz")
                .label("Cell").usual(0.05, 1.0);
        /// Scatterers per resolution cell (the volume that the pulse and the beam hold at once) down to which the
        /// lattice is thinned where it holds more, by coarser lattices; level and statistics stay. Tissue that is
        /// sparser by itself stays so: the kurtosis of its intensities falls by at most 0.11. 0: nothing is thinned, and
        /// nothing under the display's black is left out.
        scatterers_per_resolution_cell: f64 = 8.0,
            Facts::number(0.0, 1000.0).label("Scatterers").usual(0.0, 64.0);
        /// Frame in which scatterers rest. `"tissue"`: they move with their mesh and, where its keyframes share
        /// their topology, follow its deformation. `"object"`: they move with the mesh as a whole; a mesh that changes its
        /// shape slides through them. `"world"`: all anatomy slides through them.
        texture_space: TextureSpace = TextureSpace::Tissue,
            Facts::word::<TextureSpace>().label("Texture in");
        /// Reflected paths below this level, attenuation made up for, carry no speckle.
        volume_floor: f64 = -50.0,
            Facts::quantity(&LEVEL, OFF, LOUDEST).under("Paths").label("Speckle floor").usual(-100.0, 0.0).off(OFF, "none");
        /// Reflected paths that begin below this level, attenuation made up for, are followed by chance (Russian
        /// roulette): the fainter the rarer, and each for as many as it stands for, so that levels stay. `-inf`: all
        /// are followed.
        branch_floor: f64 = -35.0,
            Facts::quantity(&LEVEL, OFF, LOUDEST).under("Paths").label("Branch floor").usual(-100.0, 0.0).off(OFF, "none");
        /// Level of all speckle; at 0 dB liver lies 45 dB under a perfect mirror.
        speckle_gain: f64 = 0.0,
            Facts::quantity(&LEVEL, OFF, LOUDEST).label("Speckle").usual(-30.0, 30.0);
        /// Level of all surface echoes.
        surface_gain: f64 = 0.0,
            Facts::quantity(&LEVEL, OFF, LOUDEST).label("Surfaces").usual(-30.0, 30.0);
        /// Factor on the scatterers per volume of every tissue: below 1 they are thinned out
        /// (`density_of_scatterers`), above 1 `cell` is divided by its cube root. Brightness stays; a frame takes that
        /// much longer.
        density_scale: f64 = 1.0,
            Facts::number(0.001, 100.0).label("Density").usual(0.1, 4.0);
        /// Factor on the `roughness` of every surface.
        roughness_scale: f64 = 1.0,
            Facts::number(1e-6, 1e6).label("Roughness").usual(0.1, 10.0);
        /// Factor on the `thickness` of every surface.
        thickness_scale: f64 = 1.0,
            Facts::number(0.0, 100.0).label("Thickness").usual(0.0, 5.0);
        /// Frames also say what each sample and each pixel shows (labels.md): tissue and mesh that are there and that
        /// are seen, where that is, what the sound has lost, how tissue has moved. `render --labels` writes it.
        labels: bool = false,
            Facts::switch().under("Paths").label("Labels");
        /// Labels have the expected level of echoes and its share of reverberation, too. Off: these two are left out,
        /// and what most of the labels' time goes into, tracing the frame a second time.
        label_levels: bool = true,
            Facts::switch().under("Paths").label("Their levels");
        /// Seed of every random number.
        seed: u32 = 1,
            Facts::whole(0, u32::MAX).limits("32 bits").under("Paths").label("Seed").usual(0.0, 1000.0);
    }
}

words! {
    /// A preset of quality: the work per frame.
    #[derive(clap::ValueEnum)]
    pub enum Quality {
        /// A first look. Software driver: 2 paths, 5 scatterers per resolution cell. GPU: 8 paths, 8 scatterers.
        Draft = "draft",
        /// Software driver: 8 paths, 8 scatterers per resolution cell. GPU: 32 paths, 16 scatterers.
        Standard = "standard",
        /// A proof, on any device: 128 paths, lattice cells 2/3 as long, no scatterer left out.
        Reference = "reference",
    }
}

impl Simulation {
    /// Default edge of a lattice cell, mm, at `frequency` MHz: proportional to the wavelength, 0.15 mm at 7 MHz,
    /// up to the largest edge that a scene file may give.
    pub fn default_cell(frequency: f64) -> f64 {
        (1.05 / frequency).min(10.0)
    }

    /// True if frames have labels, and these have levels.
    pub fn levelled(&self) -> bool {
        self.labels && self.label_levels
    }

    /// True if the paths of a scanline are one path up to its reflections, which then stands for all of them.
    pub fn has_one_main_path(&self) -> bool {
        self.sampling == Sampling::MainPath
            && self.origin_jitter <= 0.0
            && self.emission_lobe == INF
            && !self.rough_transmission
    }

    /// True if losses count by the part of the aperture that they lie in front of.
    pub fn loses_by_aperture(&self) -> bool {
        self.loss == Loss::Beam && self.has_one_main_path()
    }

    /// Share of its scatterers that a tissue keeps, 0..=1.
    pub fn thinning(&self) -> f64 {
        self.density_scale.min(1.0)
    }

    /// The factor by which a cell's edge is smaller than without [`Self::density_scale`]: a cell holds one
    /// scatterer at most, so more scatterers need more cells.
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
        // The edge of a voxel changes the texture, not the cost: there is one lookup per sample for any edge.
        if self.scatter_mode == ScatterMode::Lattice {
            self.cell *= cell;
        }
    }

    /// Like [`Self::set_quality`], but for the keys at these paths (`simulation.paths`), which the user set by hand.
    pub fn set_quality_except<'p>(
        &mut self,
        quality: Quality,
        machine: Machine,
        by_hand: impl Iterator<Item = &'p str>,
    ) {
        let own = self.clone();
        self.set_quality(quality, machine);
        for path in by_hand {
            let key = path.strip_prefix(Self::TABLE).and_then(|key| key.strip_prefix('.'));
            if let Some(row) = key.and_then(Self::row) {
                (row.set)(self, &(row.get)(&own));
            }
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
