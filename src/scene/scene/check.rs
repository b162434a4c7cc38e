//! Checks of meshes and scenes: their faults, and facts worth knowing.

mod coincident;
mod enclosing;
mod fusion;
mod mesh;
mod nodes;
mod report;
mod seen;
mod starts;

pub use mesh::{Facts, SENSIBLE_SIZE};
pub(super) use mesh::{examine, examine_shape};
pub use report::{Report, counted, report, tally};
