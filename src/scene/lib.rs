//! Settings, scene files, meshes, motion, probes, acquired volumes: what is imaged, and by which probe. It knows no Vulkan.

#![warn(missing_docs)]

use insonify_base::{issue, output};

pub mod live;
pub mod probe;
pub mod scene;
pub mod settings;
pub mod volume;
