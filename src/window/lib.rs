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
mod colour;
mod console;
mod deaths;
mod dual;
mod ecg;
pub mod engine;
mod error;
mod exam;
mod exit;
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
mod options;
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
mod spans;
mod spectrum;
mod state;
mod statistics;
mod strip;
mod style;
mod timing;
mod tools;
mod unsaved;
mod view3d;
mod wake;
mod watch;

use winit::event_loop::EventLoop;

pub use error::{Refusal, ViewError};
pub use gallery::FIRST_STEPS;
pub use model::Model;
pub use options::{Listen, Options, Prepare};

use crate::scene::Scene;

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
fn without_place(message: &str) -> &str {
    let cause = message.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    cause.map_or(message, |(_, cause)| cause).trim_end_matches('.')
}

#[cfg(test)]
mod tests {
    use super::without_place;

    #[test]
    fn errors_of_the_window_system_name_no_source_file() {
        let message = "os error at /home/a/winit-0.30.12/src/platform_impl/linux/mod.rs:768: neither \
                    WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set.";
        let cause = "neither WAYLAND_DISPLAY nor WAYLAND_SOCKET nor DISPLAY is set";
        assert_eq!([message, cause, ""].map(without_place), [cause, cause, ""]);
    }
}
