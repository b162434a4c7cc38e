//! `moments` and `enhance`: the display chain, between detection and scan conversion.

use super::super::layout::{AXIAL_SAMPLES, BEAM_LINES};
use super::super::pass::{Array, Extent, Pass, Sizes};
use super::super::passes::Passes;
use super::super::push;
use super::axial::LOG_IMAGE;
use super::inputs::{FRAME, ROWS};
use crate::gpu::{Commands, GpuError};
use crate::output::npy::Element::Float;
use crate::settings::Processing;

/// Standard deviation of fully developed speckle after log compression, dB: 20 / ln 10 * pi / sqrt(24)
/// (Burckhardt, IEEE Trans. Sonics Ultrason. 25, 1978; Dutt and Greenleaf, IEEE Trans. Ultrason.
/// Ferroelectr. Freq. Control 43, 1996).
pub const SPECKLE_DEVIATION: f64 = 5.57;

/// Mean and mean square across the scanlines, by scanline and sample.
pub const MOMENTS: Array = Array::new("moments", Float, 2, Sizes::samples);

/// The stages: moments across the scanlines, then along them and the image from both.
pub const ENHANCE: [Pass; 2] = [
    Pass {
        name: "moments",
        binds: &[&FRAME, &ROWS, &LOG_IMAGE, &MOMENTS],
        makes: &[&MOMENTS],
        extent: Some(|f| Extent::Threads([f.samples, f.scanlines.div_ceil(BEAM_LINES), 1])),
        needed: |scene| scene.processing.is_on(),
        ..Pass::USUAL
    },
    Pass {
        name: "enhance",
        binds: &[&FRAME, &MOMENTS, &LOG_IMAGE],
        extent: Some(|f| Extent::Threads([f.samples.div_ceil(AXIAL_SAMPLES), f.scanlines, 1])),
        needed: |scene| scene.processing.is_on(),
        ..Pass::USUAL
    },
];

impl Passes {
    /// Records the display chain.
    pub(crate) fn enhance(
        &self,
        cmd: &mut Commands<'_>,
        processing: &Processing,
    ) -> Result<(), GpuError> {
        let neighbourhood = processing.neighbourhood as f32;
        let speckle = SPECKLE_DEVIATION as f32 * self.frame().inverse_range;
        let moments = push::Moments { neighbourhood };
        let enhance = push::Enhance {
            neighbourhood,
            speckle_reduction: processing.speckle_reduction as f32,
            edge_enhancement: processing.edge_enhancement as f32,
            speckle: speckle * speckle,
        };
        let pushes = [bytemuck::bytes_of(&moments), bytemuck::bytes_of(&enhance)];
        for (pass, push) in ENHANCE.iter().zip(pushes) {
            cmd.scope(pass.name);
            let extent = pass.extent.expect("stated above")(self.frame());
            self.record(cmd, pass, extent, push, &|_| Vec::new())?;
        }
        Ok(())
    }
}
