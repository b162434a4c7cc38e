//! What exists while there is a window: input to the model, the model to the simulation, its pictures
//! to the window.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::engine::{Frame, News};
use super::files::Files;
use super::inputs::{self, Inputs};
use super::layout::Places;
use super::link::{Bell, Link};
use super::look::{Look, Pictured};
use super::model::{File, Kept};
use super::opening::{self, Opened, Opening};
use super::session::{self, Session, Wake};
use super::state::State;
use super::statistics::{Sample, Times};
use super::timing::{self, costs};
use super::tools::{Tools, cropped};
use super::{Model, Options, ViewError, keys, layout, real, style, survey};
use crate::gpu::{AdapterKind, Device, GpuError, Interface, Painted, Placed, Shot, ValidationLog};
use crate::output;
use crate::scene::Scene;
use crate::scene::settings::Machine;
use crate::sim::SimError;

/// A window with its simulation, and what the user has made of them.
pub(super) struct Open {
    /// The picture last finished; before the session, so that its device is still there.
    frame: Option<Frame>,
    /// The same of the 3D view.
    pictured: Option<Pictured>,
    session: Session,
    model: Model,
    state: State,
    /// Revision of the model that the simulation has been told.
    told: u64,
    /// How it has been told to look at the anatomy.
    look: Option<Look>,
    /// The picture has not been on the screen yet.
    fresh: bool,
    /// What the last pictures of the 3D view took, ms, until they are noted.
    pictures_ms: Vec<f64>,
    /// When the last input arrived.
    touched: Instant,
    /// When the interface wants to be drawn again.
    again: Option<Instant>,
    input: egui_winit::State,
    window: Arc<Window>,
    title: String,
    opening: Option<Opening>,
    /// A scene that the simulation is to go on with.
    coming: Option<Opened>,
}

/// What a session is made from, again where its device is lost.
pub(super) struct Plan {
    pub(super) scene: Scene,
    pub(super) options: Options,
    pub(super) proxy: EventLoopProxy<Wake>,
    /// The OpenIGTLink server stays whatever becomes of the device.
    pub(super) link: Link,
}

impl Plan {
    fn tools(&self, device: &Device) -> Tools {
        let (folder, proxy) = (self.options.captures.clone(), self.proxy.clone());
        // An event loop that is gone needs no news.
        Tools::new(device.info(), folder, move || drop(proxy.send_event(Wake)))
    }

    fn session(
        &self,
        device: Arc<Device>,
        window: &Arc<Window>,
        model: &Model,
    ) -> Result<Session, ViewError> {
        let (scene, proxy, link) = (self.scene.clone(), self.proxy.clone(), self.link.clone());
        Session::new(
            device,
            window,
            &self.options,
            scene,
            model.order(),
            proxy,
            link,
        )
    }
}

/// Input for a window on `device`, its interface `zoom` times as large as usual. Textures of an interface before are gone with its device: this
/// one sends them again.
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
        let device = session::device(&plan.options)?;
        let (options, now) = (&plan.options, Instant::now());
        let scene = plan.scene.clone();
        let file = File::new(options.file.clone(), options.overrides.clone(), &scene);
        let suited = opening::suited(scene, file, options, &device, options.seconds, now);
        let Opened { scene, mut model } = suited.map_err(ViewError::Refused)?;
        if let Some((track, file)) = plan.options.trajectory.take() {
            model.await_replay(Kept::loaded(track, inputs::name(&file)), now);
        }
        plan.scene = scene;
        let machine = match device.info().kind {
            AdapterKind::Cpu => Machine::Software,
            _ => Machine::Gpu,
        };
        let (link, bell) = (plan.link.clone(), Bell::new(plan.proxy.clone()));
        let inputs = Inputs::new(link, bell, plan.scene.tracker.clone(), plan.options.listen)?;
        if let Some(address) = inputs.address() {
            output::line(format!("listening at {address} (OpenIGTLink)"));
        }
        let state = State {
            console: true,
            timing: false,
            survey: survey::State::default(),
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
            tools: plan.tools(&device),
            inputs,
            quit: false,
        };
        let input = interface(&window, plan.options.scale, &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self {
            frame: None,
            pictured: None,
            session,
            told: model.revision(),
            look: None,
            model,
            state,
            fresh: false,
            pictures_ms: Vec::new(),
            touched: now,
            again: None,
            input,
            window,
            title: String::new(),
            opening: None,
            coming: None,
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
            pictured,
            session,
            model,
            mut state,
            input,
            window,
            touched,
            title,
            opening,
            ..
        } = self;
        // What was handed over is lost with the device; it can be asked for again.
        state.files.opening = opening.is_some();
        // All that is on the lost device ends before there is another.
        drop((frame, pictured));
        state.tools.lose();
        drop(session);
        let device = session::device(&plan.options)?;
        // Its texture is gone with the device.
        state.mmode = Default::default();
        state.problem = Some(format!("{error}. It was opened again."));
        let input = interface(&window, input.egui_ctx().zoom_factor(), &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self {
            frame: None,
            pictured: None,
            session,
            told: model.revision(),
            look: None,
            model,
            state,
            fresh: false,
            pictures_ms: Vec::new(),
            touched,
            again: None,
            input,
            window,
            title,
            opening,
            coming: None,
        };
        Ok((made, log))
    }

    /// Takes over what simulation and devices have to say; an error after which nothing more will
    /// come.
    pub(super) fn listen(&mut self, plan: &mut Plan) -> Result<(), SimError> {
        let mut failed = Ok(());
        self.receive(plan);
        for news in self.session.engine.news() {
            match news {
                News::Frame(frame) => {
                    self.model.follow(Instant::now());
                    if self.frame.is_none() {
                        self.model.begin_replay(Instant::now());
                    }
                    self.model.film(&frame);
                    self.state.tools.record((*frame).clone());
                    self.state.survey.pace(frame.wall_ms);
                    self.frame = Some(*frame);
                    self.fresh = true;
                    self.state.problem = None;
                }
                News::Survey(pictured) => {
                    self.pictures_ms.push(pictured.ms);
                    self.state.survey.learn(&pictured);
                    self.pictured = Some(*pictured);
                }
                News::Refused(problem) => self.state.problem = Some(problem),
                News::Opened => self.adopt(plan),
                News::NotOpened(problem) => self.refuse(problem),
                News::Failed(error) => failed = Err(error),
            }
        }
        self.look();
        // Not left to the next drawing, which a window that is hidden may never see.
        self.tell();
        self.window.request_redraw();
        failed
    }

    /// Begins to open a scene where the user wants it.
    pub(super) fn begin(&mut self, plan: &Plan) {
        let files = &mut self.state.files;
        if let Some(path) = files.wanted.take() {
            // Said of this file; another one speaks for itself.
            let of_this = path == self.model.file.path;
            let overrides = self
                .model
                .file
                .overrides
                .iter()
                .filter(|_| of_this)
                .cloned();
            files.opening = true;
            let proxy = plan.proxy.clone();
            self.opening = Some(Opening::begin(path, overrides.collect(), proxy));
        }
    }

    /// Hands a scene that has been read to the simulation.
    fn receive(&mut self, plan: &Plan) {
        let device = &self.session.device;
        let Some(opening) = &self.opening else { return };
        let Some(ready) = opening.ready(&plan.options, device, Instant::now()) else {
            return;
        };
        self.opening = None;
        match ready {
            Ok(opened) => {
                let (scene, order) = (opened.scene.clone(), opened.model.order());
                self.session.engine.open(scene, order);
                self.coming = Some(opened);
            }
            Err(problem) => self.refuse(problem),
        }
    }

    /// Goes on with the scene that the simulation has taken up.
    fn adopt(&mut self, plan: &mut Plan) {
        let opened = self.coming.take();
        let Opened { scene, model } = opened.expect("nothing else was handed over");
        self.told = model.revision();
        self.model = model;
        // It shows the scene before, as does all that was measured in it.
        self.frame = None;
        (self.pictured, self.look) = (None, None);
        (self.state.tissue, self.state.mesh) = (0, 0);
        self.state.tools.lose();
        self.state.tools.sheet = Default::default();
        self.state.mmode = Default::default();
        self.state.inputs.calibrate(scene.tracker.clone());
        plan.scene = scene;
        self.state.files.opening = false;
        self.state.files.close();
    }

    fn refuse(&mut self, problem: String) {
        self.coming = None;
        self.state.files.opening = false;
        if let Err(problem) = self.state.files.refuse(problem) {
            self.state.problem = Some(problem);
        }
    }

    /// Names scene and file, and whether there is something to save.
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
        let pictured = self.pictured.as_ref();
        let (mut shown, mut places) = (None, Places::default());
        let mut output = context.run_ui(input, |ui| {
            keys::apply(ui.ctx(), model, state, touched);
            shown = state.tools.shown(model, ui.ctx());
            let pictures = (shown.as_ref(), pictured);
            places = layout::show(ui, model, state, times, pictures, touched);
        });
        self.tell();
        self.point(&places, output.pixels_per_point);
        self.entitle();
        let platform = std::mem::take(&mut output.platform_output);
        self.input.handle_platform_output(&self.window, platform);
        let scale = output.pixels_per_point;
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), scale);
        let model = &self.model;
        let image = shown.as_ref().map(|frame| real::image(frame, model));
        let survey = self.pictured.as_ref().map(|pictured| &pictured.image);
        let rects = [
            (image, places.image.as_ref().map(|place| place.rect)),
            (survey, places.survey.map(|place| place.rect)),
        ];
        let placed: Vec<Placed> = (rects.into_iter())
            .filter_map(|(image, rect)| {
                let r = rect? * scale;
                let to = [r.left(), r.top(), r.right(), r.bottom()];
                Some(Placed { image: image?, to })
            })
            .collect();
        let size = self.window.inner_size();
        let looked = self.pictured.as_ref().map(|pictured| &pictured.look);
        let shot = shot && image.is_some() && looked == self.look.as_ref();
        let interface = Interface {
            pixels_per_point: scale,
            primitives: &primitives,
            textures: std::mem::take(&mut output.textures_delta),
        };
        let size = [size.width, size.height];
        let painter = &mut self.session.painter;
        let tools = &mut self.state.tools;
        let marked = tools.wants_shot() && painter.can_be_read();
        let painted = painter.paint(size, &placed, interface, shot || marked)?;
        let picture = match &painted {
            Painted::Shown(picture) => picture.as_ref().filter(|_| marked),
            Painted::Skipped => None,
        };
        let around = picture.zip(places.image.as_ref()).map(|(picture, place)| {
            let r = place.area * scale;
            cropped(picture, [r.left(), r.top(), r.right(), r.bottom()])
        });
        tools.save(&self.model, around);
        self.schedule(&output);
        match painted {
            Painted::Shown(picture) => {
                self.seen(times);
                Ok(picture.filter(|_| shot))
            }
            Painted::Skipped => Ok(None),
        }
    }

    /// Tells the simulation how the anatomy is looked at.
    fn point(&mut self, places: &Places, scale: f32) {
        let (model, state) = (&self.model, &self.state.survey);
        let look = (places.survey).map(|place| place.look(model, state, scale));
        if look != self.look {
            if look.is_none() {
                self.pictured = None;
            }
            self.session.engine.look(look.clone());
            self.look = look;
        }
    }

    /// Tells the simulation what has changed.
    fn tell(&mut self) {
        // A scene that is coming has settings of its own.
        if self.model.revision() != self.told && self.coming.is_none() {
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
        (self.pictures_ms.drain(..)).for_each(|ms| times.add_survey(ms));
        if !std::mem::take(&mut self.fresh) {
            return;
        }
        if let Some(frame) = &self.frame {
            times.add(Sample {
                stages: frame.timings.passes.clone(),
                wall: frame.wall_ms,
                update: frame.update_ms,
                strategy: costs::strategies(&frame.settings.strategies),
                latency: frame.at.elapsed().as_secs_f64() * 1e3,
            });
        }
    }

    /// Draws if it is time to; when it will be, else.
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

    /// Looks what devices have to say.
    fn look(&mut self) {
        if self.state.inputs.look(&mut self.model) {
            self.session.engine.send_again();
        }
        let word = self.state.inputs.word.clone();
        keys::apply_pads(&word, &mut self.model, &mut self.state, Instant::now());
    }

    /// The user wants to leave.
    pub(super) fn is_done(&self) -> bool {
        self.state.quit
    }
}
