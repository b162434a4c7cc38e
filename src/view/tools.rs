//! The working tools: what is kept, measured and written on the image.

use glam::DVec2;

use super::engine::Frame;
use super::model::cine::Limit;
use super::model::sheet::{Moment, Sheet};
use super::model::{Axis, Cine, Model};
use crate::gpu::DeviceInfo;

/// Most frames of the loop.
const FRAMES: usize = 256;
/// Most bytes of the loop, where the device has sixteen times as many.
const BYTES: u64 = 256 << 20;

/// State of the tools.
pub(super) struct Tools {
    /// The images last finished, all of one size and place in the probe's space: another depth begins
    /// another loop, as on a scanner.
    pub(super) cine: Cine<Frame>,
    /// Measurements and texts.
    pub(super) sheet: Sheet,
    was_frozen: bool,
}

impl Tools {
    /// For a device.
    pub(super) fn new(device: &DeviceInfo) -> Self {
        Self {
            cine: Cine::new(Limit {
                frames: FRAMES,
                bytes: BYTES.min(device.memory_bytes / 16),
            }),
            sheet: Sheet::default(),
            was_frozen: false,
        }
    }

    /// Keeps a finished image.
    pub(super) fn record(&mut self, mut frame: Frame) {
        // They are read back where they are wanted.
        frame.pixels = None;
        let is_like = |last: &Frame| {
            last.sector == frame.sector && last.image.extent() == frame.image.extent()
        };
        if self.cine.newest().is_some_and(|last| !is_like(last)) {
            self.cine.clear();
        }
        let (bytes, at) = (frame.image.bytes(), frame.finished);
        self.cine.push(frame, bytes, at);
    }

    /// The image to be shown now. Live it is the newest; frozen, the one that was chosen or that plays.
    pub(super) fn shown(&mut self, model: &Model, ctx: &egui::Context) -> Option<Frame> {
        if model.frozen != self.was_frozen {
            self.was_frozen = model.frozen;
            // Arrow keys move the probe again.
            self.sheet.deselect();
        }
        if !model.frozen {
            self.cine.go_live();
        }
        if let Some(wait) = self.cine.tick(std::time::Instant::now()) {
            ctx.request_repaint_after(wait);
        }
        self.cine.shown().cloned()
    }

    /// Moves the selected point by pixels of the image, or a quarter where `fine`, along the axis of the
    /// key; whether there is one.
    pub(super) fn nudge(&mut self, axis: Axis, steps: f64, fine: bool) -> bool {
        let Some(frame) = self.cine.shown() else {
            return false;
        };
        let step = steps * frame.sector.pitch * if fine { 0.25 } else { 1.0 };
        match axis {
            Axis::Lateral => self.sheet.nudge(DVec2::X * step),
            // Up is the key of this axis, and depth grows downwards.
            Axis::Elevation => self.sheet.nudge(-DVec2::Y * step),
            _ => false,
        }
    }

    /// Lets go of everything that a device holds.
    pub(super) fn lose(&mut self) {
        self.cine.clear();
    }
}

impl Frame {
    /// The moment that it shows.
    pub(super) fn moment(&self) -> Moment {
        Moment {
            pose: self.pose,
            seconds: self.seconds,
        }
    }
}
