//! The transducer: element positions, rays, beam widths. Knows no Vulkan.

pub mod beam;
pub mod transducer;

pub use transducer::{Kind, Probe};
