//! `tiles`: which of both images each tile of a fused image shows.

use super::super::layout::{Frame, MASK_BLOCK};
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::super::passes::Passes;
use super::super::push;
use super::inputs::FRAME;
use super::mask::{FUSION, MASK_BLOCKS};
use crate::gpu::{Commands, GpuError};
use crate::output::npy::Element::Word;
use crate::scene::Scene;

/// Bits of each tile: which of both images it shows, and whether they are blurred.
pub const TILE_LIST: Array = Array::new("tiles", Word, 1, |s| s.tiles()).zeroed();

/// The stage.
pub const TILES: Pass = Pass {
    name: "tiles",
    binds: &[&FRAME, &FUSION, &MASK_BLOCKS, &TILE_LIST],
    makes: &[&TILE_LIST],
    extent: Some(|frame| {
        let [across, down] = frame.tiles();
        Extent::Threads([across, down, 1])
    }),
    needed: Scene::shows_volume,
    ..Pass::USUAL
};

/// One work group per tile.
pub(super) fn per_tile(frame: &Frame) -> Extent {
    let [across, down] = frame.tiles();
    Extent::Groups([across, down, 1])
}

impl Sizes {
    /// Tiles of the image.
    fn tiles(&self) -> u64 {
        self.frame.tiles().map(u64::from).iter().product()
    }

    /// Blocks of samples of all scanlines.
    pub(super) fn mask_blocks(&self) -> u64 {
        u64::from(self.frame.scanlines) * u64::from(self.frame.samples.div_ceil(MASK_BLOCK))
    }
}

impl Passes {
    /// Sorts the tiles; if `whole`, every intermediate image is then made everywhere.
    pub(crate) fn tiles(&self, cmd: &mut Commands<'_>, whole: bool) -> Result<(), GpuError> {
        cmd.scope(TILES.name);
        let extent = TILES.extent.expect("stated above")(self.frame());
        let push = push::Tiles { complete: whole.into() };
        self.record(cmd, &TILES, extent, bytemuck::bytes_of(&push), &|_| Vec::new())
    }
}
