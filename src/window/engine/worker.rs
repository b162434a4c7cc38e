//! The work of the simulation's thread.

mod columns;
mod pictures;
mod spectra;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use glam::DAffine3;
use parking_lot::MutexGuard;

use super::{
    Job, News, Past, STRIP_LONGEST, STRIP_PUT_OFF, Shared, State, VIEW3D_PUT_OFF, WINDOW_PATIENCE,
};
use crate::gpu::{Device, GpuError};
use crate::link::{Broadcast, Link};
use crate::live::{self, Pace};
use crate::model::{Order, Settings};
use crate::picture::Film;
use crate::ring::Ring;
use crate::scene::Scene;
use crate::sim::shaders::Library;
use crate::sim::{self, SimError, Simulator, Tracer};
use crate::wake::Wake;
use columns::Columns;
use spectra::Gate;

/// The last picture, and the state that it left on the device.
struct Imaged {
    order: Order,
    /// Number of orders carried out before.
    index: u32,
    pose: DAffine3,
    seconds: f64,
    level: usize,
}

impl Imaged {
    /// Returns whether it shows an image of the loop.
    fn shows(&self, past: &Past) -> bool {
        (self.pose, self.seconds) == (past.pose, past.seconds)
            && self.order.settings == *past.settings
    }
}

/// The contents of an image to be made.
struct Taken {
    order: Order,
    index: u32,
    pose: DAffine3,
    seconds: f64,
    /// Level of the ladder; none leaves it to the pace.
    level: Option<usize>,
    /// True for an image of the loop, made again.
    past: bool,
    /// Moment at which they were decided.
    at: Instant,
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
    /// Duration of that picture.
    took: Duration,
    /// The last order carried out, or tried.
    last: Option<Order>,
    /// The state that the last picture left on the device.
    left: Option<Imaged>,
    /// Chooses the counts of the next picture.
    pace: Pace,
    /// Columns of the M-mode strip.
    columns: Columns,
    /// Spectra of pulsed-wave Doppler.
    gate: Gate,
    /// End and duration of the last picture of the anatomy.
    view3d_made: (Instant, Duration),
    wake: Wake,
}

/// Hands news to the window.
fn hand_over(shared: &Shared, wake: &Wake, news: News) {
    shared.state.lock().news.push(news);
    wake();
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
            broadcast: Broadcast::new(link),
            pictures: Ring::new(device, "view3d"),
            device: device.clone(),
            library,
            scene,
            fitted: None,
            imaged: Instant::now(),
            took: Duration::ZERO,
            last: None,
            left: None,
            pace: Pace::new(machine),
            columns: Columns::new(),
            gate: Gate::default(),
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
                Job::Strips(order) => {
                    let taken = self.taken(order, index);
                    let news = match self.strips(&mut simulator, &taken) {
                        Ok(Some(Film::Columns(aim, columns))) => {
                            let probe = taken.order.settings.probe.clone();
                            Ok(News::Columns(Box::new(probe), aim, columns))
                        }
                        Ok(Some(_)) if Self::has_spectra(&taken.order) => continue,
                        // The strip has none of its own: an image is due.
                        Ok(_) => {
                            self.took = Duration::ZERO;
                            continue;
                        }
                        Err(error) => Err(error),
                    };
                    if !self.report(news, false) {
                        return;
                    }
                    continue;
                }
                Job::Refined(level) => match &self.left {
                    Some(left) => Taken {
                        order: left.order.clone(),
                        index: left.index,
                        pose: left.pose,
                        seconds: left.seconds,
                        level: Some(level),
                        past: false,
                        at: Instant::now(),
                    },
                    None => continue,
                },
                Job::Anew(past) => match &self.left {
                    Some(left) => Taken {
                        order: left.order.with((*past.settings).clone()),
                        index: left.index,
                        pose: past.pose,
                        seconds: past.seconds,
                        level: Some(0),
                        past: true,
                        at: Instant::now(),
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
            let film = self.strips(&mut simulator, &taken);
            let frame = film.and_then(|film| self.carry_out(&mut simulator, &taken, film));
            match (&frame, &mut self.left) {
                (Err(SimError::Gpu(GpuError::Abandoned)), _) => continue,
                // A picture that cannot be refined stays as it is.
                (Err(_), Some(left)) => left.level = 0,
                _ => {}
            }
            if taken.past && frame.is_err() {
                self.shared.state.lock().past = None;
            }
            if taken.level.is_none() {
                self.last = Some(taken.order);
            }
            let news = frame.map(|(frame, film)| match taken.past {
                true => News::Anew(Box::new(frame)),
                false => News::Frame(Box::new(frame), film),
            });
            if !self.report(news, simulator.is_none()) {
                return;
            }
        }
    }

    /// Tells the spectra, and makes what the M-mode strip gets: see [`Self::columns`].
    fn strips(
        &mut self,
        simulator: &mut Option<(Simulator, Tracer)>,
        taken: &Taken,
    ) -> Result<Option<Film>, SimError> {
        if let Some(heard) = self.spectra(simulator, taken)? {
            self.tell(News::Spectra(Box::new(heard)));
        }
        self.columns(simulator, taken)
    }

    /// Pictures the anatomy; returns whether there will be more. A picture begun because something moves is finished,
    /// or there would be no picture at all.
    fn look(&mut self, simulator: &mut Option<(Simulator, Tracer)>, moving: bool) -> bool {
        self.shared.state.lock().looks_new = false;
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
                let mut state = self.shared.state.lock();
                state.looks_new = state.look.is_some();
                true
            }
            Some(pictured) => {
                let news = pictured.map(|pictured| News::View3d(Box::new(pictured)));
                self.report(news, false)
            }
            None => true,
        }
    }

    /// The contents of an order's image at this moment.
    fn taken(&self, order: Order, index: u32) -> Taken {
        let now = Instant::now();
        let (pose, seconds) = (order.pose(now), order.clock.at(now));
        Taken { pose, seconds, order, index, level: None, past: false, at: now }
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
        if matches!(news, News::Frame(..)) && self.device.shares_queue() {
            self.shared.state.lock().undrawn.get_or_insert_with(Instant::now);
        }
        hand_over(&self.shared, &self.wake, news);
    }

    /// The newest order once there is one, or the last one again while its image changes by itself; at rest
    /// the last image at a finer level; none at the end. Pictures of the anatomy come between.
    fn next(&self) -> Option<Job> {
        let mut state = self.shared.state.lock();
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
                let _ = self.broadcast.send(None);
                state = self.shared.state.lock();
                continue;
            }
            let undrawn = state.undrawn.map(|since| since.elapsed());
            if let Some(late) = undrawn.filter(|late| *late < WINDOW_PATIENCE) {
                self.wait(&mut state, Some(WINDOW_PATIENCE - late));
                continue;
            }
            let left = self.left.as_ref();
            let running = (self.last.as_ref()).filter(|last| last.runs(self.imaged));
            let due = !state.frozen && (state.order.is_some() || running.is_some());
            let finer = left.and_then(|left| self.pace.refined(left.level));
            let finer = finer.filter(|_| !due);
            let past = state.past.as_ref().filter(|_| state.frozen && !due);
            let past = past.filter(|past| left.is_some_and(|left| !left.shows(past)));
            let touched = state.touched.elapsed();
            let quiet = touched.min(self.imaged.elapsed());
            if quiet >= live::REST {
                let finer = finer.map(Job::Refined);
                if let Some(job) = past.cloned().map(Job::Anew).or(finer) {
                    return Some(job);
                }
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
                if let Some(order) = state.order.take() {
                    return Some(Job::Image(order));
                }
                let again = running.expect("an order, or a running one").again(Instant::now());
                let stands = (STRIP_PUT_OFF * self.took).min(STRIP_LONGEST);
                let strips = self.has_columns(&again) || Self::has_spectra(&again);
                return Some(match strips && self.imaged.elapsed() < stands {
                    true => Job::Strips(again),
                    false => Job::Image(again),
                });
            }
            let waits = finer.is_some() || past.is_some();
            let rest = waits.then(|| live::REST.saturating_sub(quiet));
            let look = looks.then(|| put_off.min(live::REST.saturating_sub(touched)));
            self.wait(&mut state, rest.into_iter().chain(look).min());
        }
    }

    /// Waits until something has changed, but no longer than `most`.
    fn wait(&self, state: &mut MutexGuard<'_, State>, most: Option<Duration>) {
        match most {
            Some(time) => {
                self.shared.changed.wait_for(state, time);
            }
            None => self.shared.changed.wait(state),
        }
    }
}
