//! A window that is opened, and opened again on another device.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::event::WindowEvent;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

use super::{Open, Plan, gestures};
use crate::files::Files;
use crate::gpu::{Device, ValidationLog};
use crate::inputs::{self, Inputs};
use crate::keeper::Keeper;
use crate::model::{File, StoredTrajectory};
use crate::opening::{self, Opened};
use crate::output;
use crate::panel::{Common, DeviceFacts, OpenPanels, Panel};
use crate::panels::Panels;
use crate::session::{self, Session};
use crate::sim;
use crate::state::State;
use crate::wake::{Bell, waker};
use crate::watch::Watch;
use crate::{Model, ViewError, console, gallery, recent, style, view3d};

/// Input for a window on `device`, its interface `zoom` times as large as usual. The textures of an
/// earlier interface are lost with its device: this one sends them again.
fn interface(window: &Window, zoom: f32, device: &Device) -> egui_winit::State {
    let context = egui::Context::default();
    context.set_zoom_factor(zoom);
    let scale = window.scale_factor() as f32;
    style::apply(&context);
    gestures::click_slowly(&context);
    let root = egui::ViewportId::ROOT;
    let limit = device.limits().max_image_2d as usize;
    egui_winit::State::new(context, root, window, Some(scale), None, Some(limit))
}

/// Hands over input that has not been seen yet: nothing of it comes again.
fn hand_over(from: &mut egui_winit::State, to: &mut egui_winit::State) {
    let (from, to) = (from.egui_input_mut(), to.egui_input_mut());
    to.focused = from.focused;
    to.events = std::mem::take(&mut from.events);
}

impl Open {
    /// Opens a window. The log is the device's.
    pub(crate) fn new(
        events: &ActiveEventLoop,
        plan: &mut Plan,
    ) -> Result<(Self, ValidationLog), ViewError> {
        let window = session::window(events, &plan.scene.name)?;
        let device = session::device(&plan.options, &window)?;
        let (options, now) = (&plan.options, Instant::now());
        let scene = plan.scene.clone();
        let file = File::new(options.file.clone(), options.overrides.clone(), &scene);
        let suited = opening::suited(scene, file, options, &device, options.seconds, now);
        let Opened { scene, mut model, .. } = suited.map_err(ViewError::Refused)?;
        if let Some((track, file)) = plan.options.trajectory.take() {
            model.await_replay(StoredTrajectory::loaded(track, inputs::name(&file)), now);
        }
        plan.scene = scene;
        let keeper = Keeper::new();
        let (link, bell) = (plan.link.clone(), Bell::new(plan.proxy.clone()));
        let inputs = Inputs::new(link, bell, plan.scene.tracker.clone(), plan.options.listen)?;
        if let Some(address) = inputs.address() {
            output::line(format!("listening at {address} (OpenIGTLink)"));
        }
        let mut open = OpenPanels::default();
        for panel in [&console::ROW, &view3d::ROW] {
            open.set(panel, true);
        }
        open.set(&gallery::ROW, plan.options.gallery);
        let state = State {
            panels: Panels::default(),
            common: Common {
                open,
                tools: plan.tools(&device),
                files: Files::default(),
                inputs,
                device: DeviceFacts {
                    name: format!("{} ({})", device.name(), device.driver()),
                    machine: sim::machine(&device),
                    ray_query: device.supports_ray_query(),
                    heap: device.info().memory_bytes,
                },
                warnings: plan.options.warnings.clone(),
                warned: false,
                fills: false,
                wake: Arc::new(waker(plan.proxy.clone())),
                asks: Vec::new(),
            },
            framing: Default::default(),
            dual: Default::default(),
            share: view3d::USUAL,
            naming: Default::default(),
            problem: None,
            deaths: plan.deaths.clone(),
            stopped: false,
            restart: false,
            preparing: "Opening the device",
            prepares: true,
            leaving: None,
            offer: keeper.orphan(&plan.options.file),
            taken_up: None,
            stale: None,
            keeper,
            quit: false,
        };
        let input = interface(&window, plan.options.scale, &device);
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let watch = Watch::new(waker(plan.proxy.clone())).map_err(ViewError::Thread)?;
        watch.set(&plan.options.file);
        recent::add(&plan.options.file);
        Ok((Self::with(session, model, state, input, window, watch), log))
    }

    /// The same window with another simulation on a new device; `problem` is shown in it. The log is the new
    /// device's.
    pub(crate) fn again(
        self,
        plan: &Plan,
        problem: Option<String>,
    ) -> Result<(Self, ValidationLog), ViewError> {
        let Self {
            frame,
            pictured,
            session,
            model,
            mut state,
            input: mut before,
            held,
            window,
            title,
            opening,
            watch,
            saved,
            ..
        } = self;
        // A scene handed over is lost with the device; the user can open it again.
        if opening.is_none() {
            state.common.files.opening = None;
        }
        // Everything on the lost device is dropped before there is another.
        drop((frame, pictured));
        state.common.tools.lose();
        state.dual.end();
        drop(session);
        let device = session::device(&plan.options, &window)?;
        state.panels.all().into_iter().for_each(Panel::lose);
        state.problem = problem;
        (state.stopped, state.restart) = (false, false);
        let mut input = interface(&window, before.egui_ctx().zoom_factor(), &device);
        hand_over(&mut before, &mut input);
        let _ = input.on_window_event(&window, &WindowEvent::ModifiersChanged(held));
        let log = device.validation_log();
        let session = plan.session(device, &window, &model)?;
        window.request_redraw();
        let made = Self::with(session, model, state, input, window, watch);
        let made = Self { title, opening, saved, held, ..made };
        Ok((made, log))
    }

    /// A window before its first picture.
    fn with(
        session: Session,
        model: Model,
        state: State,
        input: egui_winit::State,
        window: Arc<Window>,
        watch: Watch,
    ) -> Self {
        Self {
            frame: None,
            pictured: None,
            session,
            ordered: model.revision(),
            look: None,
            model,
            state,
            fresh: false,
            unseen: 0,
            pictures_ms: Vec::new(),
            touched: Instant::now(),
            painted: (Instant::now(), Duration::ZERO),
            awaited: false,
            again: None,
            input,
            held: Default::default(),
            window,
            title: String::new(),
            opening: None,
            watch,
            saved: 0,
            coming: None,
        }
    }
}
