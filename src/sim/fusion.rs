//! Fusion of the simulated image with an acquired volume: the volume on the device, the constants of its
//! kernels, and the intermediate images of the last fused frame.

use std::sync::Arc;

use super::buffers::Buffers;
use super::stages::mask;
use super::{layout, placement};
use crate::gpu::{Commands, Device, GpuError, Image};
use crate::scene::{Acquired, Fusion, Scene};
use crate::settings::{Blend, MaskSpeed};
pub(super) use pyramid::{Pyramid, is_banded};
use texture::VolumeTexture;

pub use super::stages::tint::Tint;
pub use steps::FusionSteps;

mod pyramid;
mod steps;
mod texture;

/// All that only frames with fusion need, except its buffers.
pub(super) struct FusionResources {
    /// The volume. It is kept when buffers are made larger.
    texture: Arc<VolumeTexture>,
    /// The time of the volume that the frame shows.
    now: usize,
    pub(super) pyramid: Pyramid,
    /// Levels of the pyramid above the finest, if the frame is blended by bands.
    pub(super) bands: Option<u32>,
    /// True if the simulated anatomy shades the volume in the frame.
    pub(super) shaded: bool,
}

impl FusionResources {
    /// Uploads the scene's volume, unless `before` has it; returns none for a scene without a volume.
    pub(super) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        before: Option<&Self>,
    ) -> Result<Option<Self>, GpuError> {
        let Some(acquired) = &scene.volume else {
            return Ok(None);
        };
        let texture = match before {
            Some(before) => Arc::clone(&before.texture),
            None => Arc::new(VolumeTexture::new(device, acquired)?),
        };
        Ok(Some(Self {
            texture,
            now: acquired.now,
            pyramid: Pyramid::default(),
            bands: None,
            shaded: false,
        }))
    }

    /// The volume at the time that the frame shows.
    pub(super) fn shown(&self) -> &Image {
        &self.texture.images[self.now]
    }

    /// Device memory of the volume, bytes.
    pub(super) fn volume_bytes(&self) -> u64 {
        self.texture.bytes()
    }

    /// A warning for the user about the volume, if there is one.
    pub(super) fn warning(&self) -> Option<&str> {
        self.texture.warning.as_deref()
    }

    fn constants(&self, acquired: &Acquired, fusion: &Fusion) -> layout::Fusion {
        let texel_from_world = self.texture.texel_from_voxel * acquired.world_from_voxel.inverse();
        let [size_x, size_y, size_z] = self.texture.extent();
        let range = acquired.white - acquired.black;
        layout::Fusion {
            voxel_from_world: placement::matrix_rows(&texel_from_world),
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

    /// Writes the frame's constants and makes room for what it needs. To be called before the barrier
    /// behind the clearing of the buffers.
    pub(super) fn update(
        &mut self,
        cmd: &mut Commands<'_>,
        scene: &Scene,
        buffers: &Buffers,
    ) -> Result<(), GpuError> {
        let (Some(acquired), Some(fusion), true) =
            (&scene.volume, &scene.fusion, scene.shows_volume())
        else {
            return Ok(());
        };
        let constants = self.constants(acquired, fusion);
        cmd.write(&buffers[&mask::FUSION], 0, bytemuck::bytes_of(&constants))?;
        self.now = acquired.now;
        self.shaded = fusion.background_shadows;
        self.bands = is_banded(scene).then(|| fusion.levels());
        if let Some(levels) = self.bands {
            self.pyramid.fit(cmd.device(), buffers.room().pixels(), levels)?;
        }
        Ok(())
    }
}
