//! Animation: placements and shapes as functions of time, in seconds.

pub mod clock;
pub mod fetal;
pub mod motion;
pub mod sequence;
pub mod track;

pub use clock::{Clock, Loop};
pub use fetal::Fetal;
pub use motion::{Motion, Turn};
pub use sequence::{Interpolation, Sequence};
pub use track::{Channel, Curve, Track, TrackError, Trs};

/// Tolerance of instants, in s or in periods: a time that falls short of an instant by no more than this
/// counts as the instant. The time of frame i is i over the frame rate, rounded, and a change that is due on
/// that frame must not come one frame late.
pub const EDGE: f64 = 1e-9;
