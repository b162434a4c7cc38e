//! Fusion of the simulated image with an acquired volume: mask and volume along the scanlines, shadows
//! in it, their scan conversion, the blurred mask or the pyramid, the mixed image.

use std::sync::Arc;

use super::layout;
use super::placement;
use super::shaders::Library;
use super::tracer::Tracer;
use super::world::World;
use crate::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Stage};
use crate::scene::{Acquired, Fusion, Scene};
use crate::settings::{Blend, MaskSpeed};
use bands::{Bands, Images};
use shadows::Shadows;
use texture::Texture;
use tint::Tinting;

pub use steps::Steps;
pub use tint::Tint;

mod bands;
mod shadows;
mod steps;
mod texture;
mod tint;

/// Everything of which a frame without fusion has no need.
pub(super) struct Fused {
    device: Arc<Device>,
    /// The volume; it outlives buffers that become too small.
    texture: Arc<Texture>,
    /// The time of the volume that the frame shows.
    now: usize,
    kernels: Kernels,
    shadows: Shadows,
    bands: Bands,
    tinting: Tinting,
    /// Whether the last frame was blended by bands.
    banded: bool,
    /// The frame's [`layout::Fusion`].
    constants: Buffer,
    /// Mask and grey level of every sample of the scanlines.
    prescan: Buffer,
    /// Converted mask and weight per pixel.
    mask: Buffer,
    /// Their sums down the columns, column by column.
    down: Buffer,
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
    pub(super) scanlines: &'a Buffer,
    pub(super) tissues: &'a Buffer,
    pub(super) rows: &'a Buffer,
    pub(super) stacks: &'a Buffer,
    pub(super) counters: &'a Buffer,
    pub(super) pixels: &'a Buffer,
}

impl Fused {
    /// Uploads the scene's volume, unless `before` has it; none where the scene has none.
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        frame: &layout::Frame,
        tracer: Tracer,
        before: Option<&Self>,
    ) -> Result<Option<Self>, GpuError> {
        let Some(acquired) = &scene.volume else {
            return Ok(None);
        };
        let samples = u64::from(frame.scanlines) * u64::from(frame.samples);
        let pixels = u64::from(frame.image_width) * u64::from(frame.image_height);
        let new = |name: &str, size: u64| device.buffer(name, size.max(16), BufferKind::Storage);
        Ok(Some(Self {
            device: Arc::clone(device),
            texture: match before {
                Some(before) => Arc::clone(&before.texture),
                None => Arc::new(Texture::new(device, acquired)?),
            },
            now: acquired.now,
            kernels: Kernels::new(device, library, tracer)?,
            shadows: Shadows::new(device, library, frame, tracer)?,
            bands: Bands::new(device, library, pixels)?,
            tinting: Tinting::new(device, library, pixels)?,
            banded: false,
            constants: new("fusion", size_of::<layout::Fusion>() as u64)?,
            prescan: new("prescan", 8 * samples)?,
            mask: new("converted mask", 8 * pixels)?,
            down: new("mask sums down columns", 8 * pixels)?,
            sums: new("mask sums", 8 * pixels)?,
            background: new("background", 4 * pixels)?,
            pixels: new("fused pixels", 4 * pixels)?,
        }))
    }

    /// Makes the pipelines again, all or none.
    pub(super) fn reload(
        &mut self,
        device: &Arc<Device>,
        library: &Library,
        tracer: Tracer,
    ) -> Result<(), GpuError> {
        let kernels = Kernels::new(device, library, tracer)?;
        let shadows = shadows::Kernels::new(device, library, tracer)?;
        let tint = Tinting::kernel(device, library)?;
        self.bands.kernels = bands::Kernels::new(device, library)?;
        self.tinting.kernel = tint;
        self.shadows.kernels = shadows;
        self.kernels = kernels;
        Ok(())
    }

    /// Device memory of the volume, bytes.
    pub(super) fn volume_bytes(&self) -> u64 {
        self.texture.bytes()
    }

    /// What the user should know of the volume.
    pub(super) fn warning(&self) -> Option<&str> {
        self.texture.warning.as_deref()
    }

    fn constants(&self, acquired: &Acquired, fusion: &Fusion) -> layout::Fusion {
        let texel_from_world = self.texture.texel_from_voxel * acquired.world_from_voxel.inverse();
        let [size_x, size_y, size_z] = self.texture.extent();
        let range = acquired.white - acquired.black;
        layout::Fusion {
            voxel_from_world: placement::rows(&texel_from_world),
            size_x,
            size_y,
            size_z,
            blur: fusion.blur,
            slope: (self.texture.scale / range) as f32,
            intercept: ((self.texture.offset - acquired.black) / range) as f32,
            blend: match fusion.blend {
                Blend::Linear => layout::BLEND_LINEAR,
                Blend::Smooth => layout::BLEND_SMOOTH,
                Blend::Multiband => layout::BLEND_MULTIBAND,
            },
            mask_speed: match fusion.mask_speed {
                MaskSpeed::Enclosing => layout::MASK_SPEED_ENCLOSING,
                MaskSpeed::Probe => layout::MASK_SPEED_PROBE,
            },
        }
    }

    /// Sets the frame's constants, and makes room for what it needs; before the barrier that clears
    /// wait for.
    pub(super) fn update(&mut self, cmd: &mut Commands<'_>, scene: &Scene) -> Result<(), GpuError> {
        if let (Some(acquired), Some(fusion)) = (&scene.volume, &scene.fusion) {
            let constants = self.constants(acquired, fusion);
            cmd.write(&self.constants, 0, bytemuck::bytes_of(&constants))?;
            self.now = acquired.now;
            if fusion.background_shadows {
                self.shadows.fit(&self.device)?;
            }
            self.banded = fusion.blend == Blend::Multiband;
            if self.banded {
                self.bands.fit(&self.device, fusion.levels())?;
            }
        }
        Ok(())
    }

    /// Mixes the simulated image with the volume.
    pub(super) fn record(
        &self,
        cmd: &mut Commands<'_>,
        world: &World,
        fusion: &Fusion,
        simulated: &Simulated<'_>,
    ) -> Result<(), GpuError> {
        let (frame, buffer) = (simulated.frame, Binding::Buffer);
        let size = [frame.image_width, frame.image_height];
        let per_pixel = [size[0], size[1], 1];
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
                Binding::Image(&self.texture.images[self.now]),
                buffer(simulated.counters),
                buffer(&self.prescan),
                buffer(simulated.scanlines),
                buffer(simulated.tissues),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        let prescan = match fusion.background_shadows {
            true => (self.shadows).record(cmd, world, simulated, &self.prescan)?,
            false => &self.prescan,
        };
        cmd.scope("convert");
        cmd.dispatch(
            &self.kernels.convert,
            per_pixel,
            &[],
            &[
                buffer(simulated.constants),
                buffer(prescan),
                buffer(&self.mask),
                buffer(&self.background),
            ],
        )?;
        let change = if fusion.blend == Blend::Multiband {
            let images = Images {
                constants: simulated.constants,
                simulated: simulated.pixels,
                background: &self.background,
                mask: &self.mask,
            };
            self.bands.record(cmd, &images, size, fusion.levels())?;
            self.bands.change()
        } else {
            self.blur(cmd, simulated.constants, size)?;
            // The kernel does not read it.
            &self.background
        };
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
                buffer(change),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Transfer);
        Ok(())
    }

    /// Sums mask and weight over the box: down the columns, each time exchanged with the rows.
    fn blur(
        &self,
        cmd: &mut Commands<'_>,
        frame: &Buffer,
        [width, height]: [u32; 2],
    ) -> Result<(), GpuError> {
        let buffer = Binding::Buffer;
        for (turned, [width, height], source, sums) in [
            (0u32, [width, height], &self.mask, &self.down),
            (1, [height, width], &self.down, &self.sums),
        ] {
            cmd.barrier(Stage::Compute, Stage::Compute);
            cmd.scope("blur");
            cmd.dispatch(
                &self.kernels.blur,
                [width, height.div_ceil(layout::BLUR_SUMS), 1],
                bytemuck::bytes_of(&turned),
                &[buffer(frame), buffer(&self.constants), buffer(source), buffer(sums)],
            )?;
        }
        Ok(())
    }
}
