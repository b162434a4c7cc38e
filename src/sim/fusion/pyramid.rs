//! The levels of an image that is blended by bands, on the device.

use std::sync::Arc;

use crate::gpu::{Buffer, BufferKind, Device, GpuError};
use crate::scene::Scene;
use crate::settings::Blend;

/// True if frames of a scene are blended by bands.
pub(crate) fn is_banded(scene: &Scene) -> bool {
    scene.shows_volume() && scene.fusion.as_ref().is_some_and(|f| f.blend == Blend::Multiband)
}

/// A level of the pyramid.
pub(crate) struct PyramidLevel {
    /// Difference and weights per pixel, three floats.
    pub(crate) sums: Buffer,
    /// The sum that this level and the coarser ones add to the acquired image.
    pub(crate) change: Buffer,
}

/// The levels, finest first; empty until they are needed.
#[derive(Default)]
pub(crate) struct Pyramid(Vec<PyramidLevel>);

impl Pyramid {
    /// Makes room for `levels` levels above the finest, of images of up to `pixels` pixels, whatever
    /// their shape.
    pub(crate) fn fit(
        &mut self,
        device: &Arc<Device>,
        pixels: u64,
        levels: u32,
    ) -> Result<(), GpuError> {
        while self.0.len() <= levels as usize {
            // ceil(w / 2) ceil(h / 2) <= (w h + 1) / 2, for an image one pixel wide with equality.
            let pixels = (0..self.0.len()).fold(pixels, |pixels, _| pixels.div_ceil(2));
            let new = |name: &str, each: u64| {
                device.buffer(name, (each * pixels).max(16), BufferKind::Storage)
            };
            self.0
                .push(PyramidLevel { sums: new("band sums", 12)?, change: new("band change", 4)? });
        }
        Ok(())
    }

    /// A level, counted from the finest.
    pub(crate) fn level(&self, level: usize) -> &PyramidLevel {
        &self.0[level]
    }

    /// The values added to the pixels of the acquired image.
    pub(crate) fn change(&self) -> &Buffer {
        &self.0[0].change
    }
}
