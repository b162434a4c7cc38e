//! An open window: carries input to the model, the model to the simulation, and its pictures to the
//! window.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::deaths::Deaths;
use super::engine::{Frame, News};
use super::files::Files;
use super::inputs::{self, Inputs};
use super::link::{Bell, Link};
use super::look::{Look, Pictured};
use super::model::{File, StoredTrajectory};
use super::opening::{self, Opened, Opening};
use super::session::{self, Session, Wake};
use super::state::State;
use super::timing;
use super::tools::Tools;
use super::{Model, Options, ViewError, keys, planes, style, view3d};
use crate::gpu::{Device, ValidationLog};
use crate::output;
use crate::scene::Scene;
use crate::sim;

mod gestures;
mod paint;
mod scenes;

/// Factor on the time of a drawing: while an image is being made, changes by events are drawn with the image, or
/// after so long. On a slow device the time then goes to the simulation.
const DRAWING_PUT_OFF: u32 = 8;

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
    told: u64,
    /// View of the anatomy that the simulation has received.
    look: Option<Look>,
    /// True until the picture has been on the screen.
    fresh: bool,
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
    window: Arc<Window>,
    title: String,
    opening: Option<Opening>,
    /// A scene that has been handed to the simulation.
    coming: Option<Opened>,
}

/// Everything from which a session is made, and made again where its device is lost.
pub(super) struct Plan {
    pub(super) scene: Scene,
    pub(super) options: Options,
    pub(super) proxy: EventLoopProxy<Wake>,
    /// The OpenIGTLink server stays whatever becomes of the device.
    pub(super) link: Link,
    pub(super) deaths: Deaths,
}

impl Plan {
    fn tools(&self, device: &Device) -> Tools {
        let (folder, proxy) = (self.options.captures.clone(), self.proxy.clone());
        Tools::new(device.info(), folder, session::waker(proxy))
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

/// Input for a window on `device`, its interface `zoom` times as large as usual. The textures of an
/// earlier interface are lost with its device: this one sends them again.
fn interface(window: &Window, zoom: f32, device: &Device) -> egui_winit::State {
    let context = egui::Context::default();
    context.set_zoom_factor(zoom);
    let scale = window.scale_factor() as f32;
    style::apply(&context);
    let root = egui::ViewportId::ROOT;
    let limit = device.limits().max_image_2d as usize;
    egui_winit::State::new(context, root, window, Some(scale), None, Some(limit))
}

impl Open {
    /// Opens a window. The log is the device's.
    pub(super) fn new(
        events: &ActiveEventLoop,
        plan: &mut Plan,
    ) -> Result<(Self, ValidationLog), ViewError> {
        let window = session::window(events, &plan.scene.name)?;
        let device = session::device(&plan.options, &window)?;
        let (options, now) = (&plan.options, Instant::now());
        let scene = plan.scene.clone();
        let file = File::new(options.file.clone(), options.overrides.clone(), &scene);
        let suited = opening::suited(scene, file, options, &device, options.seconds, now);
        let Opened { scene, mut model } = suited.map_err(ViewError::Refused)?;
        if let Some((track, file)) = plan.options.trajectory.take() {
            model.await_replay(StoredTrajectory::loaded(track, inputs::name(&file)), now);
        }
        plan.scene = scene;
        let machine = sim::machine(&device);
        let (link, bell) = (plan.link.clone(), Bell::new(plan.proxy.clone()));
        let inputs = Inputs::new(link, bell, plan.scene.tracker.clone(), plan.options.listen)?;
        if let Some(address) = inputs.address() {
            output::line(format!("listening at {address} (OpenIGTLink)"));
        }
        let state = State {
            console: true,
            timing: false,
            view3d: view3d::State::default(),
            planes: planes::State::default(),
            times: timing::Page::default(),
            help: false,
            mmode: Default::default(),
            tissue: 0,
            mesh: 0,
            machine,
            files: Files::default(),
            ray_query: device.supports_ray_query(),
            heap: device.info().memory_bytes,
            device: format!("{} ({})", device.name(), device.driver()),
            problem: None,
            deaths: plan.deaths.clone(),
            stopped: false,
            restart: false,
            preparing: "Opening the device",
            tools: plan.tools(&device),
            inputs,
            quit: false,
        };
        let input = interface(&window, plan.options.scale, &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        Ok((Self::with(session, model, state, input, window), log))
    }

    /// The same window with another simulation on a new device; `problem` is shown in it. The log is the new
    /// device's.
    pub(super) fn again(
        self,
        plan: &Plan,
        problem: Option<String>,
    ) -> Result<(Self, ValidationLog), ViewError> {
        let Self {
            frame, pictured, session, model, mut state, input, window, title, opening, ..
        } = self;
        // A scene handed over is lost with the device; the user can open it again.
        state.files.opening = opening.is_some();
        // Everything on the lost device is dropped before there is another.
        drop((frame, pictured));
        state.tools.lose();
        drop(session);
        let device = session::device(&plan.options, &window)?;
        // Its texture is lost with the device.
        state.mmode = Default::default();
        state.problem = problem;
        (state.stopped, state.restart) = (false, false);
        let input = interface(&window, input.egui_ctx().zoom_factor(), &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self { title, opening, ..Self::with(session, model, state, input, window) };
        Ok((made, log))
    }

    /// A window before its first picture.
    fn with(
        session: Session,
        model: Model,
        state: State,
        input: egui_winit::State,
        window: Arc<Window>,
    ) -> Self {
        Self {
            frame: None,
            pictured: None,
            session,
            told: model.revision(),
            look: None,
            model,
            state,
            fresh: false,
            pictures_ms: Vec::new(),
            touched: Instant::now(),
            painted: (Instant::now(), Duration::ZERO),
            awaited: false,
            again: None,
            input,
            window,
            title: String::new(),
            opening: None,
            coming: None,
        }
    }

    /// Takes over what simulation and devices have to say; an error after which nothing more will
    /// come.
    pub(super) fn listen(&mut self, plan: &mut Plan) -> Result<(), ViewError> {
        let (mut failed, mut pictures_only) = (Ok(()), true);
        self.receive(plan);
        for news in self.session.engine.news() {
            pictures_only &= matches!(news, News::View3d(_));
            match news {
                News::Frame(frame, pixels) => {
                    self.awaited = false;
                    self.model.follow(Instant::now());
                    if self.frame.is_none() {
                        self.model.begin_replay(Instant::now());
                    }
                    if let Some(pixels) = pixels {
                        self.model.film(&frame, &pixels);
                    }
                    self.state.tools.record((*frame).clone());
                    self.state.view3d.pace(frame.grade.budget_ms);
                    self.frame = Some(*frame);
                    self.fresh = true;
                    self.state.problem = None;
                }
                News::View3d(pictured) => {
                    self.pictures_ms.push(pictured.ms);
                    self.state.view3d.learn(&pictured);
                    self.pictured = Some(*pictured);
                }
                News::Preparing(what) => self.state.preparing = what,
                News::Refused(problem) => {
                    self.awaited = false;
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
        let (model, files) = (&self.model, &self.state.files);
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
        if self.model.revision() != self.told && self.coming.is_none() {
            self.told = self.model.revision();
            let (order, frozen) = (self.model.order(), self.model.frozen);
            self.session.engine.order(order, frozen);
            self.awaited = !frozen;
        }
    }

    /// Draws if a drawing is due; else returns the time when it will be.
    pub(super) fn due(&mut self, now: Instant) -> Option<Instant> {
        if self.state.inputs.due.is_some_and(|at| at <= now) {
            // The tracker is lost, or has been for longer.
            self.look();
            self.window.request_redraw();
        }
        if self.again.is_some_and(|at| at <= now) {
            self.again = None;
            self.window.request_redraw();
        }
        self.again.into_iter().chain(self.state.inputs.due).min()
    }

    /// Takes over the news of the devices.
    fn look(&mut self) {
        if self.state.inputs.look(&mut self.model) {
            self.session.engine.send_again();
        }
        let word = self.state.inputs.word.clone();
        keys::apply_pads(&word, &mut self.model, &mut self.state, Instant::now());
    }

    /// Goes on without a simulation until the user wants it again.
    pub(super) fn stop(&mut self) {
        self.state.stopped = true;
        self.awaited = false;
        if self.coming.take().is_some() {
            self.state.files.opening = self.opening.is_some();
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

    /// The user wants to leave.
    pub(super) fn is_done(&self) -> bool {
        self.state.quit
    }
}
