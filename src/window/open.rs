//! An open window: carries input to the model, the model to the simulation, and its pictures to the
//! window.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::event::WindowEvent;
use winit::event_loop::EventLoopProxy;
use winit::window::Window;

use super::deaths::Deaths;
use super::engine::News;
use super::exit::Exit;
use super::leaving;
use super::link::Link;
use super::look::{Look, Pictured};
use super::opening::{Opened, Opening};
use super::orders::Commands;
use super::picture::Frame;
use super::session::Session;
use super::state::State;
use super::tools::Tools;
use super::wake::{Woken, waker};
use super::watch::Watch;
use super::{Model, Options, ViewError, acts};
use crate::gpu::Device;
use crate::scene::Scene;

mod gestures;
mod making;
mod paint;
mod scenes;

/// Factor on the time of a drawing: while an image is being made, changes by events are drawn with the image, or
/// after so long. On a slow device the time then goes to the simulation.
const DRAWING_PUT_OFF: u32 = 8;

/// The answer to a client who wants another scene while something is unsaved.
const ASKED: &str = "waiting for the user, whom the window asks what becomes of unsaved work";

/// A window with its simulation and the user's state.
pub(super) struct Open {
    /// The last finished picture; declared before the session, so that its device still exists when it is dropped.
    frame: Option<Frame>,
    /// The last finished picture of the 3D view.
    pictured: Option<Pictured>,
    session: Session,
    model: Model,
    state: State,
    /// Revision of the model that the simulation has received.
    ordered: u64,
    /// View of the anatomy that the simulation has received.
    look: Option<Look>,
    /// True until the picture has been on the screen.
    fresh: bool,
    /// Number of pictures that were replaced before they came to the screen, until it is noted.
    unseen: u64,
    /// Times of the last pictures of the 3D view, ms, until they are noted.
    pictures_ms: Vec<f64>,
    /// Arrival of the last input.
    touched: Instant,
    /// Start and duration of the last drawing of the window.
    painted: (Instant, Duration),
    /// True while an image has been ordered and has not come yet.
    awaited: bool,
    /// Next time at which the interface wants to be drawn.
    again: Option<Instant>,
    input: egui_winit::State,
    /// The modifier keys that are held.
    held: winit::event::Modifiers,
    window: Arc<Window>,
    title: String,
    opening: Option<Opening>,
    /// The scene's files, watched for changes.
    watch: Watch,
    /// Number of savings that the watch knows of.
    saved: u64,
    /// A scene that has been handed to the simulation.
    coming: Option<Opened>,
}

/// Everything from which a session is made, and made again where its device is lost.
pub(super) struct Plan {
    pub(super) scene: Scene,
    pub(super) options: Options,
    pub(super) proxy: EventLoopProxy<Woken>,
    /// The OpenIGTLink server stays whatever becomes of the device.
    pub(super) link: Link,
    pub(super) deaths: Deaths,
}

impl Plan {
    fn tools(&self, device: &Device) -> Tools {
        let (folder, proxy) = (self.options.captures.clone(), self.proxy.clone());
        Tools::new(device.info(), folder, waker(proxy))
    }

    fn session(
        &self,
        device: Arc<Device>,
        window: &Arc<Window>,
        model: &Model,
    ) -> Result<Session, ViewError> {
        let (scene, proxy, link) = (self.scene.clone(), self.proxy.clone(), self.link.clone());
        Session::new(device, window, &self.options, scene, model.order(), proxy, link)
    }
}

impl Open {
    /// Takes over what simulation and devices have to say; an error after which nothing more will
    /// come.
    pub(super) fn listen(&mut self, plan: &mut Plan) -> Result<(), ViewError> {
        let (mut failed, mut pictures_only) = (Ok(()), true);
        self.receive(plan);
        for news in self.session.engine.news() {
            pictures_only &= matches!(news, News::View3d(_));
            match news {
                News::Frame(frame, film) => {
                    (self.awaited, self.state.prepares) = (false, false);
                    self.model.follow(Instant::now());
                    if self.frame.is_none() {
                        self.model.begin_replay(Instant::now());
                    }
                    self.model.film(&frame, film);
                    self.state.common.tools.record((*frame).clone());
                    self.state.dual.refine(&frame);
                    self.state.panels.view3d.pace(frame.grade.budget_ms);
                    self.frame = Some(*frame);
                    self.unseen += u64::from(std::mem::replace(&mut self.fresh, true));
                    self.state.problem = None;
                }
                News::Columns(probe, aim, columns) => {
                    self.model.film_columns(&probe, aim, columns);
                }
                News::Spectra(heard) => self.model.hear(&heard),
                News::Anew(frame) => {
                    self.state.prepares = false;
                    self.state.common.tools.put_back(&frame);
                    self.state.dual.refine(&frame);
                }
                News::View3d(pictured) => {
                    self.pictures_ms.push(pictured.ms);
                    self.state.panels.view3d.learn(&pictured);
                    self.pictured = Some(*pictured);
                }
                News::Preparing(what) => (self.state.preparing, self.state.prepares) = (what, true),
                News::Refused(problem) => {
                    (self.awaited, self.state.prepares) = (false, false);
                    self.state.problem = Some(problem);
                }
                News::Opened => self.adopt(plan),
                News::NotOpened(problem) => self.refuse(problem),
                News::Failed(error) => failed = Err(error.into()),
                News::Died => {
                    self.state.deaths.simulation_died();
                    failed = Err(ViewError::Died);
                }
            }
        }
        self.look();
        // Now, not with the next drawing, which may never come in a hidden window.
        self.tell();
        match pictures_only {
            true => self.draw_soon(Instant::now()),
            false => self.window.request_redraw(),
        }
        failed
    }

    /// Sets the window's title: scene and file, and a mark where something is unsaved.
    fn entitle(&mut self) {
        let (model, files) = (&self.model, &self.state.common.files);
        let mark = match model.is_modified(files.with_pose) {
            true => "*",
            false => "",
        };
        let title = format!("{mark}{} - insonify", model.title);
        if title != self.title {
            self.window.set_title(&title);
            self.title = title;
        }
    }

    /// Hands an event to the interface.
    pub(super) fn take(&mut self, event: &WindowEvent) {
        let now = Instant::now();
        if let WindowEvent::ModifiersChanged(held) = event {
            self.held = *held;
        }
        let response = self.input.on_window_event(&self.window, event);
        if response.repaint {
            self.touched = now;
            self.draw_soon(now);
        }
    }

    /// Draws the changes of an event: now, or with the image that is being made where that comes soon.
    fn draw_soon(&mut self, now: Instant) {
        let (began, took) = self.painted;
        let at = began + DRAWING_PUT_OFF * took;
        if at <= now || !self.awaited {
            self.window.request_redraw();
        } else {
            self.again = Some(self.again.map_or(at, |again| again.min(at)));
        }
    }

    /// Sends the changes to the simulation.
    fn tell(&mut self) {
        // A scene to be adopted has settings of its own.
        if self.model.revision() != self.ordered && self.coming.is_none() {
            self.ordered = self.model.revision();
            let (order, frozen) = (self.model.order(), self.model.frozen);
            self.session.engine.order(order, frozen);
            self.awaited = !frozen;
        }
    }

    /// Draws if a drawing is due; else returns the time when it will be.
    pub(super) fn due(&mut self, now: Instant) -> Option<Instant> {
        if self.state.common.inputs.due.is_some_and(|at| at <= now) {
            // The tracker is lost, or has been for longer.
            self.look();
            self.window.request_redraw();
        }
        if self.again.is_some_and(|at| at <= now) {
            self.again = None;
            self.window.request_redraw();
        }
        let kept = match self.state.quit {
            true => None,
            false => self.keep(now),
        };
        self.again.into_iter().chain(self.state.common.inputs.due).chain(kept).min()
    }

    /// Keeps what is unsaved; returns when to do so again.
    fn keep(&mut self, now: Instant) -> Option<Instant> {
        let mut keeper = std::mem::take(&mut self.state.keeper);
        let common = &mut self.state.common;
        let due = keeper.keep(&self.model, &common.tools, common.files.with_pose, now);
        if let Some(fault) = keeper.fault() {
            common.tools.notices.warn(fault.to_owned());
        }
        self.state.keeper = keeper;
        due
    }

    /// Ends the session as the user wants it: nothing is kept.
    pub(super) fn end(&mut self) {
        self.state.keeper.forget();
    }

    /// Takes over the news of the devices.
    fn look(&mut self) {
        if self.state.common.inputs.look(&mut self.model) {
            self.session.engine.send_again();
        }
        while let Some(request) = self.state.common.inputs.request() {
            let (now, mut wanted) = (Instant::now(), None);
            let model = &mut self.model;
            let mut commands = Commands { model, wanted: &mut wanted, now };
            let mut outcome = request.order.carry_out(&mut commands);
            if let Some(path) = wanted {
                leaving::leave(Exit::Open(path), &mut self.model, &mut self.state, now);
                if self.state.leaving.is_some() {
                    outcome = Ok(ASKED.to_owned());
                }
            }
            request.answer(outcome);
            self.window.request_redraw();
        }
        let word = self.state.common.inputs.word.clone();
        acts::apply_pads(&word, &mut self.model, &mut self.state, Instant::now());
    }

    /// Goes on without a simulation until the user wants it again.
    pub(super) fn stop(&mut self) {
        self.state.stopped = true;
        self.awaited = false;
        if self.coming.take().is_some() && self.opening.is_none() {
            self.state.common.files.opening = None;
        }
        self.window.request_redraw();
    }

    /// There has been no image yet.
    pub(super) fn is_empty(&self) -> bool {
        self.frame.is_none()
    }

    /// The user wants the simulation again.
    pub(super) fn restarts(&self) -> bool {
        self.state.restart
    }

    /// The user wants to close the window: asks first what becomes of unsaved work.
    pub(super) fn leave(&mut self) {
        leaving::leave(Exit::Quit, &mut self.model, &mut self.state, Instant::now());
        self.window.request_redraw();
    }

    /// The user leaves.
    pub(super) fn is_done(&self) -> bool {
        self.state.quit
    }
}
