//! `difference`, `reduce`, `collapse`: blending by bands, over a pyramid of the simulated image minus the
//! acquired one.

use std::sync::Arc;

use super::super::pass::{Extent, Pass, per_pixel};
use super::super::passes::Passes;
use crate::gpu::{Buffer, BufferKind, Commands, Device, GpuError};
use crate::scene::Scene;
use crate::settings::Blend;

/// The stage that computes the finest level.
pub const DIFFERENCE: Pass = Pass {
    name: "difference",
    binds: &["frame", "pixels", "background", "mask", "level"],
    extent: Some(per_pixel),
    needed: is_banded,
    ..Pass::USUAL
};

/// The stage that computes a coarser level from the one below.
pub const REDUCE: Pass =
    Pass { name: "reduce", binds: &["fine", "coarse"], needed: is_banded, ..Pass::USUAL };

/// The stage that computes what a level and all coarser ones add.
pub const COLLAPSE: Pass = Pass {
    name: "collapse",
    binds: &["fine", "coarse", "coarse_change", "change"],
    needed: is_banded,
    ..Pass::USUAL
};

/// True if frames of a scene are blended by bands.
pub(crate) fn is_banded(scene: &Scene) -> bool {
    scene.shows_volume() && scene.fusion.as_ref().is_some_and(|f| f.blend == Blend::Multiband)
}

/// A level of the pyramid.
struct PyramidLevel {
    /// Difference and weights per pixel, three floats.
    sums: Buffer,
    /// The sum that this level and the coarser ones add to the acquired image.
    change: Buffer,
}

/// The levels, finest first; empty until they are needed.
#[derive(Default)]
pub(crate) struct Pyramid(Vec<PyramidLevel>);

impl Pyramid {
    /// Makes room for `levels` levels above the finest, of images of up to `pixels` pixels, whatever
    /// their shape.
    pub(crate) fn fit(
        &mut self,
        device: &Arc<Device>,
        pixels: u64,
        levels: u32,
    ) -> Result<(), GpuError> {
        while self.0.len() <= levels as usize {
            // ceil(w / 2) ceil(h / 2) <= (w h + 1) / 2, for an image one pixel wide with equality.
            let pixels = (0..self.0.len()).fold(pixels, |pixels, _| pixels.div_ceil(2));
            let new = |name: &str, each: u64| {
                device.buffer(name, (each * pixels).max(16), BufferKind::Storage)
            };
            self.0
                .push(PyramidLevel { sums: new("band sums", 12)?, change: new("band change", 4)? });
        }
        Ok(())
    }

    /// The values added to the pixels of the acquired image.
    pub(crate) fn change(&self) -> &Buffer {
        &self.0[0].change
    }
}

impl Passes {
    /// Computes [`Pyramid::change`].
    pub(crate) fn bands(&self, cmd: &mut Commands<'_>) -> Result<(), GpuError> {
        let fusion = self.lanes[0].fusion.as_ref();
        let top = fusion.and_then(|fusion| fusion.bands).expect("blended by bands") as usize;
        let size = [self.frame().image_width, self.frame().image_height];
        let threads = |level: usize| {
            let [width, height] = size_at(size, level);
            Extent::Threads([width, height, 1])
        };
        self.run_with(cmd, &DIFFERENCE, &|lane| vec![("level", &lane.pyramid().0[0].sums)])?;
        cmd.scope(REDUCE.name);
        for level in 0..top {
            let push = size_at(size, level);
            self.record(cmd, &REDUCE, threads(level + 1), bytemuck::bytes_of(&push), &|lane| {
                let levels = &lane.pyramid().0;
                vec![("fine", &levels[level].sums), ("coarse", &levels[level + 1].sums)]
            })?;
        }
        cmd.scope(COLLAPSE.name);
        for level in (0..=top).rev() {
            let [width, height] = size_at(size, level);
            // The coarsest level does not read a coarser one; any buffer is bound in its place.
            let coarsest = level == top;
            let push = [width, height, u32::from(coarsest)];
            self.record(cmd, &COLLAPSE, threads(level), bytemuck::bytes_of(&push), &|lane| {
                let levels = &lane.pyramid().0;
                let (here, above) = (&levels[level], &levels[(level + 1).min(top)]);
                vec![
                    ("fine", &here.sums),
                    ("coarse", &above.sums),
                    ("coarse_change", if coarsest { &above.sums } else { &above.change }),
                    ("change", &here.change),
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
