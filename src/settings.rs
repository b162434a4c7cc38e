//! Everything of a scene that can be set: each setting is a field with its row, and a row stands in one place.
//!
//! Reading and writing scene files, `--set`, undo, the console, parameter studies, matching and the tables of
//! `docs/scenes.md` are loops over the rows. Knows no file, no window and no kernel.

mod field;
mod fusion;
mod imaging;
mod key;
mod probe;
mod simulation;
pub mod suggest;
mod surface;
mod tissue;
pub mod units;
mod words;

pub use field::Field;
pub use fusion::{Blend, Display, Fusion, MaskSpeed, Surroundings};
pub use imaging::{Imaging, Live, Machine};
pub use key::{Facts, Form, Group, Off, Row, Value, plain};
pub use probe::{Kind, MAX_ELEVATION_LAYERS, Probe};
pub use simulation::{
    Coherence, Quality, Refraction, Sampling, ScatterMode, Sequence, Simulation, TextureSpace,
};
pub use surface::Surface;
pub use tissue::Tissue;
pub use words::Words;
pub(crate) use words::words;
