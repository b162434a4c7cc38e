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

/// What is done with each group of [`Settings`].
pub trait Visitor {
    /// Does it with one of them.
    fn visit<T: Group>(&mut self, group: &T);
}

macro_rules! settings {
    ($($(#[$doc:meta])+ $field:ident: $of:ty;)+) => {
        /// Settings of imaging: those that presets, parameter studies, qualities and the console set alike.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Settings {
            $($(#[$doc])+ pub $field: $of,)+
        }

        impl Settings {
            /// The tables of scene files that have them.
            pub const TABLES: &'static [&'static str] = &[$(<$of as Group>::TABLE),+];

            /// Does something with each group, in the order of [`Self::TABLES`].
            pub fn each(&self, visitor: &mut impl Visitor) {
                $(visitor.visit(&self.$field);)+
            }
        }
    };
}

settings! {
    /// Transducer and its geometry.
    probe: Probe;
    /// Path tracing and scatterers.
    simulation: Simulation;
    /// Image formation.
    imaging: Imaging;
}

impl Settings {
    /// The defaults, for a probe.
    pub fn of(probe: Probe) -> Self {
        Self { probe, simulation: Simulation::default(), imaging: Imaging::default() }
    }

    /// The value of a key of a table; none where the table is not among these or has no such key.
    pub fn value(&self, table: &str, key: &str) -> Option<Value> {
        struct Find<'k> {
            table: &'k str,
            key: &'k str,
            found: Option<Value>,
        }
        impl Visitor for Find<'_> {
            fn visit<T: Group>(&mut self, group: &T) {
                if T::TABLE == self.table {
                    self.found = T::row(self.key).map(|row| (row.get)(group));
                }
            }
        }
        let mut find = Find { table, key, found: None };
        self.each(&mut find);
        find.found
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
