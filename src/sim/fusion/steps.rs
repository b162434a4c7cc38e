//! What the last fused frame consisted of, to look at and to run its kernels alone.

use super::super::stages::lines;
use super::super::{SimError, Simulator, layout};
use crate::gpu::Buffer;
use crate::output::npy::Element;
use crate::scene::Scene;
#[cfg(doc)]
use crate::settings::Blend;

/// The steps of the last fused frame, row by row where they are images.
pub struct Steps {
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

/// A binding of one of the kernels: name, type, words per entry, content.
pub(in crate::sim) type Dumped = (&'static str, Element, usize, Vec<u8>);

impl Simulator {
    /// What the kernels of the fusion had bound in the last frame, of `scene`, if it showed an
    /// acquired volume.
    pub(in crate::sim) fn fusion_dump(
        &mut self,
        scene: &Scene,
    ) -> Result<Option<Vec<Dumped>>, SimError> {
        let passes = &self.passes;
        let (Some(fused), Some(acquired), Some(fusion)) =
            (&passes.fusion, &scene.volume, &scene.fusion)
        else {
            return Ok(None);
        };
        if !self.fused {
            return Ok(None);
        }
        self.frames.wait()?;
        let constants = fused.constants(acquired, fusion);
        let frame = &passes.frame;
        let samples = frame.scanlines as usize * frame.samples as usize;
        let pixels = frame.image_width as usize * frame.image_height as usize;
        let read = |buffer: &Buffer, size: usize| -> Result<Vec<u8>, SimError> {
            Ok(self.device.read_back(buffer)?[..size].to_vec())
        };
        use Element::{Float, Word};
        let mut dumped = vec![
            ("fusion", Word, 1, bytemuck::bytes_of(&constants).to_vec()),
            ("acquired", Float, 1, fused.texture.read(&self.device, acquired.now)?),
            ("prescan", Float, 2, read(&fused.prescan, 8 * samples)?),
            ("mask", Float, 2, read(&fused.mask, 8 * pixels)?),
            ("sums", Float, 2, read(&fused.sums, 8 * pixels)?),
            ("background", Float, 1, read(&fused.background, 4 * pixels)?),
            ("simulated", Word, 1, read(&passes.buffers.pixels, 4 * pixels)?),
        ];
        if fused.banded {
            let change = read(fused.bands.change(), 4 * pixels)?;
            dumped.push(("change", Float, 1, change));
        }
        if let Some(shadows) = fused.shadows.buffers().filter(|_| fusion.background_shadows) {
            let size = 16 * layout::MAX_PIECES * lines(frame) as usize;
            dumped.push(("pieces", Float, 4, read(&shadows.pieces, size)?));
            dumped.push(("shaded", Float, 2, read(&shadows.shaded, 8 * samples)?));
        }
        Ok(Some(dumped))
    }

    /// The steps of the last frame, if it showed an acquired volume.
    ///
    /// # Errors
    /// What Vulkan says.
    pub fn fusion_steps(&mut self) -> Result<Option<Steps>, SimError> {
        if !self.fused {
            return Ok(None);
        }
        self.frames.wait()?;
        let passes = &self.passes;
        let fused = passes.fusion.as_ref().expect("the frame was fused");
        let frame = &passes.frame;
        let samples = frame.scanlines as usize * frame.samples as usize;
        let pixels = frame.image_width as usize * frame.image_height as usize;
        let floats = |buffer: &Buffer, count: usize| -> Result<Vec<f32>, SimError> {
            let bytes = self.device.read_back(buffer)?;
            Ok(bytemuck::pod_collect_to_vec(&bytes[..4 * count]))
        };
        let mask = floats(&fused.mask, 2 * pixels)?;
        let blurred = match fused.banded {
            true => &fused.mask,
            false => &fused.sums,
        };
        let sums = floats(blurred, 2 * pixels)?;
        let (masks, _) = mask.as_chunks::<2>();
        let (sums, _) = sums.as_chunks::<2>();
        let mean = |s: &[f32; 2]| if s[1] > 0.0 { s[0] / s[1] } else { 0.0 };
        Ok(Some(Steps {
            prescan: floats(&fused.prescan, 2 * samples)?,
            background: floats(&fused.background, pixels)?,
            mask: masks.iter().map(|m| m[0]).collect(),
            blurred: sums.iter().map(mean).collect(),
            simulated: self.device.read_back(&passes.buffers.pixels)?[..4 * pixels].to_vec(),
        }))
    }
}
