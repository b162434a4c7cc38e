//! Ways for threads to wake the window's event loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;
use winit::event_loop::EventLoopProxy;

/// The event that wakes the event loop: there is news of the simulation, or of a device.
pub(super) struct Woken;

/// A call, from any thread, by which the window looks at what has changed.
pub(super) type Wake = Arc<dyn Fn() + Send + Sync>;

/// Wakes the event loop, from any thread; one that is gone needs no news.
pub(super) fn waker(proxy: EventLoopProxy<Woken>) -> impl Fn() + Send + Sync + 'static {
    let proxy = Mutex::new(proxy);
    move || drop(proxy.lock().send_event(Woken))
}

/// Wakes the event loop once for everything that has come since it looked last: however much arrives,
/// no more than one wake waits.
#[derive(Clone)]
pub(super) struct Bell {
    rung: Arc<AtomicBool>,
    proxy: EventLoopProxy<Woken>,
}

impl Bell {
    pub(super) fn new(proxy: EventLoopProxy<Woken>) -> Self {
        Self { rung: Arc::default(), proxy }
    }

    /// Called by any thread after it has put something into a place that the event loop looks at.
    pub(super) fn ring(&self) {
        if !self.rung.swap(true, Ordering::AcqRel) {
            // An event loop that is gone needs no news.
            let _ = self.proxy.send_event(Woken);
        }
    }

    /// Called by the event loop before it looks.
    pub(super) fn answer(&self) {
        self.rung.store(false, Ordering::Release);
    }
}
