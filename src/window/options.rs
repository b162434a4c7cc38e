//! Options of the window.

use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::Arc;

use super::error::Refusal;
use crate::gpu::{Device, DeviceOptions};
use crate::scene::Scene;
use crate::scene::animation::Track;
use crate::sim::Tracer;
use crate::sim::shaders::Library;

/// Options of the window.
pub struct Options {
    /// The scene file.
    pub file: PathBuf,
    /// Warnings about the scene, as loading it has given them.
    pub warnings: Vec<String>,
    /// Settings of the command line, which replace those of the file.
    pub overrides: Vec<(String, String)>,
    /// The device to take; [`run`](super::run) adds that it must serve a window.
    pub device: DeviceOptions,
    /// The kernels.
    pub library: Arc<Library>,
    /// Time of the scene at the start, s.
    pub seconds: f64,
    /// Scale of the interface; 1 is the display's own.
    pub scale: f32,
    /// Writes the window's picture into this file (PNG) once it shows an image, and ends.
    pub screenshot: Option<PathBuf>,
    /// Writes the timings into this file at the end.
    pub json: Option<PathBuf>,
    /// A trajectory that the probe follows from the start, and its file.
    pub trajectory: Option<(Track, PathBuf)>,
    /// Address at which OpenIGTLink clients are awaited from the start; none without it.
    pub listen: Option<Listen>,
    /// Folder of stills and clips.
    pub captures: PathBuf,
    /// Begins with pictures of the scenes that ship.
    pub gallery: bool,
    /// Fits path and scatterer counts to the device, and chooses a tracer that it has.
    pub prepare: Prepare,
}

/// The address at which OpenIGTLink clients are awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Listen {
    /// Address of this machine.
    pub address: IpAddr,
    /// Port; 0 takes any that is free.
    pub port: u16,
}

/// The type of [`Options::prepare`].
pub type Prepare = Box<dyn Fn(&Arc<Device>, &mut Scene) -> Result<Tracer, Refusal>>;
