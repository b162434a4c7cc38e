//! `tint`: the mixed image with the acquired pixels coloured.

use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::super::passes::Passes;
use super::super::push;
use super::blur::SUMS;
use super::convert::MASK_IMAGE;
use super::fuse::FUSED;
use super::inputs::FRAME;
use super::mask::FUSION;
use super::tiles::TILE_LIST;
use crate::gpu::{Buffer, Commands, GpuError, Stage};
use crate::output::npy::Element::Word;

/// The finished image with its acquired pixels coloured, RGBA.
pub const TINTED: Array = Array::new("tinted", Word, 1, Sizes::pixels);

/// The stage.
pub const TINT: Pass = Pass {
    name: "tint",
    binds: &[&FRAME, &FUSION, &FUSED, &MASK_IMAGE, &SUMS, &TILE_LIST, &TINTED],
    makes: &[&TINTED],
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
            lane.buffers.add(cmd.device(), TINT.makes.iter().copied())?;
        }
        let [r, g, b] = tint.colour;
        let push = push::Tint { opacity: tint.opacity, colour: u32::from_le_bytes([r, g, b, 0]) };
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope(TINT.name);
        self.record(cmd, &TINT, per_pixel(self.frame()), bytemuck::bytes_of(&push), &|_| {
            Vec::new()
        })?;
        Ok(&self.lanes[0].buffers[&TINTED])
    }
}
