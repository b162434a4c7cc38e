//! The simulation on its own thread: it takes the newest order and hands over finished pictures.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::DAffine3;

use super::link::Link;
use super::look::{Look, Pictured};
use super::model::{Order, Settings};
use crate::gpu::{Device, FrameTimings, Image, MemoryUse};
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::contact::Touch;
use crate::sim::shaders::Library;
use crate::sim::{Memory, SimError};
use worker::Worker;

mod worker;

/// Where the image lies in the probe's space.
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
    /// The same with its acquired pixels coloured, where that was asked for and there are some.
    pub tinted: Option<Image>,
    /// Where it lies.
    pub sector: Sector,
    /// The probe that it was made with.
    pub probe: Probe,
    /// The settings that it was made with.
    pub settings: Arc<Settings>,
    /// World from probe.
    pub pose: DAffine3,
    /// How the probe touches the skin; none where the scene asks for no contact.
    pub contact: Option<Touch>,
    /// Time of the scene, s.
    pub seconds: f64,
    /// [`Order::revision`] of what it shows.
    pub revision: u64,
    /// When what it shows was decided: the input that moved the probe, or, while time passes, the
    /// moment at which the clock was read.
    pub at: Instant,
    /// Time on the device by stage.
    pub timings: FrameTimings,
    /// When it was finished.
    pub finished: Instant,
    /// From reading the order to the finished picture, ms.
    pub wall_ms: f64,
    /// What the processor took to bring acceleration structures up to date, ms.
    pub update_ms: f64,
    /// Memory of the device.
    pub memory: MemoryUse,
    /// Of that, what the scene takes.
    pub scene_memory: Memory,
    /// Of that, images, those of the loop included, bytes.
    pub image_bytes: u64,
}

/// Longest time for which moving the eye of the 3D view may put off the next image while time passes.
const PUT_OFF: Duration = Duration::from_millis(300);

/// What the simulation has to say.
pub enum News {
    /// A picture; its pixels, where [`Order::reads_back`]. They are not the frame's, of which the loop
    /// holds hundreds.
    Frame(Box<Frame>, Option<Pixels>),
    /// A picture of the anatomy.
    Survey(Box<Pictured>),
    /// An order could not be carried out; the next one may.
    Refused(String),
    /// The scene that was to be opened is there: pictures from now on are of it.
    Opened,
    /// It cannot be; the one before goes on.
    NotOpened(String),
    /// Nothing more will come.
    Failed(SimError),
}

struct State {
    /// The newest order that was not taken yet.
    order: Option<Order>,
    /// A scene to go on with, and what to show of it.
    opening: Option<(Box<Scene>, Order)>,
    frozen: bool,
    /// How the anatomy is looked at, if it is.
    look: Option<Look>,
    /// It is not pictured like this yet.
    looks_new: bool,
    stop: bool,
    /// The last picture is to be sent once more.
    resend: bool,
    news: Vec<News>,
}

/// What there is to do next.
enum Job {
    /// An image, and the anatomy with it.
    Image(Order),
    Open(Box<Scene>, Order),
    /// Only the anatomy, from another side.
    Survey,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    /// The lists stay whole after a panic of the other thread, so poisoning is ignored.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The simulation's thread; it ends when this is dropped, after the frame under way.
pub struct Engine {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Engine {
    /// Uploads `scene` and carries out `order`. Clients of `link` receive every picture. `wake` is
    /// called, from the thread, for each news.
    pub(super) fn start(
        device: &Arc<Device>,
        library: Arc<Library>,
        scene: Scene,
        order: Order,
        link: Link,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                order: Some(order),
                opening: None,
                frozen: false,
                look: None,
                looks_new: false,
                stop: false,
                resend: false,
                news: Vec::new(),
            }),
            changed: Condvar::new(),
        });
        let wake = Box::new(wake);
        let worker = Worker::new(device, library, scene, link, shared.clone(), wake);
        let thread = std::thread::Builder::new()
            .name("simulation".into())
            .spawn(move || worker.run())
            .expect("a thread can be started");
        Self {
            shared,
            thread: Some(thread),
        }
    }

    /// Replaces the order that was not taken yet. While `frozen` nothing is carried out.
    pub fn order(&self, order: Order, frozen: bool) {
        let mut state = self.shared.lock();
        state.order = Some(order);
        state.frozen = frozen;
        drop(state);
        self.shared.changed.notify_all();
    }

    /// Goes on with another scene, if the device can hold it beside the one before.
    pub fn open(&self, scene: Scene, order: Order) {
        let mut state = self.shared.lock();
        state.opening = Some((Box::new(scene), order));
        drop(state);
        self.shared.changed.notify_all();
    }

    /// Sends the last picture to the clients of the link once more.
    pub(super) fn send_again(&self) {
        self.shared.lock().resend = true;
        self.shared.changed.notify_all();
    }

    /// How the anatomy is to be pictured from now on, frozen or not; with nothing it is not.
    pub fn look(&self, look: Option<Look>) {
        let mut state = self.shared.lock();
        state.looks_new = look.is_some();
        state.look = look;
        drop(state);
        self.shared.changed.notify_all();
    }

    /// What has come since the last call, oldest first.
    pub fn news(&self) -> Vec<News> {
        std::mem::take(&mut self.shared.lock().news)
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.shared.lock().stop = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been printed by itself.
            let _ = thread.join();
        }
    }
}
