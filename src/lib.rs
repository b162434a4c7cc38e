//! insonify: real-time ultrasound by Monte-Carlo path tracing on Vulkan.
//!
//! `scene` and `probe` describe the anatomy and the instrument; `gpu` knows Vulkan and no ultrasound;
//! `sim` is the frame, `view` the window, `cli` the command line. Units: mm, microseconds, MHz.

// The command line names what everybody else does.
extern crate self as insonify;

pub mod cli;

pub use insonify_base::{issue, random, statistics};
pub use insonify_gpu as gpu;
pub use insonify_lab::{
    acquire, dataset, doppler, exam, exchange, igtl, import, matching, output, register, strain,
    study, teach,
};
pub use insonify_scene::{live, probe, scene, settings, volume};
pub use insonify_sim as sim;
#[cfg(feature = "window")]
pub use insonify_window as view;
