//! The work of the simulation's thread.

use std::sync::atomic::Ordering;
use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::DAffine3;

use super::{
    Frame, Job, News, Pixels, Sector, Shared, State, VIEW3D_PUT_OFF, WINDOW_PATIENCE, Wake,
};
use crate::gpu::{Abandon, Device, GpuError};
use crate::live::{self, Pace};
use crate::scene::Scene;
use crate::sim::shaders::Library;
use crate::sim::{self, SimError, Simulator, Tracer, image_size};
use crate::view::link::{Broadcast, Link};
use crate::view::look::Pictured;
use crate::view::model::{Order, Settings};
use crate::view::ring::Ring;

/// Share of the image in the budget while the 3D view is open.
const IMAGE_SHARE: f64 = 0.8;

/// Text while the scene is uploaded, before the first picture.
const UPLOADING: &str = "Building structures of the anatomy, compiling kernels";
const FIRST: &str = "Making the first picture";
const COMPILING: &str = "Compiling kernels for this device, the first time only";

/// The last picture, and the state that it left on the device.
struct Imaged {
    order: Order,
    /// Number of orders carried out before.
    index: u32,
    pose: DAffine3,
    seconds: f64,
    level: usize,
}

/// The contents of an image to be made.
struct Taken {
    order: Order,
    index: u32,
    pose: DAffine3,
    seconds: f64,
    /// Level of the ladder; none leaves it to the pace.
    level: Option<usize>,
}

/// The state of the thread.
pub(super) struct Worker {
    shared: Arc<Shared>,
    ring: Ring,
    broadcast: Broadcast,
    pictures: Ring,
    device: Arc<Device>,
    library: Arc<Library>,
    scene: Scene,
    /// Settings that the simulator's buffers hold.
    fitted: Option<Arc<Settings>>,
    /// Start of the last picture made for something new; finer ones of it follow at once.
    imaged: Instant,
    /// The last order carried out, or tried.
    last: Option<Order>,
    /// The state that the last picture left on the device.
    left: Option<Imaged>,
    /// Chooses the counts of the next picture.
    pace: Pace,
    /// End and duration of the last picture of the anatomy.
    view3d_made: (Instant, Duration),
    wake: Wake,
}

impl Worker {
    pub(super) fn new(
        device: &Arc<Device>,
        library: Arc<Library>,
        scene: Scene,
        link: Link,
        shared: Arc<Shared>,
        wake: Wake,
    ) -> Self {
        let machine = sim::machine(device);
        Self {
            shared,
            ring: Ring::new(device, "B-mode"),
            broadcast: Broadcast::new(link, device),
            pictures: Ring::new(device, "view3d"),
            device: device.clone(),
            library,
            scene,
            fitted: None,
            imaged: Instant::now(),
            last: None,
            left: None,
            pace: Pace::new(machine),
            view3d_made: (Instant::now(), Duration::ZERO),
            wake,
        }
    }

    /// Carries out orders until it is stopped or the device is lost.
    pub(super) fn run(mut self) {
        let mut simulator = None;
        let mut index = 0;
        while let Some(job) = self.next() {
            let taken = match job {
                Job::View3d { moving } => {
                    if !self.look(&mut simulator, moving) {
                        return;
                    }
                    continue;
                }
                Job::Image(order) => self.taken(order, index),
                Job::Refined(level) => match &self.left {
                    Some(left) => Taken {
                        order: left.order.clone(),
                        index: left.index,
                        pose: left.pose,
                        seconds: left.seconds,
                        level: Some(level),
                    },
                    None => continue,
                },
                Job::Open(scene, order) => match self.open(*scene, &order) {
                    Ok(opened) => {
                        simulator = Some(opened);
                        self.tell(News::Opened);
                        self.taken(order, index)
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
            index += u32::from(taken.level.is_none());
            let frame = self.carry_out(&mut simulator, &taken);
            match (&frame, &mut self.left) {
                (Err(SimError::Gpu(GpuError::Abandoned)), _) => continue,
                // A picture that cannot be refined stays as it is.
                (Err(_), Some(left)) => left.level = 0,
                _ => {}
            }
            if taken.level.is_none() {
                self.last = Some(taken.order);
            }
            let told = frame.map(|(frame, pixels)| News::Frame(Box::new(frame), pixels));
            if !self.report(told, simulator.is_none()) {
                return;
            }
        }
    }

    /// Pictures the anatomy; returns whether there will be more. A picture begun because something moves is finished,
    /// or there would be no picture at all.
    fn look(&mut self, simulator: &mut Option<(Simulator, Tracer)>, moving: bool) -> bool {
        self.shared.lock().looks_new = false;
        let Some((simulator, _)) = simulator else {
            return true;
        };
        let began = Instant::now();
        simulator.abandon_when((!moving).then(|| self.newer()));
        let pictured = self.picture(simulator).transpose();
        self.view3d_made = (Instant::now(), began.elapsed());
        match pictured {
            // It is still to be made, after the newer job.
            Some(Err(SimError::Gpu(GpuError::Abandoned))) => {
                let mut state = self.shared.lock();
                state.looks_new = state.look.is_some();
                true
            }
            Some(pictured) => {
                let told = pictured.map(|pictured| News::View3d(Box::new(pictured)));
                self.report(told, false)
            }
            None => true,
        }
    }

    /// The contents of an order's image at this moment.
    fn taken(&self, order: Order, index: u32) -> Taken {
        let now = Instant::now();
        Taken { pose: order.pose(now), seconds: order.clock.at(now), order, index, level: None }
    }

    /// Hands news over; returns whether there will be more.
    fn report(&self, news: Result<News, SimError>, fatal: bool) -> bool {
        match news {
            Ok(news) => self.tell(news),
            // Everything on the device is lost with it.
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
        let mut state = self.shared.lock();
        if matches!(news, News::Frame(..)) && self.device.queues.are_shared() {
            state.undrawn.get_or_insert_with(Instant::now);
        }
        state.news.push(news);
        drop(state);
        (self.wake)();
    }

    /// The newest order once there is one, or the last one again while its image changes by itself; at rest
    /// the last image at a finer level; none at the end. Pictures of the anatomy come between.
    fn next(&self) -> Option<Job> {
        let mut state = self.shared.lock();
        loop {
            self.shared.newer.store(false, Ordering::Release);
            if state.stop {
                return None;
            }
            if let Some((scene, order)) = state.opening.take() {
                return Some(Job::Open(scene, order));
            }
            if std::mem::take(&mut state.resend) {
                drop(state);
                // An error of the device will be told by the next frame.
                let _ = self.broadcast.again();
                state = self.shared.lock();
                continue;
            }
            let undrawn = state.undrawn.map(|since| since.elapsed());
            if let Some(late) = undrawn.filter(|late| *late < WINDOW_PATIENCE) {
                state = self.wait(state, Some(WINDOW_PATIENCE - late));
                continue;
            }
            let left = self.left.as_ref();
            let running = (self.last.as_ref()).filter(|last| last.runs(self.imaged));
            let due = !state.frozen && (state.order.is_some() || running.is_some());
            let finer = left.and_then(|left| self.pace.refined(left.level));
            let finer = finer.filter(|_| !due);
            let touched = state.touched.elapsed();
            let quiet = touched.min(self.imaged.elapsed());
            if let Some(level) = finer.filter(|_| quiet >= live::REST) {
                return Some(Job::Refined(level));
            }
            // While something moves the next order is about to come: a job begun before would be in its way.
            let moving = due || touched < live::REST;
            let (ended, took) = self.view3d_made;
            let looks = state.looks_new && left.is_some();
            let put_off = match moving {
                true => (VIEW3D_PUT_OFF * took).saturating_sub(ended.elapsed()),
                false => Duration::ZERO,
            };
            if looks && put_off.is_zero() {
                return Some(Job::View3d { moving });
            }
            if due {
                let again = || running.expect("an order, or a running one").again(Instant::now());
                return Some(Job::Image(state.order.take().unwrap_or_else(again)));
            }
            let rest = finer.map(|_| live::REST - quiet);
            let look = looks.then(|| put_off.min(live::REST.saturating_sub(touched)));
            state = self.wait(state, rest.into_iter().chain(look).min());
        }
    }

    /// Waits until something has changed, but no longer than `most`.
    fn wait<'s>(
        &'s self,
        state: MutexGuard<'s, State>,
        most: Option<Duration>,
    ) -> MutexGuard<'s, State> {
        let changed = &self.shared.changed;
        match most {
            Some(time) => {
                let waited = changed.wait_timeout(state, time);
                waited.unwrap_or_else(PoisonError::into_inner).0
            }
            None => changed.wait(state).unwrap_or_else(PoisonError::into_inner),
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
        self.pace.forget();
        let mut state = self.shared.lock();
        // Orders for the scene before mean nothing here.
        state.order = None;
        state.frozen = false;
        drop(state);
        Ok((simulator, tracer))
    }

    /// Pictures the anatomy of the last image from the wanted view, if there is one.
    fn picture(&mut self, simulator: &mut Simulator) -> Result<Option<Pictured>, SimError> {
        let look = self.shared.lock().look.clone();
        let (Some(look), Some(left)) = (look, &self.left) else {
            return Ok(None);
        };
        // The window may still look at the scene before.
        if look.sight.looks.len() != self.scene.instances.len() {
            return Ok(None);
        }
        let image = self.pictures.free(look.sight.size)?;
        let timings = simulator.view3d(&self.library, &look.sight, &image)?;
        Ok(Some(Pictured {
            image,
            look,
            probe: left.order.settings.probe.clone(),
            pose: left.pose,
            ms: timings.total_ms(),
        }))
    }

    /// Returns a check whether something newer is to be done than the last job begun.
    fn newer(&self) -> Abandon {
        let shared = self.shared.clone();
        Arc::new(move || shared.newer.load(Ordering::Acquire))
    }

    /// Uploads the scene where it is not loaded, and makes room for the scene's own counts.
    fn prepare<'s>(
        &mut self,
        simulator: &'s mut Option<(Simulator, Tracer)>,
        settings: &Settings,
    ) -> Result<(&'s mut Simulator, Arc<Settings>), SimError> {
        let tracer = settings.tracer;
        if simulator.as_ref().is_none_or(|(_, made)| *made != tracer) {
            // The old one first, so that there is room for the new one.
            *simulator = None;
            self.tell(News::Preparing(UPLOADING));
            let made = Simulator::new(&self.device, &self.library, &self.scene, tracer)?;
            self.tell(News::Preparing(match made.compiles() {
                true => COMPILING,
                false => FIRST,
            }));
            *simulator = Some((made, tracer));
        }
        let (simulator, _) = simulator.as_mut().expect("just made");
        let fitted = match &self.fitted {
            Some(fitted) if **fitted == *settings => fitted.clone(),
            _ => {
                simulator.fit(&self.scene)?;
                self.fitted.insert(Arc::new(settings.clone())).clone()
            }
        };
        Ok((simulator, fitted))
    }

    fn carry_out(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        taken: &Taken,
    ) -> Result<(Frame, Option<Pixels>), SimError> {
        #[cfg(debug_assertions)]
        die_where_asked();
        let began = Instant::now();
        let (order, pose, seconds) = (&taken.order, taken.pose, taken.seconds);
        order.settings.apply(&mut self.scene);
        self.scene.world_from_probe = pose;
        let at_rest = taken.level.is_some();
        if !at_rest {
            self.imaged = began;
        }
        self.scene.set_time(seconds);
        // Tables and buffers of the scene's own counts are made once; their time is not part of a frame's.
        let (simulator, settings) = self.prepare(simulator, &order.settings)?;
        let prepared = began.elapsed();
        let looked_at = self.shared.lock().look.is_some();
        self.pace.share(if looked_at { IMAGE_SHARE } else { 1.0 });
        let level = match taken.level {
            Some(level) => level,
            None => self.pace.moving(&self.scene),
        };
        self.pace.apply(level, &mut self.scene);
        // A picture begun because something moves is finished, or there would be no picture at all.
        simulator.abandon_when(at_rest.then(|| self.newer()));
        let scene = &self.scene;
        let image = self.ring.free(image_size(scene))?;
        simulator.show_on(Some(image.clone()));
        let tinted = match order.tint.filter(|_| scene.shows_volume()) {
            Some(tint) => Some((self.ring.free(image_size(scene))?, tint)),
            None => None,
        };
        simulator.tint_on(tinted.clone());
        // The scene's own picture is the one of `render`, with the noise of its first frame.
        let index = if level == 0 && at_rest { 0 } else { taken.index };
        let submitted = simulator.frame(scene, index);
        simulator.show_on(None);
        simulator.tint_on(None);
        submitted?;
        let timings = simulator.wait()?.pop().unwrap_or_default();
        let wall = began.elapsed();
        // The very first frame includes kernels that the driver compiles late.
        if self.left.is_some() {
            self.pace.finished(level, (wall - prepared).as_secs_f64() * 1e3);
        }
        let pixels = match order.reads_back {
            true => {
                let (width, height, rgba) = simulator.pixels()?;
                let size = [width, height];
                Some(Pixels { size, rgba })
            }
            false => None,
        };
        self.left = Some(Imaged { order: order.clone(), index: taken.index, pose, seconds, level });
        let mut state = self.shared.lock();
        state.looks_new = state.look.is_some();
        drop(state);
        let constants = simulator.constants();
        let rgba = pixels.as_ref().map(|pixels| pixels.rgba.as_slice());
        self.broadcast.offer(&image, rgba, constants, pose)?;
        let frame = Frame {
            sector: Sector {
                left: f64::from(constants.image_left),
                top: f64::from(constants.image_top),
                pitch: f64::from(constants.pixel_pitch),
            },
            image,
            tinted: tinted.map(|(image, _)| image),
            probe: order.settings.probe.clone(),
            grade: self.pace.grade(level, scene, at_rest),
            settings,
            pose,
            contact: simulator.contact(),
            seconds,
            revision: order.revision,
            at: order.at,
            timings,
            finished: Instant::now(),
            wall_ms: wall.as_secs_f64() * 1e3,
            update_ms: simulator.update_time().as_secs_f64() * 1e3,
            memory: self.device.memory(),
            scene_memory: simulator.memory(),
            image_bytes: self.ring.bytes(),
        };
        Ok((frame, pixels))
    }
}

/// Panics once the file that a test names is there, and takes it away.
#[cfg(debug_assertions)]
fn die_where_asked() {
    let asked = std::env::var_os("INSONIFY_TEST_DEATH");
    if asked.is_some_and(|file| std::fs::remove_file(file).is_ok()) {
        panic!("a test has asked for it");
    }
}
