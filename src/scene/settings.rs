//! Everything of a scene that can be set: each setting is a field with its row, and a row stands in one place.
//!
//! Reading and writing scene files, `--set`, undo, the console, parameter studies, matching and the tables of
//! `docs/scenes.md` are loops over the rows. Knows no file, no window and no kernel.

mod doppler;
mod exam;
mod field;
mod fusion;
mod grey;
mod group;
mod imaging;
mod key;
mod probe;
mod processing;
mod simulation;
mod spectral;
mod strain;
pub mod suggest;
mod surface;
mod tissue;
mod tissue_doppler;
pub mod units;
mod value;
mod words;

pub use doppler::{Doppler, VelocityMap, WallFilter};
pub use exam::Exam;
pub use field::Field;
pub use fusion::{Blend, Display, Fusion, MaskSpeed, Surroundings};
pub use grey::GreyMap;
pub(crate) use group::group;
pub use imaging::{Imaging, Live, Machine};
pub use key::{Facts, Form, Group, Off, Row};
pub use probe::{MAX_ELEVATION_LAYERS, MAX_SCANLINES, Probe, ProbeKind};
pub use processing::Processing;
pub use simulation::{
    Coherence, Loss, Quality, Refraction, Sampling, ScatterMode, Sequence, Simulation, TextureSpace,
};
pub use spectral::{Spectral, Wave};
pub use strain::Strain;
pub use surface::Surface;
pub use tissue::Tissue;
pub use tissue_doppler::TissueDoppler;
pub use value::{Value, plain};
pub use words::Words;
pub(crate) use words::words;

/// What is done with each group of [`Settings`].
pub trait Visitor {
    /// Does it with one of them.
    fn visit<T: Group>(&mut self, group: Member<T>);
}

/// A group of [`Settings`], as a field of any of them.
pub struct Member<T> {
    /// The group of these settings.
    pub of: fn(&Settings) -> &T,
    /// The same, to be changed.
    pub of_mut: fn(&mut Settings) -> &mut T,
}

macro_rules! settings {
    ($(#[$probe_doc:meta])+ $probe:ident: $probe_of:ty; $($(#[$doc:meta])+ $field:ident: $of:ty;)+) => {
        /// Settings of imaging: those that presets, parameter studies, qualities and the console set alike.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Settings {
            $(#[$probe_doc])+ pub $probe: $probe_of,
            $($(#[$doc])+ pub $field: $of,)+
        }

        impl Settings {
            /// The tables of scene files that have them.
            pub const TABLES: &'static [&'static str] =
                &[<$probe_of as Group>::TABLE, $(<$of as Group>::TABLE),+];

            /// The defaults, for a probe.
            pub fn of($probe: $probe_of) -> Self {
                Self { $probe, $($field: <$of>::default(),)+ }
            }

            /// Does something with each group, in the order of [`Self::TABLES`].
            pub fn each(visitor: &mut impl Visitor) {
                visitor.visit(Member { of: |s| &s.$probe, of_mut: |s| &mut s.$probe });
                $(visitor.visit(Member { of: |s| &s.$field, of_mut: |s| &mut s.$field });)+
            }
        }
    };
}

// The first one, without which there are no settings, and those that have defaults.
settings! {
    /// Transducer and its geometry.
    probe: Probe;
    /// Path tracing and scatterers.
    simulation: Simulation;
    /// Image formation.
    imaging: Imaging;
    /// The display chain.
    processing: Processing;
    /// Colour Doppler.
    doppler: Doppler;
    /// Spectral Doppler.
    spectral: Spectral;
    /// Tissue Doppler.
    tissue_doppler: TissueDoppler;
    /// Strain.
    strain: Strain;
}

impl Settings {
    /// Tables of modes besides the image, of which the image itself shows nothing.
    pub const MODES: [&str; 4] =
        [Doppler::TABLE, Spectral::TABLE, TissueDoppler::TABLE, Strain::TABLE];

    /// The same with the defaults of [`Self::MODES`]: what the image itself depends on.
    pub fn of_image(&self) -> Self {
        Self {
            doppler: Doppler::default(),
            spectral: Spectral::default(),
            tissue_doppler: TissueDoppler::default(),
            strain: Strain::default(),
            ..self.clone()
        }
    }

    /// The value of a key of a table; none where the table is not among these or has no such key.
    pub fn value(&self, table: &str, key: &str) -> Option<Value> {
        struct Find<'s> {
            settings: &'s Settings,
            table: &'s str,
            key: &'s str,
            found: Option<Value>,
        }
        impl Visitor for Find<'_> {
            fn visit<T: Group>(&mut self, group: Member<T>) {
                if T::TABLE == self.table {
                    let value = |row: &Row<T>| (row.get)((group.of)(self.settings));
                    self.found = T::row(self.key).map(value);
                }
            }
        }
        let mut find = Find { settings: self, table, key, found: None };
        Self::each(&mut find);
        find.found
    }

    /// The tables as scene files write them: `[probe]`.
    pub fn tables() -> Vec<String> {
        Self::TABLES.iter().map(|table| format!("[{table}]")).collect()
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
