//! Which pixels are acquired and which are simulated: the mixed image once more, coloured.

use std::sync::Arc;

use super::super::shaders::Library;
use super::super::{SimError, Simulator};
use super::Fused;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Image, Kernel, Stage};

/// How acquired pixels are coloured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tint {
    /// Red, green and blue.
    pub colour: [u8; 3],
    /// Of the colour over a pixel that is all acquired, 0..=1; mixed ones by their share.
    pub opacity: f32,
}

/// The kernel, and its image once there is to be one.
pub(super) struct Tinting {
    pub(super) kernel: Kernel,
    /// Bytes of the largest image.
    size: u64,
    tinted: Option<Buffer>,
}

impl Tinting {
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        pixels: u64,
    ) -> Result<Self, GpuError> {
        Ok(Self { kernel: Self::kernel(device, library)?, size: 4 * pixels, tinted: None })
    }

    pub(super) fn kernel(device: &Arc<Device>, library: &Library) -> Result<Kernel, GpuError> {
        Kernel::when_needed(device, "tint", library.words("tint"), &[])
    }

    fn fit(&mut self, device: &Arc<Device>) -> Result<(), GpuError> {
        if self.tinted.is_none() {
            let size = self.size.max(16);
            self.tinted = Some(device.buffer("tinted pixels", size, BufferKind::Storage)?);
        }
        Ok(())
    }
}

impl Fused {
    /// Colours the mixed image into a buffer of its own, ready to be copied; after [`Fused::record`].
    pub(in crate::sim) fn tint(
        &mut self,
        cmd: &mut Commands<'_>,
        frame: &Buffer,
        [width, height]: [u32; 2],
        tint: &Tint,
    ) -> Result<&Buffer, GpuError> {
        self.tinting.fit(&self.device)?;
        let tinted = self.tinting.tinted.as_ref().expect("just made");
        let mut push = tint.opacity.to_ne_bytes().to_vec();
        let [r, g, b] = tint.colour;
        push.extend(u32::from_le_bytes([r, g, b, 0]).to_ne_bytes());
        let buffer = Binding::Buffer;
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("tint");
        cmd.dispatch(
            &self.tinting.kernel,
            [width, height, 1],
            &push,
            &[
                buffer(frame),
                buffer(&self.constants),
                buffer(&self.pixels),
                buffer(&self.mask),
                buffer(&self.sums),
                buffer(tinted),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Transfer);
        Ok(tinted)
    }
}

impl Simulator {
    /// Colours the acquired pixels of the next frames in an image of their size beside the one of
    /// [`Self::show_on`], which does not change; with nothing nobody does. Frames that show no
    /// acquired volume leave it as it is.
    pub fn tint_on(&mut self, tinted: Option<(Image, Tint)>) {
        self.tinted_on = tinted;
    }

    /// The last frame with its acquired pixels coloured, RGBA bytes row by row; none where it was not
    /// asked for or showed no acquired volume.
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn tinted_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        if !self.fused || self.tinted_on.is_none() {
            return Ok(None);
        }
        self.frames.wait()?;
        let fusion = self.passes.fusion.as_ref().expect("the frame was fused");
        let Some(tinted) = &fusion.tinting.tinted else {
            return Ok(None);
        };
        let frame = &self.passes.frame;
        let size = 4 * frame.image_width as usize * frame.image_height as usize;
        Ok(Some(self.device.read_back(tinted)?[..size].to_vec()))
    }
}
