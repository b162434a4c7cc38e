//! The simulation on its own thread: it takes the newest order and hands over finished pictures.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::DAffine3;
use parking_lot::{Condvar, Mutex, MutexGuard};

use super::deaths::SIMULATION;
use super::link::Link;
use super::look::{Look, Pictured};
use super::model::mmode::{Aim, Column};
use super::model::spectrum::Heard;
use super::model::{Order, Settings};
use super::picture::{Film, Frame};
use super::wake::Wake;
use crate::gpu::Device;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::SimError;
use crate::sim::shaders::Library;
use worker::Worker;

mod worker;

/// While something moves, the 3D view waits this many times the duration of its last picture before
/// the next one: it gets a seventh of the time.
const VIEW3D_PUT_OFF: u32 = 6;

/// While a strip of a moving scene is drawn, M-mode or spectra, the next image waits this many times the duration of the last
/// one: the strip gets seven eighths of the time, as on scanners, whose image then stands for a second at a time.
const STRIP_PUT_OFF: u32 = 7;

/// Longest time for which the image stands beside the strip.
const STRIP_LONGEST: Duration = Duration::from_secs(1);

/// Longest wait of the next image for the window to draw the last one, where they share a queue: neither then
/// slows the other, and the image contains the newest input. A window that takes longer is not waited for until it
/// draws again.
const WINDOW_PATIENCE: Duration = Duration::from_millis(40);

/// News from the simulation for the window.
pub enum News {
    /// A picture, and what the M-mode strip takes with it.
    Frame(Box<Frame>, Film),
    /// Columns along a line for the M-mode strip, between two pictures, and the probe that they were made with.
    Columns(Box<Probe>, Aim, Vec<Column>),
    /// Spectra of pulsed-wave Doppler, before a picture or between two.
    Spectra(Box<Heard>),
    /// A picture of a past moment at the scene's own quality, in place of that of the loop.
    Anew(Box<Frame>),
    /// A picture of the anatomy.
    View3d(Box<Pictured>),
    /// The work under way before the first picture.
    Preparing(&'static str),
    /// An order could not be carried out; the next one may.
    Refused(String),
    /// The scene that was to be opened is loaded: pictures from now on show it.
    Opened,
    /// The scene cannot be opened; the one before goes on.
    NotOpened(String),
    /// The simulation has ended.
    Failed(SimError),
    /// Nothing more will come: the thread died by a bug.
    Died,
}

/// An image of the loop that is looked at: made again at the scene's own quality.
#[derive(Clone, PartialEq)]
pub(super) struct Past {
    /// The settings that it was made with.
    pub(super) settings: Arc<Settings>,
    /// World from probe.
    pub(super) pose: DAffine3,
    /// Time of the scene, s.
    pub(super) seconds: f64,
}

struct State {
    /// The newest order, not yet taken.
    order: Option<Order>,
    /// The image of the loop that is looked at, while the image is frozen.
    past: Option<Past>,
    /// A scene to open, and the first order for it.
    opening: Option<(Box<Scene>, Order)>,
    frozen: bool,
    /// The wanted view of the anatomy, if it is shown.
    look: Option<Look>,
    /// The anatomy has not been pictured from this view yet.
    looks_new: bool,
    stop: bool,
    /// The last picture is to be sent once more.
    resend: bool,
    /// Moment of the last order, or of the last movement of the 3D view's camera.
    touched: Instant,
    /// Moment since which the window has an undrawn image, where drawing it comes first.
    undrawn: Option<Instant>,
    news: Vec<News>,
}

/// The next job of the thread.
enum Job {
    /// An image.
    Image(Order),
    /// Columns of the M-mode strip, and spectra.
    Strips(Order),
    Open(Box<Scene>, Order),
    /// The last image once more, at a finer level.
    Refined(usize),
    /// An image of the loop.
    Anew(Past),
    /// A picture of the 3D view.
    View3d {
        moving: bool,
    },
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Something newer is to be done than the job at rest that is under way.
    newer: AtomicBool,
}

impl Shared {
    /// Wakes the thread for something that does not wait for a job at rest.
    fn interrupt(&self, mut state: MutexGuard<'_, State>) {
        state.touched = Instant::now();
        drop(state);
        self.newer.store(true, Ordering::Release);
        self.changed.notify_all();
    }
}

/// The simulation's thread. When this is dropped, it ends after the frame under way.
pub struct Engine {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Uploads `scene` and carries out `order`. Clients of `link` receive every picture. `wake` is
    /// called, from the thread, for each news.
    ///
    /// # Errors
    /// The system has no room for another thread.
    pub(super) fn start(
        device: &Arc<Device>,
        library: Arc<Library>,
        scene: Scene,
        order: Order,
        link: Link,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                order: Some(order),
                past: None,
                opening: None,
                frozen: false,
                look: None,
                looks_new: false,
                stop: false,
                resend: false,
                touched: Instant::now(),
                undrawn: None,
                news: Vec::new(),
            }),
            changed: Condvar::new(),
            newer: AtomicBool::new(false),
        });
        let wake: Wake = Arc::new(wake);
        let (mourner, bell) = (shared.clone(), wake.clone());
        let worker = Worker::new(device, library, scene, link, shared.clone(), wake);
        let thread = std::thread::Builder::new().name(SIMULATION.into()).spawn(move || {
            // The worker is gone with its panic; the lists that are shared stay whole.
            if catch_unwind(AssertUnwindSafe(|| worker.run())).is_err() {
                mourner.state.lock().news.push(News::Died);
                bell();
            }
        })?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Replaces the order that was not taken yet. While `frozen`, no order is carried out.
    pub fn order(&self, order: Order, frozen: bool) {
        let mut state = self.shared.state.lock();
        state.order = Some(order);
        state.frozen = frozen;
        self.shared.interrupt(state);
    }

    /// Sets the image of the loop that is looked at: it is made again once the user has stopped there.
    pub(super) fn look_back(&self, past: Option<Past>) {
        let mut state = self.shared.state.lock();
        if state.past != past {
            state.past = past;
            self.shared.interrupt(state);
        }
    }

    /// Goes on with another scene, if the device can hold it beside the one before.
    pub fn open(&self, scene: Scene, order: Order) {
        let mut state = self.shared.state.lock();
        state.opening = Some((Box::new(scene), order));
        self.shared.interrupt(state);
    }

    /// Sends the last picture to the clients of the link once more.
    pub(super) fn send_again(&self) {
        self.shared.state.lock().resend = true;
        self.shared.changed.notify_all();
    }

    /// Sets the view from which the anatomy is pictured from now on, frozen or not; with none it is not pictured.
    pub fn look(&self, look: Option<Look>) {
        let mut state = self.shared.state.lock();
        let camera = |look: &Option<Look>| look.as_ref().map(|look| look.camera);
        let moved = camera(&look) != camera(&state.look);
        state.looks_new = look.is_some();
        state.look = look;
        match moved {
            true => self.shared.interrupt(state),
            false => {
                self.shared.changed.notify_all();
            }
        }
    }

    /// Tells the simulation that the window has drawn its last image.
    pub(super) fn drawn(&self) {
        self.shared.state.lock().undrawn = None;
        self.shared.changed.notify_all();
    }

    /// News since the last call, oldest first.
    pub fn news(&self) -> Vec<News> {
        std::mem::take(&mut self.shared.state.lock().news)
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        let mut state = self.shared.state.lock();
        state.stop = true;
        self.shared.interrupt(state);
        if let Some(thread) = self.thread.take() {
            // It tells its panic as news.
            let _ = thread.join();
        }
    }
}
