//! `blur`: sums of mask and weight over a box, down the columns; each pass exchanges rows and columns.

use super::super::layout::BLUR_SUMS;
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::super::passes::Passes;
use super::super::push;
use super::convert::MASK_IMAGE;
use super::inputs::FRAME;
use super::mask::FUSION;
use super::tiles::TILE_LIST;
use crate::gpu::{Commands, GpuError};
use crate::output::npy::Element::Float;
use crate::scene::Scene;

/// Mask and weight summed over the box around each pixel.
pub const SUMS: Array = Array::new("sums", Float, 2, Sizes::pixels);

/// Sums of the columns alone, stored column by column.
pub const DOWN: Array = Array::new("down", Float, 2, Sizes::pixels);

/// The stage; it runs once for each direction.
pub const BLUR: Pass = Pass {
    name: "blur",
    binds: &[&FRAME, &FUSION, &MASK_IMAGE, &SUMS, &TILE_LIST],
    makes: &[&SUMS, &DOWN],
    // `fuse` binds the sums even if it does not read them.
    needed: Scene::shows_volume,
    ..Pass::USUAL
};

/// The threads for an image; `turned` if rows and columns are exchanged.
pub fn extent([width, height]: [u32; 2], turned: bool) -> Extent {
    let [width, height] = if turned { [height, width] } else { [width, height] };
    Extent::Threads([width, height.div_ceil(BLUR_SUMS), 1])
}

impl Passes {
    /// Sums the mask over the box.
    pub(crate) fn blur(&self, cmd: &mut Commands<'_>) -> Result<(), GpuError> {
        let size = [self.frame().image_width, self.frame().image_height];
        for (turned, array) in [(false, &SUMS), (true, &MASK_IMAGE)] {
            cmd.scope(BLUR.name);
            let push = push::Blur { turned: turned.into() };
            self.record(cmd, &BLUR, extent(size, turned), bytemuck::bytes_of(&push), &|lane| {
                vec![(array, &lane.buffers[&DOWN])]
            })?;
        }
        Ok(())
    }
}
