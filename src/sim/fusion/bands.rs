//! Blending by bands: a pyramid of what is simulated minus what was acquired.

use std::sync::Arc;

use super::super::shaders::Library;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};

/// The kernels, and the pyramid once it is wanted.
pub(super) struct Bands {
    pub(super) kernels: Kernels,
    /// Pixels of the largest image.
    pixels: u64,
    /// The finest first.
    levels: Vec<Level>,
}

pub(super) struct Kernels {
    difference: Kernel,
    reduce: Kernel,
    collapse: Kernel,
}

struct Level {
    /// Difference and weights per pixel, three floats.
    sums: Buffer,
    /// What this level and the coarser ones add to the acquired image.
    change: Buffer,
}

/// What the finest level is made of.
pub(super) struct Images<'a> {
    pub(super) constants: &'a Buffer,
    pub(super) simulated: &'a Buffer,
    pub(super) background: &'a Buffer,
    pub(super) mask: &'a Buffer,
}

impl Kernels {
    pub(super) fn new(device: &Arc<Device>, library: &Library) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::when_needed(device, stem, library.words(stem), &[]);
        Ok(Self {
            difference: kernel("difference")?,
            reduce: kernel("reduce")?,
            collapse: kernel("collapse")?,
        })
    }
}

impl Bands {
    /// For images of up to `pixels` pixels, whatever their shape.
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        pixels: u64,
    ) -> Result<Self, GpuError> {
        Ok(Self { kernels: Kernels::new(device, library)?, pixels, levels: Vec::new() })
    }

    /// Makes room for `levels` levels above the finest.
    pub(super) fn fit(&mut self, device: &Arc<Device>, levels: u32) -> Result<(), GpuError> {
        while self.levels.len() <= levels as usize {
            // ceil(w / 2) ceil(h / 2) <= (w h + 1) / 2, for an image one pixel wide with equality.
            let halved = |pixels: u64, _| pixels.div_ceil(2);
            let pixels = (0..self.levels.len()).fold(self.pixels, halved);
            let new = |name: &str, each: u64| {
                device.buffer(name, (each * pixels).max(16), BufferKind::Storage)
            };
            self.levels.push(Level { sums: new("band sums", 12)?, change: new("band change", 4)? });
        }
        Ok(())
    }

    /// What is added to each pixel of the acquired image.
    pub(super) fn change(&self) -> &Buffer {
        &self.levels[0].change
    }

    /// Differences and weights per pixel.
    pub(super) fn finest(&self) -> &Buffer {
        &self.levels[0].sums
    }

    /// Fills [`Self::change`] for images of `size` pixels, over `levels` levels above the finest.
    pub(super) fn record(
        &self,
        cmd: &mut Commands<'_>,
        images: &Images<'_>,
        size: [u32; 2],
        levels: u32,
    ) -> Result<(), GpuError> {
        let buffer = Binding::Buffer;
        let top = levels as usize;
        let threads = |level: usize| {
            let [width, height] = size_at(size, level);
            [width, height, 1]
        };
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("bands");
        cmd.dispatch(
            &self.kernels.difference,
            threads(0),
            &[],
            &[
                buffer(images.constants),
                buffer(images.simulated),
                buffer(images.background),
                buffer(images.mask),
                buffer(self.finest()),
            ],
        )?;
        for level in 0..top {
            cmd.barrier(Stage::Compute, Stage::Compute);
            cmd.dispatch(
                &self.kernels.reduce,
                threads(level + 1),
                bytemuck::bytes_of(&size_at(size, level)),
                &[buffer(&self.levels[level].sums), buffer(&self.levels[level + 1].sums)],
            )?;
        }
        for level in (0..=top).rev() {
            let [width, height] = size_at(size, level);
            let coarsest = u32::from(level == top);
            // The coarsest level reads nothing above itself.
            let (here, above) = (&self.levels[level], &self.levels[(level + 1).min(top)]);
            let above_change = match coarsest {
                0 => &above.change,
                _ => &above.sums,
            };
            cmd.barrier(Stage::Compute, Stage::Compute);
            cmd.dispatch(
                &self.kernels.collapse,
                threads(level),
                bytemuck::bytes_of(&[width, height, coarsest]),
                &[
                    buffer(&here.sums),
                    buffer(&above.sums),
                    buffer(above_change),
                    buffer(&here.change),
                ],
            )?;
        }
        Ok(())
    }
}

/// Pixels of level `level` of an image of `size` pixels.
fn size_at(size: [u32; 2], level: usize) -> [u32; 2] {
    (0..level).fold(size, |size, _| size.map(|n| n.div_ceil(2)))
}
