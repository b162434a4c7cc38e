//! The transducer: its face, rays, beam widths. Knows no Vulkan.

pub mod beam;
pub mod face;
mod transducer;

pub use crate::settings::{MAX_ELEVATION_LAYERS, MAX_SCANLINES, Probe, ProbeKind};
