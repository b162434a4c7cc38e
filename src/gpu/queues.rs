//! The queues of a device, and who submits to which.

use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

/// Who submits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    /// The simulation, and everything without a window.
    Work,
    /// The window.
    Window,
}

/// One queue, or two of the same family: then nothing has to change owners between them.
pub(crate) struct Queues {
    all: Vec<Mutex<vk::Queue>>,
    window: bool,
}

impl Queues {
    /// Takes the first `count` queues of a family.
    pub(crate) fn new(device: &ash::Device, family: u32, count: u32, window: bool) -> Self {
        // SAFETY: the device was made with that many queues of the family.
        let queue = |index| unsafe { device.get_device_queue(family, index) };
        Self {
            all: (0..count).map(|index| Mutex::new(queue(index))).collect(),
            window,
        }
    }

    /// The queue of `lane`, kept from other threads meanwhile. A handle stays usable after a panic
    /// elsewhere, so poisoning is ignored.
    pub(crate) fn lock(&self, lane: Lane) -> MutexGuard<'_, vk::Queue> {
        let queue = match lane {
            Lane::Work => self.all.first(),
            Lane::Window => self.all.last(),
        };
        let queue = queue.expect("a device has at least one queue");
        queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the window has to wait behind what the simulation has submitted.
    pub(crate) fn are_shared(&self) -> bool {
        self.window && self.all.len() == 1
    }
}
