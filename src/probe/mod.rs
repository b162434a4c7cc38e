//! The transducer: its face, rays, beam widths. Knows no Vulkan.

pub mod beam;
pub mod face;
pub mod transducer;

pub use transducer::{Kind, MAX_ELEVATION_LAYERS, Probe};
