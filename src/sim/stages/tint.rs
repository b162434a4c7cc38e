//! `tint`: the mixed image with the acquired pixels coloured.

use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::super::passes::Passes;
use super::super::{SimError, Simulator};
use crate::gpu::{Buffer, Commands, GpuError, Stage};
use crate::output::npy::Element::Word;

/// The stage.
pub const TINT: Pass = Pass {
    name: "tint",
    binds: &["frame", "fusion", "fused", "mask", "sums", "tiles", "tinted"],
    makes: &[Array::new("tinted", Word, 1, Sizes::pixels)],
    extent: Some(per_pixel),
    then: Stage::Transfer,
    // Nothing in a scene needs it; `Outputs::tinted` asks for it.
    needed: |_| false,
    ..Pass::USUAL
};

/// The colour of acquired pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tint {
    /// Red, green and blue.
    pub colour: [u8; 3],
    /// Opacity of the colour over a pixel that is all acquired, 0..=1; mixed pixels get their share of it.
    pub opacity: f32,
}

impl Passes {
    /// Colours the mixed images into buffers of their own, ready to be copied; after [`Self::fuse`]. Returns that of the
    /// first one.
    pub(crate) fn tint(
        &mut self,
        cmd: &mut Commands<'_>,
        tint: &Tint,
    ) -> Result<&Buffer, GpuError> {
        for lane in &mut self.lanes[..self.active] {
            lane.buffers.add(cmd.device(), TINT.makes.iter())?;
        }
        let mut push = tint.opacity.to_ne_bytes().to_vec();
        let [r, g, b] = tint.colour;
        push.extend(u32::from_le_bytes([r, g, b, 0]).to_ne_bytes());
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope(TINT.name);
        self.record(cmd, &TINT, per_pixel(self.frame()), &push, &|_| Vec::new())?;
        Ok(&self.lanes[0].buffers["tinted"])
    }
}

impl Simulator {
    /// The last frame with its acquired pixels coloured, RGBA bytes row by row; none if this was not
    /// asked for or the frame showed no acquired volume.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn tinted_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        self.last.tinted.then(|| self.read("tinted")).transpose()
    }
}
