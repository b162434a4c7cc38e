//! A window with its device: everything that is made anew when the device is lost.

use std::sync::Arc;

use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

use super::engine::Engine;
use super::error::ViewError;
use super::link::Link;
use super::model::Order;
use super::options::Options;
use super::wake::{Woken, waker};
use crate::gpu::{Device, Painter};
use crate::scene::Scene;

/// Window, device, simulation. Fields drop in order: the simulation ends first.
pub(super) struct Session {
    pub(super) engine: Engine,
    pub(super) painter: Painter,
    pub(super) device: Arc<Device>,
}

/// A window of the default size.
pub(super) fn window(events: &ActiveEventLoop, title: &str) -> Result<Arc<Window>, ViewError> {
    let attributes = Window::default_attributes()
        .with_title(format!("{title} - insonify"))
        .with_inner_size(winit::dpi::LogicalSize::new(1280, 720))
        .with_min_inner_size(winit::dpi::LogicalSize::new(640, 400));
    let window = events.create_window(attributes);
    window.map(Arc::new).map_err(|e| ViewError::Display(e.to_string()))
}

/// The device that was asked for, for a window.
pub(super) fn device(options: &Options, window: &Window) -> Result<Arc<Device>, ViewError> {
    Ok(Device::for_window(&options.device, window)?)
}

impl Session {
    pub(super) fn new(
        device: Arc<Device>,
        window: &Arc<Window>,
        options: &Options,
        scene: Scene,
        order: Order,
        proxy: EventLoopProxy<Woken>,
        link: Link,
    ) -> Result<Self, ViewError> {
        let painter = Painter::new(&device, window.clone())?;
        let wake = waker(proxy);
        let library = options.library.clone();
        let engine = Engine::start(&device, library, scene, order, link, wake);
        let engine = engine.map_err(ViewError::Thread)?;
        Ok(Self { engine, painter, device })
    }
}
