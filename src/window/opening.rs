//! A scene that is loaded while the window goes on.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Instant;

use winit::event_loop::EventLoopProxy;

use super::deaths::OPENING;
use super::error::{Refusal, message_of};
use super::keeper::Orphan;
use super::model::{File, Model};
use super::options::Options;
use super::wake::Woken;
use crate::gpu::Device;
use crate::scene::{Scene, SceneError, Warning};

type Loaded = Result<(Scene, Vec<Warning>), SceneError>;

/// The purpose for which a scene is loaded.
pub(super) enum Purpose {
    /// It takes the place of the one that is shown.
    Open,
    /// It is the one that is shown, whose files have changed: the session goes on with it.
    Again,
    /// Settings and poses of an earlier session that were not saved: the scene that is shown gets them.
    TakeUp(Box<Orphan>),
}

/// A scene being loaded.
pub(super) struct Opening {
    path: PathBuf,
    overrides: Vec<(String, String)>,
    pub(super) purpose: Purpose,
    loaded: Receiver<Loaded>,
}

/// A scene with the window's first state of it.
pub(super) struct Opened {
    pub(super) scene: Scene,
    pub(super) model: Model,
    /// What is suspicious about it.
    pub(super) warnings: Vec<String>,
    /// The session goes on with it.
    pub(super) again: bool,
}

impl Opening {
    /// Begins to read `path`; wakes the event loop at the end.
    pub(super) fn begin(
        path: PathBuf,
        overrides: Vec<(String, String)>,
        purpose: Purpose,
        proxy: EventLoopProxy<Woken>,
    ) -> Self {
        let (sender, loaded) = channel();
        let (file, set) = (path.clone(), overrides.clone());
        let thread = std::thread::Builder::new().name(OPENING.into());
        // A thread that is not started sends nothing; that is reported.
        let _ = thread.spawn(move || {
            // A window that is gone needs neither.
            let _ = sender.send(Scene::load(&file, &set));
            let _ = proxy.send_event(Woken);
        });
        Self { path, overrides, purpose, loaded }
    }

    /// The loaded scene, fitted to the device; none while it is not ready.
    pub(super) fn ready(
        &self,
        options: &Options,
        device: &Arc<Device>,
        now: Instant,
    ) -> Option<Result<Opened, String>> {
        let loaded = match self.loaded.try_recv() {
            Ok(loaded) => loaded,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => return Some(Err(self.unread())),
        };
        Some(match loaded {
            Ok((scene, warnings)) => {
                for warning in &warnings {
                    crate::output::note(warning);
                }
                let file = File::new(self.path.clone(), self.overrides.clone(), &scene);
                let suited = suited(scene, file, options, device, 0.0, now);
                let again = matches!(self.purpose, Purpose::Again);
                let warnings = warnings.iter().map(ToString::to_string).collect();
                let opened = |opened| Opened { warnings, again, ..opened };
                suited.map(opened).map_err(|e| e.to_string())
            }
            Err(error) => Err(message_of(&error)),
        })
    }

    /// Message for a thread that ended without a result.
    fn unread(&self) -> String {
        let file = self.path.display();
        format!("{file} was not read: the thread that reads it died. Try again; the image goes on.")
    }
}

/// The first state of a window with `scene`, with counts that suit the device.
///
/// # Errors
/// The device does not suit.
pub(super) fn suited(
    mut scene: Scene,
    file: File,
    options: &Options,
    device: &Arc<Device>,
    seconds: f64,
    now: Instant,
) -> Result<Opened, Refusal> {
    let tracer = (options.prepare)(device, &mut scene)?;
    let model = Model::new(&scene, file, tracer, seconds, now);
    Ok(Opened { scene, model, warnings: Vec::new(), again: false })
}
