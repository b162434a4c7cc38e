//! What exists while there is a window: input to the model, the model to the simulation, its pictures
//! to the window.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::engine::{Frame, News};
use super::session::{self, Session, Wake};
use super::state::State;
use super::statistics::{Sample, Times};
use super::tools::Tools;
use super::{Model, Options, ViewError, keys, layout, style};
use crate::gpu::{AdapterKind, Device, GpuError, Interface, Painted, Placed, Shot, ValidationLog};
use crate::scene::Scene;
use crate::scene::settings::Machine;
use crate::sim::SimError;

/// A window with its simulation, and what the user has made of them.
pub(super) struct Open {
    /// The picture last finished; before the session, so that its device is still there.
    frame: Option<Frame>,
    session: Session,
    model: Model,
    state: State,
    /// Revision of the model that the simulation has been told.
    told: u64,
    /// The picture has not been on the screen yet.
    fresh: bool,
    /// When the last input arrived.
    touched: Instant,
    /// When the interface wants to be drawn again.
    again: Option<Instant>,
    input: egui_winit::State,
    window: Arc<Window>,
}

/// What a session is made from, again where its device is lost.
pub(super) struct Plan {
    pub(super) scene: Scene,
    pub(super) options: Options,
    pub(super) proxy: EventLoopProxy<Wake>,
}

impl Plan {
    fn session(
        &self,
        device: Arc<Device>,
        window: &Arc<Window>,
        model: &Model,
    ) -> Result<Session, ViewError> {
        let (scene, proxy) = (self.scene.clone(), self.proxy.clone());
        Session::new(device, window, &self.options, scene, model.order(), proxy)
    }
}

/// Input for a window on `device`. Textures of an interface before are gone with its device: this
/// one sends them again.
fn interface(window: &Window, scale: f32, device: &Device) -> egui_winit::State {
    let context = egui::Context::default();
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
        let device = session::device(&plan.options)?;
        let lattice = plan.scene.simulation.cell * plan.scene.probe.frequency;
        let simulation = &mut plan.scene.simulation;
        let suited = (plan.options.prepare)(&device, simulation);
        let tracer = suited.map_err(ViewError::Refused)?;
        let machine = match device.info().kind {
            AdapterKind::Cpu => Machine::Software,
            _ => Machine::Gpu,
        };
        let now = Instant::now();
        let model = Model::new(&plan.scene, tracer, plan.options.seconds, now);
        let state = State {
            console: true,
            timing: false,
            help: false,
            mmode: Default::default(),
            tissue: 0,
            mesh: 0,
            machine,
            lattice,
            ray_query: device.supports_ray_query(),
            device: format!("{} ({})", device.name(), device.driver()),
            problem: None,
            tools: Tools::new(device.info()),
            quit: false,
        };
        let input = interface(&window, window.scale_factor() as f32, &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self {
            frame: None,
            session,
            told: model.revision(),
            model,
            state,
            fresh: false,
            touched: now,
            again: None,
            input,
            window,
        };
        Ok((made, log))
    }

    /// The same window on a new device, after `error`. The log is the new device's.
    pub(super) fn again(
        self,
        plan: &Plan,
        error: &ViewError,
    ) -> Result<(Self, ValidationLog), ViewError> {
        let Self {
            frame,
            session,
            model,
            mut state,
            input,
            window,
            touched,
            ..
        } = self;
        // All that is on the lost device ends before there is another.
        drop(frame);
        state.tools.lose();
        drop(session);
        let device = session::device(&plan.options)?;
        // Its texture is gone with the device.
        state.mmode = Default::default();
        state.problem = Some(format!("{error}. It was opened again."));
        let input = interface(&window, input.egui_ctx().pixels_per_point(), &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self {
            frame: None,
            session,
            told: model.revision(),
            model,
            state,
            fresh: false,
            touched,
            again: None,
            input,
            window,
        };
        Ok((made, log))
    }

    /// Takes over what the simulation has to say; an error after which nothing more will come.
    pub(super) fn listen(&mut self) -> Result<(), SimError> {
        let mut failed = Ok(());
        for news in self.session.engine.news() {
            match news {
                News::Frame(frame) => {
                    self.model.film(&frame);
                    self.state.tools.record((*frame).clone());
                    self.frame = Some(*frame);
                    self.fresh = true;
                    self.state.problem = None;
                }
                News::Refused(problem) => self.state.problem = Some(problem),
                News::Failed(error) => failed = Err(error),
            }
        }
        self.window.request_redraw();
        failed
    }

    /// Hands an event to the interface.
    pub(super) fn take(&mut self, event: &WindowEvent) {
        let now = Instant::now();
        let response = self.input.on_window_event(&self.window, event);
        if response.repaint {
            self.touched = now;
            self.window.request_redraw();
        }
    }

    /// One picture of the window; with its pixels where they are wanted and there is an image.
    pub(super) fn paint(
        &mut self,
        times: &mut Times,
        shot: bool,
    ) -> Result<Option<Shot>, GpuError> {
        let input = self.input.take_egui_input(&self.window);
        let context = self.input.egui_ctx().clone();
        let (model, state, touched) = (&mut self.model, &mut self.state, self.touched);
        let (mut shown, mut place) = (None, None);
        let mut output = context.run_ui(input, |ui| {
            keys::apply(ui.ctx(), model, state, touched);
            shown = state.tools.shown(model, ui.ctx());
            place = layout::show(ui, model, state, times, shown.as_ref(), touched);
        });
        let frame = shown.as_ref();
        self.tell();
        let platform = std::mem::take(&mut output.platform_output);
        self.input.handle_platform_output(&self.window, platform);
        let scale = output.pixels_per_point;
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), scale);
        let placed: Vec<Placed> = (frame.iter().zip(&place))
            .map(|(frame, place)| {
                let r = place.rect * scale;
                Placed {
                    image: &frame.image,
                    to: [r.left(), r.top(), r.right(), r.bottom()],
                }
            })
            .collect();
        let size = self.window.inner_size();
        let shot = shot && frame.is_some();
        let interface = Interface {
            pixels_per_point: scale,
            primitives: &primitives,
            textures: std::mem::take(&mut output.textures_delta),
        };
        let size = [size.width, size.height];
        let painted = self.session.painter.paint(size, &placed, interface, shot)?;
        self.schedule(&output);
        match painted {
            Painted::Shown(shot) => {
                self.seen(times);
                Ok(shot)
            }
            Painted::Skipped => Ok(None),
        }
    }

    /// Tells the simulation what has changed.
    fn tell(&mut self) {
        if self.model.revision() != self.told {
            self.told = self.model.revision();
            let (order, frozen) = (self.model.order(), self.model.frozen);
            self.session.engine.order(order, frozen);
        }
    }

    /// Draws again when the interface wants to move.
    fn schedule(&mut self, output: &egui::FullOutput) {
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(Duration::MAX, |root| root.repaint_delay);
        self.again = match delay {
            Duration::ZERO => {
                self.window.request_redraw();
                None
            }
            // Beyond what an instant can hold: never.
            delay => Instant::now().checked_add(delay),
        };
    }

    /// Notes that the picture has been handed to the screen.
    fn seen(&mut self, times: &mut Times) {
        if !std::mem::take(&mut self.fresh) {
            return;
        }
        if let Some(frame) = &self.frame {
            times.add(Sample {
                stages: frame.timings.passes.clone(),
                wall: frame.wall_ms,
                update: frame.update_ms,
                latency: frame.at.elapsed().as_secs_f64() * 1e3,
            });
        }
    }

    /// Draws if it is time to; when it will be, else.
    pub(super) fn due(&mut self, now: Instant) -> Option<Instant> {
        if self.again.is_some_and(|at| at <= now) {
            self.again = None;
            self.window.request_redraw();
        }
        self.again
    }

    /// The user wants to leave.
    pub(super) fn is_done(&self) -> bool {
        self.state.quit
    }
}
