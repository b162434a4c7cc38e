//! The frame: scene and probe to B-mode image on the device.

pub mod bvh;
pub mod calibration;
pub mod layout;
pub mod placement;
pub mod shaders;
pub mod special;
pub mod tables;
pub mod tracer;
pub mod world;
