//! `difference`, `reduce`, `collapse`: blending by bands, over a pyramid of the simulated image minus the
//! acquired one.

use super::super::fusion::is_banded;
use super::super::pass::{Array, Extent, Pass, per_pixel};
use super::super::passes::Passes;
use super::super::push;
use super::convert::{BACKGROUND, MASK_IMAGE};
use super::display::PIXELS;
use super::inputs::FRAME;
use crate::gpu::{Commands, GpuError};
use crate::output::npy::Element::Float;

/// Sums of the finest level.
pub const LEVEL_SUMS: Array = Array::given("level", Float, 3);

/// Sums of a level.
pub const FINE: Array = Array::given("fine", Float, 3);

/// Sums of the next coarser level.
pub const COARSE: Array = Array::given("coarse", Float, 3);

/// Change of the image by the coarser levels.
pub const COARSE_CHANGE: Array = Array::given("coarse_change", Float, 1);

/// Change of the image by a level and the coarser ones.
pub const CHANGE: Array = Array::given("change", Float, 1);

/// The stage that computes the finest level.
pub const DIFFERENCE: Pass = Pass {
    name: "difference",
    binds: &[&FRAME, &PIXELS, &BACKGROUND, &MASK_IMAGE, &LEVEL_SUMS],
    extent: Some(per_pixel),
    needed: is_banded,
    ..Pass::USUAL
};

/// The stage that computes a coarser level from the one below.
pub const REDUCE: Pass =
    Pass { name: "reduce", binds: &[&FINE, &COARSE], needed: is_banded, ..Pass::USUAL };

/// The stage that computes what a level and all coarser ones add.
pub const COLLAPSE: Pass = Pass {
    name: "collapse",
    binds: &[&FINE, &COARSE, &COARSE_CHANGE, &CHANGE],
    needed: is_banded,
    ..Pass::USUAL
};

impl Passes {
    /// Computes [`Pyramid::change`](super::super::fusion::Pyramid::change).
    pub(crate) fn bands(&self, cmd: &mut Commands<'_>) -> Result<(), GpuError> {
        let fusion = self.lanes[0].fusion.as_ref();
        let top = fusion.and_then(|fusion| fusion.bands).expect("blended by bands") as usize;
        let size = [self.frame().image_width, self.frame().image_height];
        let threads = |level: usize| {
            let [width, height] = size_at(size, level);
            Extent::Threads([width, height, 1])
        };
        self.run_with(cmd, &DIFFERENCE, &|lane| {
            vec![(&LEVEL_SUMS, &lane.pyramid().level(0).sums)]
        })?;
        cmd.scope(REDUCE.name);
        for level in 0..top {
            let [width, height] = size_at(size, level);
            let push = push::Reduce { width, height };
            self.record(cmd, &REDUCE, threads(level + 1), bytemuck::bytes_of(&push), &|lane| {
                let pyramid = lane.pyramid();
                vec![(&FINE, &pyramid.level(level).sums), (&COARSE, &pyramid.level(level + 1).sums)]
            })?;
        }
        cmd.scope(COLLAPSE.name);
        for level in (0..=top).rev() {
            let [width, height] = size_at(size, level);
            // The coarsest level does not read a coarser one; any buffer is bound in its place.
            let coarsest = level == top;
            let push = push::Collapse { width, height, coarsest: coarsest.into() };
            self.record(cmd, &COLLAPSE, threads(level), bytemuck::bytes_of(&push), &|lane| {
                let pyramid = lane.pyramid();
                let (here, above) = (pyramid.level(level), pyramid.level((level + 1).min(top)));
                vec![
                    (&FINE, &here.sums),
                    (&COARSE, &above.sums),
                    (&COARSE_CHANGE, if coarsest { &above.sums } else { &above.change }),
                    (&CHANGE, &here.change),
                ]
            })?;
        }
        Ok(())
    }
}

/// Pixels of level `level` of an image of `size` pixels.
fn size_at(size: [u32; 2], level: usize) -> [u32; 2] {
    (0..level).fold(size, |size, _| size.map(|n| n.div_ceil(2)))
}
