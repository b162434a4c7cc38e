//! The Vulkan layer: devices, memory, kernels, commands, timers, acceleration structures.
//!
//! It knows nothing of ultrasound, and it is the only crate of the workspace that contains `unsafe`.
//! Rules that hold throughout:
//! - one compute queue; every submission first waits (on the device) for the one before it, so a
//!   buffer needs no copy per frame unless the CPU writes it;
//! - images stay in the GENERAL layout and barriers name two stages, so nothing tracks layouts;
//! - layouts of descriptors and push constants come from the SPIR-V and every dispatch is checked
//!   against them;
//! - everything that a submission uses is kept alive until its fence has been waited for.

// Here alone: Cargo.toml denies it.
#![allow(unsafe_code)]
#![warn(missing_docs)]
// Queues and submissions for a window are part of the device, whether or not there are windows.
#![cfg_attr(not(feature = "window"), allow(dead_code))]

mod accel;
mod adapter;
mod ahead;
mod barrier;
mod blas;
mod build_times;
#[cfg(feature = "window")]
mod canvas;
mod commands;
mod descriptors;
mod device;
mod dynamic;
mod error;
mod frames;
mod image;
mod instance;
mod kept;
mod kernel;
mod memory;
#[cfg(feature = "window")]
mod overlay;
#[cfg(feature = "window")]
mod painter;
mod pieces;
mod pipelines;
mod process;
mod queues;
mod reflect;
#[cfg(feature = "window")]
mod surface;
#[cfg(feature = "window")]
mod swapchain;
mod timer;
mod tlas;
mod transfer;
mod workgroup;

pub use adapter::{AdapterKind, DeviceInfo, Found, list_devices};
pub use ahead::{compile_standard_input, set_compiler, try_kernel};
pub use barrier::Stage;
pub use blas::{Blas, BlasInput, BlasOptions};
pub use build_times::{BuildTimes, RefitTimes, build_times, refit_times};
#[cfg(feature = "window")]
pub use canvas::{InterfaceFrame, PlacedImage, Screenshot, picture};
pub use commands::{Binding, Commands};
pub use device::{
    Device, DeviceOptions, Limits, LoneDevice, TestDevice, lone_device, lone_test_device,
    test_device,
};
pub use dynamic::{DynamicBlas, DynamicSource};
pub use error::GpuError;
pub use frames::{Abandon, FRAMES_IN_FLIGHT, Frames};
pub use image::{AddressMode, Filter, Image, ImageDim, ImageFormat, Sampler};
pub use instance::ValidationLog;
pub use kept::cache_folder;
pub use kernel::Kernel;
pub use memory::{Buffer, BufferKind, MemoryUse};
#[cfg(feature = "window")]
pub use painter::{Painted, Painter};
pub use process::{
    driver_environment, end_without_drivers, peak_bytes, prepare_process, unreadable_pad,
};
pub use reflect::{BindingInfo, BindingKind};
pub use timer::FrameTimings;
pub use tlas::{Tlas, TlasInstance};

// Tests here skip as those in tests/ do.
#[cfg(test)]
#[path = "../../tests/common/skip.rs"]
mod skip;
