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
use super::model::{Order, Settings};
use crate::gpu::{Device, FrameTimings, Image, MemoryUse};
use crate::live::Grade;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::contact::SkinContact;
use crate::sim::shaders::Library;
use crate::sim::{Memory, SimError};
use worker::Worker;

mod worker;

/// Place of the image in the probe's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sector {
    /// Lateral place of the image's left edge, mm.
    pub left: f64,
    /// Depth of its upper edge, mm.
    pub top: f64,
    /// Edge of a pixel, mm.
    pub pitch: f64,
}

/// Pixels of an image, read back from the device.
#[derive(Clone, Debug)]
pub struct Pixels {
    /// Width and height.
    pub size: [u32; 2],
    /// RGBA, row by row; transparent outside the sector.
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// Grey level at a place in pixels from the upper left corner, linear between the centres of four;
    /// 0 outside.
    pub fn level(&self, x: f64, y: f64) -> u8 {
        let [width, height] = self.size.map(i64::from);
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (right, below) = (x - 0.5 - left, y - 0.5 - top);
        let at = |i: i64, j: i64| match (0..width).contains(&i) && (0..height).contains(&j) {
            true => f64::from(self.rgba[4 * (j * width + i) as usize]),
            false => 0.0,
        };
        let (i, j) = (left as i64, top as i64);
        let row = |j| at(i, j) * (1.0 - right) + at(i + 1, j) * right;
        (row(j) * (1.0 - below) + row(j + 1) * below).round() as u8
    }
}

/// A finished picture of the simulation.
#[derive(Clone)]
pub struct Frame {
    /// The B-mode image; nobody writes it while there are clones.
    pub image: Image,
    /// The same image with its acquired pixels coloured; only where asked for and where there are some.
    pub tinted: Option<Image>,
    /// The same image with the tissues that are seen in their colours; only where asked for.
    pub painted: Option<Image>,
    /// Place of the image in the probe's space.
    pub sector: Sector,
    /// The probe that it was made with.
    pub probe: Probe,
    /// The settings that it was made with.
    pub settings: Arc<Settings>,
    /// World from probe.
    pub pose: DAffine3,
    /// Contact of the probe with the skin; none where the scene asks for no contact.
    pub contact: Option<SkinContact>,
    /// Time of the scene, s.
    pub seconds: f64,
    /// Quality of the picture.
    pub grade: Grade,
    /// [`Order::revision`] of the order that it shows.
    pub revision: u64,
    /// Moment at which its content was decided: the input that moved the probe or, while time passes,
    /// the reading of the clock.
    pub at: Instant,
    /// Time on the device by stage.
    pub timings: FrameTimings,
    /// Moment at which it was finished.
    pub finished: Instant,
    /// Time from reading the order to the finished picture, ms.
    pub wall_ms: f64,
    /// Time of the processor to bring acceleration structures up to date, ms.
    pub update_ms: f64,
    /// Memory of the device.
    pub memory: MemoryUse,
    /// The scene's share of it.
    pub scene_memory: Memory,
    /// The images' share of it, those of the loop included, bytes.
    pub image_bytes: u64,
}

/// While something moves, the 3D view waits this many times the duration of its last picture before
/// the next one: it gets a seventh of the time.
const VIEW3D_PUT_OFF: u32 = 6;

/// Longest wait of the next image for the window to draw the last one, where they share a queue: neither then
/// slows the other, and the image contains the newest input. A window that takes longer is not waited for until it
/// draws again.
const WINDOW_PATIENCE: Duration = Duration::from_millis(40);

/// What the M-mode strip takes with a picture. It is kept out of the frame, of which the loop holds hundreds.
pub enum Film {
    /// Nothing.
    None,
    /// The picture's pixels.
    Picture(Pixels),
    /// Columns along a line of the time since the picture before, the last one at its moment.
    Columns(Aim, Vec<Column>),
}

/// News from the simulation for the window.
pub enum News {
    /// A picture, and what the M-mode strip takes with it.
    Frame(Box<Frame>, Film),
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

/// Tells the window that there is news.
type Wake = Arc<dyn Fn() + Send + Sync>;

struct State {
    /// The newest order, not yet taken.
    order: Option<Order>,
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
    Open(Box<Scene>, Order),
    /// The last image once more, at a finer level.
    Refined(usize),
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
