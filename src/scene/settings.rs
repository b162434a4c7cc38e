//! Everything of a scene that can be set: each setting is a field with its row, and a row stands in one place.
//!
//! Reading and writing scene files, `--set`, undo, the console, parameter studies, matching and the tables of
//! `docs/scenes.md` are loops over the rows. Knows no file, no window and no kernel.

mod exam;
mod field;
mod fusion;
mod grey;
mod group;
mod imaging;
mod key;
mod probe;
mod simulation;
pub mod suggest;
mod surface;
mod tissue;
pub mod units;
mod value;
mod words;

pub use exam::Exam;
pub use field::Field;
pub use fusion::{Blend, Display, Fusion, MaskSpeed, Surroundings};
pub use grey::GreyMap;
pub(crate) use group::group;
pub use imaging::{Imaging, Live, Machine};
pub use key::{Facts, Form, Group, Off, Row};
pub use probe::{Kind, MAX_ELEVATION_LAYERS, MAX_SCANLINES, Probe};
pub use simulation::{
    Coherence, Loss, Quality, Refraction, Sampling, ScatterMode, Sequence, Simulation, TextureSpace,
};
pub use surface::Surface;
pub use tissue::Tissue;
pub use value::{Value, plain};
pub use words::Words;
pub(crate) use words::words;

/// Settings of imaging: those that presets, parameter studies, qualities and the console set alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Transducer and its geometry.
    pub probe: Probe,
    /// Path tracing and scatterers.
    pub simulation: Simulation,
    /// Image formation.
    pub imaging: Imaging,
}

impl Settings {
    /// The defaults, for a probe.
    pub fn of(probe: Probe) -> Self {
        Self { probe, simulation: Simulation::default(), imaging: Imaging::default() }
    }

    /// Scales the lattice with the wavelength, as in scene files: else speckle would lose its scatterers.
    /// `before` is the frequency that the cell suited, MHz.
    pub fn follow_frequency(&mut self, before: f64) {
        let frequency = self.probe.frequency;
        if frequency != before {
            let crowding = self.simulation.crowding();
            let cell = self.simulation.cell * crowding * before / frequency;
            self.simulation.cell = Simulation::clamped("cell", cell) / crowding;
        }
    }

    /// Sets [`Simulation::density_scale`]; cells shrink where there would be too few of them.
    pub fn set_density_scale(&mut self, scale: f64) {
        self.simulation.cell *= self.simulation.crowding();
        self.simulation.density_scale = scale;
        self.simulation.cell /= self.simulation.crowding();
    }
}
