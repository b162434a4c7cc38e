//! `fuse`: simulated and acquired image mixed.

use super::super::pass::{Array, Pass, Sizes};
use super::super::passes::Passes;
use super::aperture::{APERTURES, SHADES};
use super::axial::LOG_IMAGE;
use super::blur::SUMS;
use super::convert::BACKGROUND;
use super::inputs::{FRAME, GREY};
use super::mask::{FUSION, PRESCAN};
use super::pyramid::CHANGE;
use super::tiles::TILE_LIST;
use super::tiles::per_tile;
use super::{CONVERT, DARKEN, DISPLAY, MASK, SHADOW};
use crate::gpu::{Commands, GpuError, Stage};
use crate::output::npy::Element::Word;
use crate::scene::{Fusion, Scene};
use crate::settings::Blend;

/// Simulated and acquired image mixed, RGBA.
pub const FUSED: Array = Array::new("fused", Word, 1, Sizes::pixels);

/// The stage.
pub const FUSE: Pass = Pass {
    name: "fuse",
    binds: &[
        &FRAME,
        &FUSION,
        &LOG_IMAGE,
        &GREY,
        &PRESCAN,
        &TILE_LIST,
        &SUMS,
        &FUSED,
        &BACKGROUND,
        &CHANGE,
    ],
    makes: &[&FUSED],
    extent: Some(per_tile),
    then: Stage::Transfer,
    needed: Scene::shows_volume,
    ..Pass::USUAL
};

impl Passes {
    /// Records the images mixed with the acquired volume.
    pub(crate) fn fuse(&self, cmd: &mut Commands<'_>, fusion: &Fusion) -> Result<(), GpuError> {
        self.run(cmd, &MASK)?;
        if fusion.background_shadows {
            self.run(cmd, &SHADOW)?;
            if self.loses_by_aperture() {
                self.converge(cmd, &|lane| vec![(&APERTURES, &lane.buffers[&SHADES])])?;
            }
            self.run(cmd, &DARKEN)?;
        }
        self.mixed_by(cmd, fusion.blend)?;
        self.run_with(cmd, &FUSE, &|lane| {
            // Not read without blending by bands.
            let change = match fusion.blend {
                Blend::Multiband => lane.pyramid().change(),
                Blend::Linear | Blend::Smooth => &lane.buffers[&BACKGROUND],
            };
            vec![(&PRESCAN, lane.prescan()), (&CHANGE, change)]
        })
    }

    /// Records what says how the images are mixed.
    fn mixed_by(&self, cmd: &mut Commands<'_>, blend: Blend) -> Result<(), GpuError> {
        match blend {
            Blend::Multiband => {
                self.convert(cmd, true)?;
                self.bands(cmd)
            }
            Blend::Linear | Blend::Smooth => {
                self.convert(cmd, false)?;
                self.blur(cmd)
            }
        }
    }

    /// Records the scan conversion of the mask where it is blurred; if `whole`, that of the mask, the acquired and the
    /// simulated image everywhere.
    fn convert(&self, cmd: &mut Commands<'_>, whole: bool) -> Result<(), GpuError> {
        self.tiles(cmd, whole)?;
        if whole {
            self.run(cmd, &DISPLAY)?;
            // Its output is read by kernels here, not only copied.
            cmd.barrier(Stage::Compute, Stage::Compute);
        }
        self.run_with(cmd, &CONVERT, &|lane| vec![(&PRESCAN, lane.prescan())])
    }

    /// Records the intermediate images of the last fused frame, which that has made only where it needed them.
    pub(crate) fn fusion_steps(&self, cmd: &mut Commands<'_>) -> Result<(), GpuError> {
        self.convert(cmd, true)?;
        self.blur(cmd)
    }
}
