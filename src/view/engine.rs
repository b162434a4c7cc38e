//! The simulation on its own thread: it takes the newest order and hands over finished pictures.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::DAffine3;

use super::link::{Broadcast, Link};
use super::look::{Look, Pictured};
use super::model::{Order, Settings};
use super::ring::Ring;
use crate::gpu::{Device, FrameTimings, GpuError, Image, MemoryUse};
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::contact::Touch;
use crate::sim::shaders::Library;
use crate::sim::{Memory, SimError, Simulator, Tracer, image_size};

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
    /// Its pixels, where [`Order::reads_back`].
    pub pixels: Option<Arc<Pixels>>,
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
    /// A picture.
    Frame(Box<Frame>),
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
        let worker = Worker {
            shared: shared.clone(),
            ring: Ring::new(device, "B-mode"),
            broadcast: Broadcast::new(link, device),
            pictures: Ring::new(device, "survey"),
            device: device.clone(),
            library,
            scene,
            fitted: None,
            imaged: Instant::now(),
            left: None,
            wake: Box::new(wake),
        };
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

/// What the device holds the results of.
struct Imaged {
    probe: Probe,
    pose: DAffine3,
    ended: Instant,
    took: Duration,
}

struct Worker {
    shared: Arc<Shared>,
    ring: Ring,
    broadcast: Broadcast,
    pictures: Ring,
    device: Arc<Device>,
    library: Arc<Library>,
    scene: Scene,
    /// Settings that the simulator's buffers are known to hold.
    fitted: Option<Arc<Settings>>,
    /// The moment that the last picture shows.
    imaged: Instant,
    /// What it left on the device.
    left: Option<Imaged>,
    wake: Box<dyn Fn() + Send>,
}

impl Worker {
    fn run(mut self) {
        let mut simulator = None;
        let mut last: Option<Order> = None;
        let mut index = 0;
        while let Some(job) = self.next(last.as_ref()) {
            let order = match job {
                Job::Survey => None,
                Job::Image(order) => Some(order),
                Job::Open(scene, order) => match self.open(*scene, &order) {
                    Ok(opened) => {
                        simulator = Some(opened);
                        self.tell(News::Opened);
                        Some(order)
                    }
                    Err(error @ SimError::Gpu(GpuError::DeviceLost { .. })) => {
                        return self.tell(News::Failed(error));
                    }
                    Err(error) => {
                        self.tell(News::NotOpened(error.to_string()));
                        continue;
                    }
                },
            };
            if let Some(order) = order {
                let frame = self.carry_out(&mut simulator, &order, index);
                index += 1;
                last = Some(order);
                let told = frame.map(|frame| News::Frame(Box::new(frame)));
                if !self.report(told, simulator.is_none()) {
                    return;
                }
            }
            let Some((simulator, _)) = &mut simulator else {
                continue;
            };
            if let Some(pictured) = self.picture(simulator).transpose() {
                let told = pictured.map(|pictured| News::Survey(Box::new(pictured)));
                if !self.report(told, false) {
                    return;
                }
            }
        }
    }

    /// Hands news over; whether there will be more.
    fn report(&self, news: Result<News, SimError>, fatal: bool) -> bool {
        match news {
            Ok(news) => self.tell(news),
            // Everything on the device is gone with it.
            Err(error @ SimError::Gpu(GpuError::DeviceLost { .. })) => {
                self.tell(News::Failed(error));
                return false;
            }
            Err(error) if fatal => {
                self.tell(News::Failed(error));
                return false;
            }
            Err(error) => self.tell(News::Refused(error.to_string())),
        }
        true
    }

    fn tell(&self, news: News) {
        self.shared.lock().news.push(news);
        (self.wake)();
    }

    /// The newest order once there is one, or the last one again while it looks different by itself;
    /// nothing at the end. A new look at the anatomy goes first for as long as the last image took.
    fn next(&self, last: Option<&Order>) -> Option<Job> {
        let mut state = self.shared.lock();
        loop {
            if state.stop {
                return None;
            }
            if let Some((scene, order)) = state.opening.take() {
                return Some(Job::Open(scene, order));
            }
            if std::mem::take(&mut state.resend) {
                drop(state);
                // What is wrong with the device will be told by the next frame.
                let _ = self.broadcast.again();
                state = self.shared.lock();
                continue;
            }
            let running = last.filter(|last| last.runs(self.imaged));
            let due = !state.frozen && (state.order.is_some() || running.is_some());
            if let (Some(left), true) = (&self.left, state.looks_new)
                && (!due || left.ended.elapsed() < left.took.min(PUT_OFF))
            {
                return Some(Job::Survey);
            }
            if due {
                let again = || running.expect("due without an order").again(Instant::now());
                return Some(Job::Image(state.order.take().unwrap_or_else(again)));
            }
            let changed = self.shared.changed.wait(state);
            state = changed.unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Uploads another scene; the one before stays until that is done.
    fn open(&mut self, mut scene: Scene, order: &Order) -> Result<(Simulator, Tracer), SimError> {
        order.settings.apply(&mut scene);
        scene.set_time(order.clock.at(Instant::now()));
        let tracer = order.settings.tracer;
        let simulator = Simulator::new(&self.device, &self.library, &scene, tracer)?;
        self.scene = scene;
        self.fitted = None;
        self.left = None;
        let mut state = self.shared.lock();
        // What was ordered of the scene before means nothing here.
        state.order = None;
        state.frozen = false;
        drop(state);
        Ok((simulator, tracer))
    }

    /// The anatomy of the last image as it is looked at now, if it is.
    fn picture(&mut self, simulator: &mut Simulator) -> Result<Option<Pictured>, SimError> {
        let mut state = self.shared.lock();
        state.looks_new = false;
        let (Some(look), Some(left)) = (state.look.clone(), &self.left) else {
            return Ok(None);
        };
        drop(state);
        // The window may still look at the scene before.
        if look.sight.looks.len() != self.scene.instances.len() {
            return Ok(None);
        }
        let image = self.pictures.free(look.sight.size)?;
        let timings = simulator.survey(&self.library, &look.sight, &image)?;
        Ok(Some(Pictured {
            image,
            look,
            probe: left.probe.clone(),
            pose: left.pose,
            ms: timings.total_ms(),
        }))
    }

    fn carry_out(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        order: &Order,
        index: u32,
    ) -> Result<Frame, SimError> {
        let began = Instant::now();
        let seconds = order.clock.at(began);
        order.settings.apply(&mut self.scene);
        let pose = order.pose(began);
        self.scene.world_from_probe = pose;
        self.imaged = began;
        self.scene.set_time(seconds);
        let (scene, library, tracer) = (&self.scene, &self.library, order.settings.tracer);
        if simulator.as_ref().is_none_or(|(_, made)| *made != tracer) {
            // The old one first, so that there is room for the new one.
            *simulator = None;
            *simulator = Some((
                Simulator::new(&self.device, library, scene, tracer)?,
                tracer,
            ));
        }
        let (simulator, _) = simulator.as_mut().expect("just made");
        let settings = match &self.fitted {
            Some(fitted) if **fitted == order.settings => fitted.clone(),
            _ => {
                simulator.fit(library, scene)?;
                let settings = Arc::new(order.settings.clone());
                self.fitted.insert(settings).clone()
            }
        };
        let image = self.ring.free(image_size(scene))?;
        simulator.show_on(Some(image.clone()));
        let tinted = match order.tint.filter(|_| scene.shows_volume()) {
            Some(tint) => Some((self.ring.free(image_size(scene))?, tint)),
            None => None,
        };
        simulator.tint_on(tinted.clone());
        simulator.frame(scene, index)?;
        let timings = simulator.wait()?.pop().unwrap_or_default();
        simulator.show_on(None);
        simulator.tint_on(None);
        let pixels = match order.reads_back {
            true => {
                let (width, height, rgba) = simulator.pixels()?;
                let size = [width, height];
                Some(Arc::new(Pixels { size, rgba }))
            }
            false => None,
        };
        self.left = Some(Imaged {
            probe: scene.probe.clone(),
            pose,
            ended: Instant::now(),
            took: began.elapsed(),
        });
        let constants = simulator.constants();
        self.broadcast.offer(&image, constants, pose)?;
        Ok(Frame {
            pixels,
            sector: Sector {
                left: f64::from(constants.image_left),
                top: f64::from(constants.image_top),
                pitch: f64::from(constants.pixel_pitch),
            },
            image,
            tinted: tinted.map(|(image, _)| image),
            probe: scene.probe.clone(),
            settings,
            pose,
            contact: simulator.contact(),
            seconds,
            revision: order.revision,
            at: order.at,
            timings,
            finished: Instant::now(),
            wall_ms: began.elapsed().as_secs_f64() * 1e3,
            update_ms: simulator.update_time().as_secs_f64() * 1e3,
            memory: self.device.memory(),
            scene_memory: simulator.memory(),
            image_bytes: self.ring.bytes(),
        })
    }
}
