//! The event loop.

use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::json;
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::WindowId;

use super::deaths::Deaths;
use super::link::Link;
use super::open::{Open, Plan};
use super::statistics::Times;
use super::wake::{Woken, waker};
use super::{Options, ViewError};
use crate::gpu::{GpuError, Screenshot, ValidationLog};
use crate::output::{self, files};
use crate::scene::Scene;
use crate::sim::SimError;

/// Time within which a second loss of the device ends the program: it would be lost again.
const PATIENCE: Duration = Duration::from_secs(10);

/// The application: what the event loop drives.
pub(super) struct App {
    plan: Plan,
    open: Option<Open>,
    statistics: Times,
    /// Time at which device and simulation were last made anew.
    lost: Option<Instant>,
    log: Option<ValidationLog>,
    failure: Option<ViewError>,
}

impl App {
    pub(super) fn new(scene: Scene, options: Options, proxy: EventLoopProxy<Woken>) -> Self {
        let deaths = Deaths::default();
        deaths.watch(waker(proxy.clone()));
        let plan = Plan { scene, options, proxy, link: Link::default(), deaths };
        Self {
            plan,
            open: None,
            statistics: Times::default(),
            lost: None,
            log: None,
            failure: None,
        }
    }

    /// Closes everything; returns the error that ended it, if one did.
    pub(super) fn finish(mut self) -> Result<(), ViewError> {
        self.open = None;
        if let Some(file) = &self.plan.options.json {
            let mut report = self.statistics.report();
            if let Some(link) = self.plan.link.report() {
                let (sent, dropped) = (link.status.images_sent, link.status.images_dropped);
                report["clients"] = json!({ "images_sent": sent, "images_dropped": dropped });
            }
            let written = files::replace(file, output::json(&report).as_bytes());
            self.failure = self.failure.or(written.err().map(|e| unwritten(file, &e)));
        }
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        let messages = self.log.map(|log| log.messages()).unwrap_or_default();
        match messages.first() {
            Some(first) => {
                Err(ViewError::Validation { count: messages.len(), first: first.clone() })
            }
            None => Ok(()),
        }
    }

    /// Takes over the opened window; ends the event loop where there is none.
    fn adopt(
        &mut self,
        events: &ActiveEventLoop,
        opened: Result<(Open, ValidationLog), ViewError>,
    ) {
        match opened {
            Ok((open, log)) => {
                self.open = Some(open);
                self.log = Some(log);
            }
            Err(error) => {
                self.failure = Some(error);
                events.exit();
            }
        }
    }

    /// Goes on with a new device and simulation where one of them is gone. Where that has just been done, the
    /// window ends without a device; without a simulation it stays, with what is not saved.
    fn fail(&mut self, events: &ActiveEventLoop, error: ViewError) {
        let again = self.lost.is_some_and(|at| at.elapsed() < PATIENCE);
        match (&error, &mut self.open) {
            (ViewError::Died, Some(open)) if again || open.is_empty() => open.stop(),
            (ViewError::Died, _) => self.restart(events, None),
            (lost, _) if is_lost(lost) && !again => {
                self.restart(events, Some(format!("{error}. It was opened again.")));
            }
            _ => {
                self.open = None;
                self.failure = Some(if again { lost_again(error) } else { error });
                events.exit();
            }
        }
    }

    /// Another simulation on a new device, with what there is to say of it.
    fn restart(&mut self, events: &ActiveEventLoop, problem: Option<String>) {
        if let Some(open) = self.open.take() {
            let opened = open.again(&self.plan, problem);
            self.adopt(events, opened.map_err(lost_again));
            // From when it is open: how long that takes is the machine's affair.
            self.lost = Some(Instant::now());
        }
    }

    fn draw(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        let began = Instant::now();
        let shot = self.plan.options.screenshot.is_some();
        let painted = open.paint(&mut self.statistics, shot);
        open.begin(&self.plan);
        let took = began.elapsed().as_secs_f64() * 1e3;
        self.statistics.add_interface(took);
        if open.is_done() {
            open.end();
            events.exit();
        }
        match painted {
            Ok(Some(shot)) => {
                self.failure = self.save(&shot).err();
                events.exit();
            }
            Ok(None) if open.restarts() => self.restart(events, None),
            Ok(None) => {}
            Err(error) => self.fail(events, error.into()),
        }
    }

    fn save(&self, shot: &Screenshot) -> Result<(), ViewError> {
        let Some(file) = &self.plan.options.screenshot else {
            return Ok(());
        };
        let [width, height] = shot.size;
        let colour = image::ExtendedColorType::Rgba8;
        image::save_buffer(file, &shot.rgba, width, height, colour)
            .map_err(|error| unwritten(file, &error))
    }
}

fn unwritten(file: &Path, error: &dyn std::error::Error) -> ViewError {
    ViewError::Unwritten { file: file.to_owned(), reason: error.to_string() }
}

impl ApplicationHandler<Woken> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            let opened = Open::new(events, &mut self.plan);
            self.adopt(events, opened);
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, _: Woken) {
        let plan = &mut self.plan;
        let failed = self.open.as_mut().map(|open| open.listen(plan));
        if let Some(Err(error)) = failed {
            self.fail(events, error);
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match (event, &mut self.open) {
            (WindowEvent::RedrawRequested, _) => self.draw(events),
            (WindowEvent::CloseRequested, Some(open)) => open.leave(),
            (WindowEvent::CloseRequested, None) => events.exit(),
            (WindowEvent::DroppedFile(path), Some(open)) => open.drop_file(&path),
            (event, Some(open)) => open.take(&event),
            (_, None) => {}
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let due = self.open.as_mut().and_then(|open| open.due(Instant::now()));
        events.set_control_flow(match due {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        });
    }
}

/// Returns true for an error that says that the device is gone.
fn is_lost(error: &ViewError) -> bool {
    matches!(
        error,
        ViewError::Gpu(GpuError::DeviceLost { .. })
            | ViewError::Sim(SimError::Gpu(GpuError::DeviceLost { .. }))
    )
}

/// The error after a device was lost once before: another loss gets a remedy.
fn lost_again(error: ViewError) -> ViewError {
    match is_lost(&error) {
        true => ViewError::LostAgain(Box::new(error)),
        false => error,
    }
}
