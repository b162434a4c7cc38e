//! `paint`: the finished image with the tissues that are seen in their colours.

use super::super::labels::colours;
use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::super::passes::Passes;
use super::super::push;
use super::chart::PIXEL_LABELS;
use super::display::PIXELS;
use super::inputs::FRAME;
use crate::gpu::{Buffer, Commands, GpuError, Stage};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// Colour of each tissue, RGB.
pub const COLOURS: Array = Array::new("colours", Word, 1, |s| s.tissues);

/// The finished image with its tissues in colours, RGBA.
pub const PAINTED: Array = Array::new("painted", Word, 1, Sizes::pixels);

/// The stage.
pub const PAINT: Pass = Pass {
    name: "paint",
    binds: &[&FRAME, &PIXELS, &PIXEL_LABELS, &COLOURS, &PAINTED],
    makes: &[&COLOURS, &PAINTED],
    extent: Some(per_pixel),
    then: Stage::Transfer,
    // Nothing in a scene needs it; `Outputs::painted` asks for it.
    needed: |_| false,
    ..Pass::USUAL
};

impl Passes {
    /// Colours the finished images into buffers of their own, ready to be copied; after `chart`. Returns that of the
    /// first one.
    pub(crate) fn paint(
        &mut self,
        cmd: &mut Commands<'_>,
        scene: &Scene,
        opacity: f32,
        fused: bool,
    ) -> Result<&Buffer, GpuError> {
        let colours = colours(scene).into_iter().map(|[r, g, b]| u32::from_le_bytes([r, g, b, 0]));
        let colours: Vec<u32> = colours.collect();
        for lane in &mut self.lanes[..self.active] {
            lane.buffers.add(cmd.device(), PAINT.makes.iter().copied())?;
            cmd.write(&lane.buffers[&COLOURS], 0, bytemuck::cast_slice(&colours))?;
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope(PAINT.name);
        let threads = per_pixel(self.frame());
        self.record(cmd, &PAINT, threads, bytemuck::bytes_of(&push::Paint { opacity }), &|lane| {
            vec![(&PIXELS, lane.pixels(fused))]
        })?;
        Ok(&self.lanes[0].buffers[&PAINTED])
    }
}
