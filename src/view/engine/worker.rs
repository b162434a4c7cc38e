//! What the simulation's thread does.

use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use glam::DAffine3;

use super::{Frame, Job, News, PUT_OFF, Pixels, Sector, Shared};
use crate::gpu::{Device, GpuError};
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::shaders::Library;
use crate::sim::{SimError, Simulator, Tracer, image_size};
use crate::view::link::{Broadcast, Link};
use crate::view::look::Pictured;
use crate::view::model::{Order, Settings};
use crate::view::ring::Ring;

/// What the device holds the results of.
struct Imaged {
    probe: Probe,
    pose: DAffine3,
    ended: Instant,
    took: Duration,
}

/// What the thread works with.
pub(super) struct Worker {
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
    pub(super) fn new(
        device: &Arc<Device>,
        library: Arc<Library>,
        scene: Scene,
        link: Link,
        shared: Arc<Shared>,
        wake: Box<dyn Fn() + Send>,
    ) -> Self {
        Self {
            shared,
            ring: Ring::new(device, "B-mode"),
            broadcast: Broadcast::new(link, device),
            pictures: Ring::new(device, "survey"),
            device: device.clone(),
            library,
            scene,
            fitted: None,
            imaged: Instant::now(),
            left: None,
            wake,
        }
    }

    /// Carries out what is ordered until it is stopped, or the device is lost.
    pub(super) fn run(mut self) {
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
                let told = frame.map(|(frame, pixels)| News::Frame(Box::new(frame), pixels));
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
    ) -> Result<(Frame, Option<Pixels>), SimError> {
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
                Some(Pixels { size, rgba })
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
        };
        Ok((frame, pixels))
    }
}
