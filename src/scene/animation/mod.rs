//! What moves: placements and shapes as functions of time, in seconds.

pub mod track;

pub use track::{Channel, Curve, Track, TrackError, Trs};
