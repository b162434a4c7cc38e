//! Shadows of the simulated anatomy in the acquired volume.

use std::sync::Arc;

use super::super::layout::{Frame, MAX_PIECES};
use super::super::shaders::Library;
use super::super::stages::lines;
use super::super::tracer::Tracer;
use super::super::world::World;
use super::Simulated;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};

/// The kernels, and their buffers once there are to be shadows.
pub(super) struct Shadows {
    pub(super) kernels: Kernels,
    /// Lines and samples of the largest frame.
    size: [u64; 2],
    buffers: Option<Buffers>,
}

pub(super) struct Kernels {
    shadow: Kernel,
    darken: Kernel,
}

/// Buffers of the shadows.
pub(super) struct Buffers {
    /// Level of what is transmitted, per line.
    pub(super) pieces: Buffer,
    /// Mask, and grey level behind the simulated anatomy, of every sample.
    pub(super) shaded: Buffer,
}

impl Kernels {
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        tracer: Tracer,
    ) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::when_needed(device, stem, library.words(stem), &[]);
        Ok(Self {
            shadow: kernel(&format!("shadow_{}", tracer.suffix()))?,
            darken: kernel("darken")?,
        })
    }
}

impl Shadows {
    /// For frames no larger than `frame`.
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        frame: &Frame,
        tracer: Tracer,
    ) -> Result<Self, GpuError> {
        let samples = u64::from(frame.scanlines) * u64::from(frame.samples);
        Ok(Self {
            kernels: Kernels::new(device, library, tracer)?,
            size: [lines(frame).into(), samples],
            buffers: None,
        })
    }

    /// Makes the buffers where they are missing.
    pub(super) fn fit(&mut self, device: &Arc<Device>) -> Result<(), GpuError> {
        if self.buffers.is_none() {
            let [lines, samples] = self.size;
            let new =
                |name: &str, size: u64| device.buffer(name, size.max(16), BufferKind::Storage);
            self.buffers = Some(Buffers {
                pieces: new("shadow pieces", 16 * MAX_PIECES as u64 * lines)?,
                shaded: new("shaded prescan", 8 * samples)?,
            });
        }
        Ok(())
    }

    /// The buffers, if there have ever been shadows.
    pub(super) fn buffers(&self) -> Option<&Buffers> {
        self.buffers.as_ref()
    }

    /// Darkens the volume in `prescan`; where the result is.
    ///
    /// # Panics
    /// Without [`Self::fit`].
    pub(super) fn record(
        &self,
        cmd: &mut Commands<'_>,
        world: &World,
        simulated: &Simulated<'_>,
        prescan: &Buffer,
    ) -> Result<&Buffer, GpuError> {
        let (frame, buffer) = (simulated.frame, Binding::Buffer);
        let buffers = self.buffers.as_ref().expect("they fit");
        cmd.scope("shadow");
        cmd.dispatch(
            &self.kernels.shadow,
            [lines(frame), 1, 1],
            &[],
            &[
                buffer(simulated.constants),
                buffer(simulated.tissues),
                buffer(world.instances()),
                buffer(world.vertices()),
                buffer(world.normals()),
                buffer(world.triangles()),
                world.structure(),
                buffer(simulated.stacks),
                buffer(simulated.rows),
                buffer(&buffers.pieces),
                buffer(simulated.scanlines),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("darken");
        cmd.dispatch(
            &self.kernels.darken,
            [frame.samples, frame.scanlines, 1],
            &[],
            &[
                buffer(simulated.constants),
                buffer(&buffers.pieces),
                buffer(prescan),
                buffer(&buffers.shaded),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        Ok(&buffers.shaded)
    }
}
