//! The window: the live image, a console for everything that the model exposes, timings.
//!
//! The simulation runs on a thread of its own ([`engine`]). The window shows the last finished
//! picture and never waits for it. A plain [`Model`] holds what is shown and set.

#![warn(missing_docs)]

use insonify_gpu as gpu;
use insonify_lab::{exchange, igtl, output, register, teach};
use insonify_scene::{live, probe, scene, settings};
use insonify_sim as sim;

mod acts;
mod app;
mod beside;
mod bmode;
mod body;
mod calipers;
mod captures;
mod cine;
mod console;
mod deaths;
mod dual;
mod ecg;
pub mod engine;
mod exam;
mod files;
mod framing;
mod gallery;
mod help;
mod histogram;
mod hold;
mod inputs;
mod keeper;
mod keys;
mod layout;
mod leaving;
mod lesson;
mod link;
pub mod look;
mod marked;
mod mmode;
pub mod model;
mod naming;
mod notes;
mod notice;
mod offer;
mod open;
mod opening;
mod orders;
mod pads;
mod panel;
mod panels;
pub mod picture;
mod place;
mod planes;
mod real;
mod recent;
mod ring;
mod saved;
mod session;
mod state;
mod statistics;
mod strip;
mod style;
mod timing;
mod tools;
mod unsaved;
mod view3d;
mod watch;
mod way;

use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::Arc;

use winit::event_loop::EventLoop;

pub use model::Model;

use crate::gpu::{Device, DeviceOptions, GpuError};
use crate::igtl::IgtlError;
use crate::scene::Scene;
use crate::scene::animation::Track;
use crate::sim::shaders::Library;
use crate::sim::{SimError, Tracer};

/// Options of the window.
pub struct Options {
    /// The scene file.
    pub file: PathBuf,
    /// What is suspicious about the scene, as loading it has told.
    pub warnings: Vec<String>,
    /// Settings of the command line, which replace those of the file.
    pub overrides: Vec<(String, String)>,
    /// The device to take; [`run`] adds that it must serve a window.
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

/// What to do first, in three lines.
pub const FIRST_STEPS: [&str; 3] = [
    "Drag the probe on the skin in the 3D view, or slide it by the arrow keys; Shift leans it, Ctrl and the wheel turn it.",
    "Space freezes the image, L measures a distance in it, F2 saves it with its settings.",
    "The console has gain, depth and all other settings; ? lists the keys.",
];

/// The reason why a device does not suit.
pub type Refusal = Box<dyn std::error::Error + Send + Sync>;

/// The reason why there is no window, or no more.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// There is no display, or it cannot be reached.
    #[error("no window can be opened: {0}; `insonify render` needs no display")]
    Display(String),
    /// An error of the device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The device does not suit.
    #[error("{0}")]
    Refused(Refusal),
    /// An error of the simulation before its first image.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The OpenIGTLink server cannot listen.
    #[error("{error}: {}", error.remedy())]
    Igtl {
        /// The cause.
        #[from]
        error: IgtlError,
    },
    /// The system has no room for another thread.
    #[error("no thread can be started: {0}; close other programs, or raise the limit on threads")]
    Thread(std::io::Error),
    /// The simulation's thread died by a bug; the window lives on.
    #[error("the simulation died by a bug")]
    Died,
    /// The device was lost a second time in a short while.
    #[error(
        "{0}; it had been lost a moment before, so it was not opened again: lower the quality \
         (--quality draft), choose another --device, or install a newer driver"
    )]
    LostAgain(Box<ViewError>),
    /// A file that was asked for cannot be written.
    #[error("writing {}: {reason}", file.display())]
    Unwritten {
        /// The file.
        file: PathBuf,
        /// The system's message.
        reason: String,
    },
    /// The validation layers were asked for and have found something.
    #[error("{count} validation messages, the first: {first}")]
    Validation {
        /// Number of messages.
        count: usize,
        /// The first message.
        first: String,
    },
}

/// Opens a window on `scene` and stays until it is closed.
///
/// # Errors
/// No display, no device that can show pictures, a device that is lost again and again.
pub fn run(scene: Scene, options: Options) -> Result<(), ViewError> {
    let display = |error: winit::error::EventLoopError| {
        ViewError::Display(without_place(&error.to_string()).to_owned())
    };
    let events = EventLoop::with_user_event().build().map_err(display)?;
    let mut app = app::App::new(scene, options, events.create_proxy());
    events.run_app(&mut app).map_err(display)?;
    app.finish()
}

/// An error of the window system without the place in its library's sources that it begins with, and without its full
/// stop.
fn without_place(said: &str) -> &str {
    let cause = said.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    cause.map_or(said, |(_, cause)| cause).trim_end_matches('.')
}

#[cfg(test)]
mod tests {
    use super::without_place;

    #[test]
    fn errors_of_the_window_system_name_no_source_file() {
        let said = "os error at /home/a/winit-0.30.12/src/platform_impl/linux/mod.rs:768: neither \
                    WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set.";
        let cause = "neither WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set";
        assert_eq!([said, cause, ""].map(without_place), [cause, cause, ""]);
    }
}
