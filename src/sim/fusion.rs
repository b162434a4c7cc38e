//! Fusion of the simulated image with an acquired volume: mask and volume along the scanlines, their
//! scan conversion, the blurred mask, the mixed image.

use std::sync::Arc;

use super::layout;
use super::placement;
use super::shaders::Library;
use super::tracer::Tracer;
use super::world::World;
use super::{SimError, Simulator};
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};
use crate::npy::Element;
use crate::scene::fusion::Blend;
use crate::scene::{Acquired, Fusion, Scene};
use texture::Texture;

mod texture;

/// Everything of which a frame without fusion has no need.
pub(super) struct Fused {
    texture: Texture,
    kernels: Kernels,
    /// The frame's [`layout::Fusion`].
    constants: Buffer,
    /// Mask and grey level of every sample of the scanlines.
    prescan: Buffer,
    /// Converted mask and weight per pixel.
    mask: Buffer,
    /// Their sums along rows.
    across: Buffer,
    /// Their sums over the whole box.
    sums: Buffer,
    /// Converted grey level per pixel.
    background: Buffer,
    /// The mixed image.
    pub(super) pixels: Buffer,
}

/// Its kernels.
struct Kernels {
    mask: Kernel,
    convert: Kernel,
    blur: Kernel,
    fuse: Kernel,
}

impl Kernels {
    fn new(device: &Arc<Device>, library: &Library, tracer: Tracer) -> Result<Self, GpuError> {
        let kernel = |stem: &str| Kernel::new(device, stem, library.words(stem), &[]);
        Ok(Self {
            mask: kernel(&format!("mask_{}", tracer.suffix()))?,
            convert: kernel("convert")?,
            blur: kernel("blur")?,
            fuse: kernel("fuse")?,
        })
    }
}

/// The buffers of the frame that the fusion reads.
pub(super) struct Simulated<'a> {
    pub(super) frame: &'a layout::Frame,
    pub(super) constants: &'a Buffer,
    pub(super) counters: &'a Buffer,
    pub(super) pixels: &'a Buffer,
}

impl Fused {
    /// Uploads the scene's volume; none where it has none.
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        frame: &layout::Frame,
        tracer: Tracer,
    ) -> Result<Option<Self>, GpuError> {
        let Some(acquired) = &scene.volume else {
            return Ok(None);
        };
        let samples = u64::from(frame.scanlines) * u64::from(frame.samples);
        let pixels = u64::from(frame.image_width) * u64::from(frame.image_height);
        let new = |name: &str, size: u64| device.buffer(name, size.max(16), BufferKind::Storage);
        Ok(Some(Self {
            texture: Texture::new(device, acquired)?,
            kernels: Kernels::new(device, library, tracer)?,
            constants: new("fusion", size_of::<layout::Fusion>() as u64)?,
            prescan: new("prescan", 8 * samples)?,
            mask: new("converted mask", 8 * pixels)?,
            across: new("mask sums along rows", 8 * pixels)?,
            sums: new("mask sums", 8 * pixels)?,
            background: new("background", 4 * pixels)?,
            pixels: new("fused pixels", 4 * pixels)?,
        }))
    }

    /// Makes the pipelines again.
    pub(super) fn reload(
        &mut self,
        device: &Arc<Device>,
        library: &Library,
        tracer: Tracer,
    ) -> Result<(), GpuError> {
        self.kernels = Kernels::new(device, library, tracer)?;
        Ok(())
    }

    /// What the user should know of the volume.
    pub(super) fn warning(&self) -> Option<&str> {
        self.texture.warning.as_deref()
    }

    fn constants(&self, acquired: &Acquired, fusion: &Fusion) -> layout::Fusion {
        let texel_from_world = self.texture.texel_from_voxel * acquired.world_from_voxel.inverse();
        let [size_x, size_y, size_z] = self.texture.image.extent();
        let range = acquired.white - acquired.black;
        layout::Fusion {
            voxel_from_world: placement::rows(&texel_from_world),
            size_x,
            size_y,
            size_z,
            blur: fusion.blur,
            slope: (self.texture.scale / range) as f32,
            intercept: ((self.texture.offset - acquired.black) / range) as f32,
            eased: u32::from(fusion.blend == Blend::Smooth),
            unused0: 0,
        }
    }

    /// Sets the frame's constants; before the barrier that clears wait for.
    pub(super) fn update(&self, cmd: &mut Commands<'_>, scene: &Scene) -> Result<(), GpuError> {
        if let (Some(acquired), Some(fusion)) = (&scene.volume, &scene.fusion) {
            let constants = self.constants(acquired, fusion);
            cmd.write(&self.constants, 0, bytemuck::bytes_of(&constants))?;
        }
        Ok(())
    }

    /// Mixes the simulated image with the volume.
    pub(super) fn record(
        &self,
        cmd: &mut Commands<'_>,
        world: &World,
        simulated: &Simulated<'_>,
    ) -> Result<(), GpuError> {
        let (frame, buffer) = (simulated.frame, Binding::Buffer);
        let per_pixel = [frame.image_width, frame.image_height, 1];
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("mask");
        cmd.dispatch_groups(
            &self.kernels.mask,
            [frame.scanlines, 1, 1],
            &[],
            &[
                buffer(simulated.constants),
                buffer(world.instances()),
                buffer(world.vertices()),
                buffer(world.triangles()),
                world.structure(),
                buffer(&self.constants),
                Binding::Image(&self.texture.image),
                buffer(simulated.counters),
                buffer(&self.prescan),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("convert");
        cmd.dispatch(
            &self.kernels.convert,
            per_pixel,
            &[],
            &[
                buffer(simulated.constants),
                buffer(&self.prescan),
                buffer(&self.mask),
                buffer(&self.background),
            ],
        )?;
        for (down, source, sums) in [
            (0u32, &self.mask, &self.across),
            (1, &self.across, &self.sums),
        ] {
            cmd.barrier(Stage::Compute, Stage::Compute);
            cmd.scope("blur");
            cmd.dispatch(
                &self.kernels.blur,
                per_pixel,
                bytemuck::bytes_of(&down),
                &[
                    buffer(simulated.constants),
                    buffer(&self.constants),
                    buffer(source),
                    buffer(sums),
                ],
            )?;
        }
        cmd.barrier(Stage::Compute, Stage::Compute);
        cmd.scope("fuse");
        cmd.dispatch(
            &self.kernels.fuse,
            per_pixel,
            &[],
            &[
                buffer(simulated.constants),
                buffer(&self.constants),
                buffer(simulated.pixels),
                buffer(&self.background),
                buffer(&self.sums),
                buffer(&self.pixels),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Transfer);
        Ok(())
    }
}

/// The steps of the last fused frame, row by row where they are images.
pub struct Steps {
    /// Mask (1 outside) and grey level 0..1 of the volume: pairs, [L][K].
    pub prescan: Vec<f32>,
    /// Grey level 0..1 of the volume per pixel; 0 outside the sector.
    pub background: Vec<f32>,
    /// Scan-converted mask per pixel; 0 outside the sector.
    pub mask: Vec<f32>,
    /// Blurred mask per pixel, before the blend's curve.
    pub blurred: Vec<f32>,
    /// The simulation alone, RGBA bytes.
    pub simulated: Vec<u8>,
}

/// A binding of one of the kernels: name, type, words per entry, content.
type Dumped = (&'static str, Element, usize, Vec<u8>);

impl Simulator {
    /// What the kernels of the fusion had bound in the last frame, of `scene`, if it showed an
    /// acquired volume.
    pub(super) fn fusion_dump(&mut self, scene: &Scene) -> Result<Option<Vec<Dumped>>, SimError> {
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
        Ok(Some(vec![
            ("fusion", Word, 1, bytemuck::bytes_of(&constants).to_vec()),
            ("acquired", Float, 1, fused.texture.read(&self.device)?),
            ("prescan", Float, 2, read(&fused.prescan, 8 * samples)?),
            ("mask", Float, 2, read(&fused.mask, 8 * pixels)?),
            ("sums", Float, 2, read(&fused.sums, 8 * pixels)?),
            ("background", Float, 1, read(&fused.background, 4 * pixels)?),
            (
                "simulated",
                Word,
                1,
                read(&passes.buffers.pixels, 4 * pixels)?,
            ),
        ]))
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
        let sums = floats(&fused.sums, 2 * pixels)?;
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
