//! `paint`: the finished image with the tissues that are seen in their colours.

use super::super::labels::colours;
use super::super::pass::{Array, Pass, Sizes, per_pixel};
use super::super::passes::Passes;
use super::super::{SimError, Simulator};
use crate::gpu::{Buffer, Commands, GpuError, Stage};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// The stage.
pub const PAINT: Pass = Pass {
    name: "paint",
    binds: &["frame", "pixels", "pixel_labels", "colours", "painted"],
    makes: &[
        Array::new("colours", Word, 1, |s| s.tissues),
        Array::new("painted", Word, 1, Sizes::pixels),
    ],
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
            lane.buffers.add(cmd.device(), PAINT.makes.iter())?;
            cmd.write(&lane.buffers["colours"], 0, bytemuck::cast_slice(&colours))?;
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope(PAINT.name);
        let threads = per_pixel(self.frame());
        self.record(cmd, &PAINT, threads, &opacity.to_ne_bytes(), &|lane| {
            vec![("pixels", lane.pixels(fused))]
        })?;
        Ok(&self.lanes[0].buffers["painted"])
    }
}

impl Simulator {
    /// The last frame with its tissues in colours, RGBA bytes row by row; none if this was not asked for or the frame
    /// had no labels.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn painted_pixels(&mut self) -> Result<Option<Vec<u8>>, SimError> {
        self.last.painted.then(|| self.read("painted")).transpose()
    }
}
