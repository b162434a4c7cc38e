//! The event loop: input to the model, the model to the simulation, its pictures to the window.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::{Window, WindowId};

use super::engine::{Frame, News};
use super::session::{self, Session, Wake};
use super::state::State;
use super::statistics::{Sample, Times};
use super::{Model, Options, ViewError, keys, layout, style};
use crate::gpu::{AdapterKind, Device, GpuError, Interface, Painted, Placed, Shot, ValidationLog};
use crate::scene::Scene;
use crate::scene::settings::Machine;
use crate::sim::SimError;

/// A device that is lost again within this time will be lost the next time, too.
const PATIENCE: Duration = Duration::from_secs(10);

/// What exists while there is a window.
struct Open {
    session: Session,
    model: Model,
    state: State,
    /// Revision of the model that the simulation has been told.
    told: u64,
    input: egui_winit::State,
    window: Arc<Window>,
}

/// The application.
pub(super) struct App {
    scene: Scene,
    options: Options,
    proxy: EventLoopProxy<Wake>,
    open: Option<Open>,
    statistics: Times,
    frame: Option<Frame>,
    /// The picture has not been on the screen yet.
    fresh: bool,
    /// When the last input arrived.
    touched: Instant,
    /// When the interface wants to be drawn again.
    again: Option<Instant>,
    lost: Option<Instant>,
    log: Option<ValidationLog>,
    failure: Option<ViewError>,
}

impl App {
    pub(super) fn new(scene: Scene, options: Options, proxy: EventLoopProxy<Wake>) -> Self {
        Self {
            scene,
            options,
            proxy,
            open: None,
            statistics: Times::default(),
            frame: None,
            fresh: false,
            touched: Instant::now(),
            again: None,
            lost: None,
            log: None,
            failure: None,
        }
    }

    /// Closes everything; why it ended, if not by the user.
    pub(super) fn finish(mut self) -> Result<(), ViewError> {
        self.frame = None;
        self.open = None;
        if let Some(file) = &self.options.json {
            let text = format!("{:#}\n", self.statistics.report());
            let written = std::fs::write(file, text);
            self.failure = self.failure.or(written.err().map(|e| unwritten(file, &e)));
        }
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        let messages = self.log.map(|log| log.messages()).unwrap_or_default();
        match messages.first() {
            Some(first) => Err(ViewError::Validation {
                count: messages.len(),
                first: first.clone(),
            }),
            None => Ok(()),
        }
    }

    fn start(&mut self, events: &ActiveEventLoop) -> Result<(), ViewError> {
        let window = session::window(events, &self.scene.name)?;
        let device = session::device(&self.options)?;
        self.log = Some(device.validation_log());
        let lattice = self.scene.simulation.cell * self.scene.probe.frequency;
        let simulation = &mut self.scene.simulation;
        let suited = (self.options.prepare)(&device, simulation);
        let tracer = suited.map_err(ViewError::Refused)?;
        let machine = match device.info().kind {
            AdapterKind::Cpu => Machine::Software,
            _ => Machine::Gpu,
        };
        let model = Model::new(&self.scene, tracer, self.options.seconds, Instant::now());
        let state = State {
            console: true,
            timing: false,
            help: false,
            tissue: 0,
            mesh: 0,
            machine,
            lattice,
            ray_query: device.supports_ray_query(),
            device: format!("{} ({})", device.name(), device.driver()),
            problem: None,
            quit: false,
        };
        let context = egui::Context::default();
        style::apply(&context);
        let input = egui_winit::State::new(
            context,
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(device.limits().max_image_2d as usize),
        );
        let session = self.session(device, &window, &model)?;
        self.open = Some(Open {
            session,
            told: model.revision(),
            model,
            state,
            input,
            window: window.clone(),
        });
        window.request_redraw();
        Ok(())
    }

    fn session(
        &self,
        device: Arc<Device>,
        window: &Arc<Window>,
        model: &Model,
    ) -> Result<Session, ViewError> {
        let (scene, proxy) = (self.scene.clone(), self.proxy.clone());
        Session::new(device, window, &self.options, scene, model.order(), proxy)
    }

    /// Goes on with a new device where it was lost; ends where that does not help.
    fn fail(&mut self, events: &ActiveEventLoop, error: ViewError) {
        let lost = matches!(
            error,
            ViewError::Gpu(GpuError::DeviceLost { .. })
                | ViewError::Sim(SimError::Gpu(GpuError::DeviceLost { .. }))
        );
        let again = self.lost.is_some_and(|at| at.elapsed() < PATIENCE);
        if lost && !again {
            self.lost = Some(Instant::now());
            match self.reopen(&error) {
                Ok(()) => return,
                Err(second) => self.failure = Some(second),
            }
        } else {
            self.failure = Some(error);
        }
        events.exit();
    }

    fn reopen(&mut self, error: &ViewError) -> Result<(), ViewError> {
        self.frame = None;
        let Some(Open {
            session,
            model,
            mut state,
            input,
            window,
            ..
        }) = self.open.take()
        else {
            return Ok(());
        };
        drop(session);
        let device = session::device(&self.options)?;
        self.log = Some(device.validation_log());
        state.problem = Some(format!("{error}. It was opened again."));
        // Textures of the interface are gone with the device: a new context sends them again.
        let context = egui::Context::default();
        style::apply(&context);
        let scale = input.egui_ctx().pixels_per_point();
        let root = egui::ViewportId::ROOT;
        let limit = device.limits().max_image_2d as usize;
        let input = egui_winit::State::new(context, root, &window, Some(scale), None, Some(limit));
        let session = self.session(device, &window, &model)?;
        window.request_redraw();
        self.open = Some(Open {
            session,
            told: model.revision(),
            model,
            state,
            input,
            window,
        });
        Ok(())
    }

    /// Takes over what the simulation has to say.
    fn listen(&mut self, events: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        let mut failed = None;
        for news in open.session.engine.news() {
            match news {
                News::Frame(frame) => {
                    self.frame = Some(*frame);
                    self.fresh = true;
                    open.state.problem = None;
                }
                News::Refused(problem) => open.state.problem = Some(problem),
                News::Failed(error) => failed = Some(error),
            }
        }
        open.window.request_redraw();
        if let Some(error) = failed {
            self.fail(events, error.into());
        }
    }

    fn draw(&mut self, events: &ActiveEventLoop) {
        let began = Instant::now();
        let painted = self.paint();
        let took = began.elapsed().as_secs_f64() * 1e3;
        self.statistics.add_interface(took);
        match painted {
            Ok(Some(shot)) => {
                if let Err(error) = self.save(&shot) {
                    self.failure = Some(error);
                }
                events.exit();
            }
            Ok(None) => {}
            Err(error) => self.fail(events, error.into()),
        }
        if self.open.as_ref().is_some_and(|open| open.state.quit) {
            events.exit();
        }
    }

    /// One picture of the window; with its pixels where they are wanted.
    fn paint(&mut self) -> Result<Option<Shot>, GpuError> {
        let Some(open) = &mut self.open else {
            return Ok(None);
        };
        let input = open.input.take_egui_input(&open.window);
        let context = open.input.egui_ctx().clone();
        let (model, state, touched) = (&mut open.model, &mut open.state, self.touched);
        let (frame, statistics) = (self.frame.as_ref(), &self.statistics);
        let mut place = None;
        let mut output = context.run_ui(input, |ui| {
            keys::apply(ui.ctx(), model, state, touched);
            place = layout::show(ui, model, state, statistics, frame, touched);
        });
        if open.model.revision() != open.told {
            open.told = open.model.revision();
            open.session
                .engine
                .order(open.model.order(), open.model.frozen);
        }
        let platform = std::mem::take(&mut output.platform_output);
        open.input.handle_platform_output(&open.window, platform);
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
        let size = open.window.inner_size();
        let shot = self.options.screenshot.is_some() && frame.is_some();
        let interface = Interface {
            pixels_per_point: scale,
            primitives: &primitives,
            textures: std::mem::take(&mut output.textures_delta),
        };
        let size = [size.width, size.height];
        let painted = open.session.painter.paint(size, &placed, interface, shot)?;
        self.schedule(&output);
        match painted {
            Painted::Shown(shot) => {
                self.seen();
                Ok(shot)
            }
            Painted::Skipped => Ok(None),
        }
    }

    /// Draws again when the interface wants to move.
    fn schedule(&mut self, output: &egui::FullOutput) {
        let Some(open) = &self.open else { return };
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let delay = root.map_or(Duration::MAX, |root| root.repaint_delay);
        self.again = match delay {
            Duration::ZERO => {
                open.window.request_redraw();
                None
            }
            // Beyond what an instant can hold: never.
            delay => Instant::now().checked_add(delay),
        };
    }

    /// Notes that the picture has been handed to the screen.
    fn seen(&mut self) {
        if !std::mem::take(&mut self.fresh) {
            return;
        }
        if let Some(frame) = &self.frame {
            self.statistics.add(Sample {
                stages: frame.timings.passes.clone(),
                wall: frame.wall_ms,
                update: frame.update_ms,
                latency: frame.at.elapsed().as_secs_f64() * 1e3,
            });
        }
    }

    fn save(&self, shot: &Shot) -> Result<(), ViewError> {
        let Some(file) = &self.options.screenshot else {
            return Ok(());
        };
        let [width, height] = shot.size;
        let colour = image::ExtendedColorType::Rgba8;
        image::save_buffer(file, &shot.rgba, width, height, colour)
            .map_err(|error| unwritten(file, &error))
    }
}

fn unwritten(file: &Path, error: &dyn std::error::Error) -> ViewError {
    ViewError::Unwritten {
        file: file.to_owned(),
        reason: error.to_string(),
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none()
            && let Err(error) = self.start(events)
        {
            self.failure = Some(error);
            events.exit();
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, _: Wake) {
        self.listen(events);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        match event {
            WindowEvent::RedrawRequested => return self.draw(events),
            WindowEvent::CloseRequested => return events.exit(),
            _ => {}
        }
        let now = Instant::now();
        let response = open.input.on_window_event(&open.window, &event);
        if response.repaint {
            self.touched = now;
            open.window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let now = Instant::now();
        if self.again.is_some_and(|at| at <= now) {
            self.again = None;
            if let Some(open) = &self.open {
                open.window.request_redraw();
            }
        }
        events.set_control_flow(match self.again {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        });
    }
}
