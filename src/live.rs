//! Live quality: with how many lines, layers, samples and paths a frame is made while something moves, so
//! that a device keeps its budget of time; at rest the frame is the scene's own again.
//!
//! Nothing here knows a device: [`Ladder`] says what there is to choose from, [`Governor`] chooses from the
//! times that frames took.

mod governor;
mod ladder;

pub use governor::Governor;
pub use ladder::{Ladder, Level};
