//! The intermediate images of the last fused frame, to look at and to run its kernels alone.

use super::super::stages::{blur, convert, display, mask};
use super::super::{SimError, Simulator};
use crate::scene::Scene;
#[cfg(doc)]
use crate::settings::Blend;

/// The steps of the last fused frame, row by row where they are images.
pub struct FusionSteps {
    /// Mask (1 outside) and grey level 0..1 of the volume: pairs, [L][K].
    pub prescan: Vec<f32>,
    /// Grey level 0..1 of the volume per pixel; 0 outside the sector.
    pub background: Vec<f32>,
    /// Scan-converted mask per pixel; 0 outside the sector.
    pub mask: Vec<f32>,
    /// Blurred mask per pixel, before the blend's curve; with [`Blend::Multiband`], which blurs it by
    /// another amount for each band, the mask itself.
    pub blurred: Vec<f32>,
    /// The simulation alone, RGBA bytes.
    pub simulated: Vec<u8>,
}

impl Simulator {
    /// The bindings of the fusion's kernels that are not buffers of the frame, as name and floats; empty unless the
    /// last frame, of `scene`, showed an acquired volume.
    pub(crate) fn fusion_dump(
        &mut self,
        scene: &Scene,
    ) -> Result<Vec<(&'static str, Vec<u8>)>, SimError> {
        let (Some(fused), Some(acquired), true) =
            (&self.lane().fusion, &scene.volume, self.last.fused)
        else {
            return Ok(Vec::new());
        };
        let mut dumped = vec![("acquired", fused.texture.read(acquired.now)?)];
        if fused.bands.is_some() {
            let pixels = self.sizes().pixels() as usize;
            let change = self.device.read_back(fused.pyramid.change())?;
            dumped.push(("change", change[..4 * pixels].to_vec()));
        }
        Ok(dumped)
    }

    /// Makes the intermediate images of the last frame everywhere, if it showed an acquired volume: frames themselves make
    /// them only around the border.
    pub(crate) fn complete_steps(&mut self) -> Result<(), SimError> {
        if self.last.fused {
            self.submissions.wait()?;
            self.device.once(|cmd| self.passes.fusion_steps(cmd))?;
        }
        Ok(())
    }

    /// The steps of the last frame, if it showed an acquired volume.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn fusion_steps(&mut self) -> Result<Option<FusionSteps>, SimError> {
        if !self.last.fused {
            return Ok(None);
        }
        self.complete_steps()?;
        let banded = self.lane().fusion.as_ref().is_some_and(|fused| fused.bands.is_some());
        let mut floats = |name| -> Result<Vec<f32>, SimError> {
            Ok(bytemuck::pod_collect_to_vec(&self.read(name)?))
        };
        let mask = floats(&convert::MASK_IMAGE)?;
        let sums = floats(if banded { &convert::MASK_IMAGE } else { &blur::SUMS })?;
        let (masks, _) = mask.as_chunks::<2>();
        let (sums, _) = sums.as_chunks::<2>();
        let mean = |s: &[f32; 2]| if s[1] > 0.0 { s[0] / s[1] } else { 0.0 };
        Ok(Some(FusionSteps {
            prescan: floats(&mask::PRESCAN)?,
            background: floats(&convert::BACKGROUND)?,
            mask: masks.iter().map(|m| m[0]).collect(),
            blurred: sums.iter().map(mean).collect(),
            simulated: self.read(&display::PIXELS)?,
        }))
    }
}
