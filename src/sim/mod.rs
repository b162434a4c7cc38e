//! The frame: scene and probe to B-mode image on the device.

pub mod bvh;
pub mod layout;
