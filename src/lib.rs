//! insonify: real-time ultrasound by Monte-Carlo path tracing on Vulkan.
//!
//! `scene` and `probe` describe the anatomy and the instrument; `gpu` knows Vulkan and no ultrasound;
//! `sim` is the frame, `view` the window. Units: mm, microseconds, MHz.

// For the library's public items: tools and tests have none.
#![warn(missing_docs)]

pub mod acquire;
pub mod dataset;
pub mod exam;
pub mod exchange;
pub mod gpu;
pub mod igtl;
pub mod import;
pub mod issue;
pub mod live;
pub mod matching;
pub mod output;
pub mod probe;
pub mod random;
pub mod register;
pub mod scene;
pub mod settings;
pub mod sim;
pub mod statistics;
pub mod study;
pub mod teach;
#[cfg(feature = "window")]
pub mod view;
pub mod volume;

// Tests here skip as those in tests/ do.
#[cfg(test)]
#[path = "../tests/common/skip.rs"]
mod skip;
