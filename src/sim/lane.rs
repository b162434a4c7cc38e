//! Lanes: what images that are made side by side in one frame have each for themselves.
//!
//! A stage of a frame is recorded for all lanes and then one barrier, so that a device with more threads than one image
//! needs works on several of them at once. Anatomy, kernels and tables are there once.

use std::sync::Arc;

use glam::DAffine3;

use super::buffers::Buffers;
use super::contact::SkinContact;
use super::fusion::{FusionResources, Pyramid};
use super::layout::{self, Frame};
use super::packet::Packets;
use super::pass::{Array, Sizes};
use super::placement;
use super::read_out::ReadOut;
use super::stages::display::PIXELS;
use super::stages::fuse::FUSED;
use super::stages::inputs::{FRAME, TISSUES};
use super::stages::mask::PRESCAN;
use super::stages::shadow::SHADED;
use super::tables::{Tables, tissue_seed};
use crate::gpu::{Buffer, Commands, Device, GpuError};
use crate::scene::Scene;

/// What images of the same scene at the same time may differ in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// World from probe, rigid, mm.
    pub world_from_probe: DAffine3,
    /// Seed of scatterers, paths and noise.
    pub seed: u32,
    /// The image's number; selects the noise.
    pub index: u32,
}

impl Shot {
    /// The image of a scene as it is.
    pub fn of(scene: &Scene, index: u32) -> Self {
        let (world_from_probe, seed) = (scene.world_from_probe, scene.simulation.seed);
        Self { world_from_probe, seed, index }
    }

    /// The constants of this image; all others are those of `frame`.
    pub(super) fn constants(&self, frame: &Frame) -> Frame {
        Frame {
            world_from_probe: placement::matrix_rows(&self.world_from_probe),
            probe_from_world: placement::matrix_rows(&self.world_from_probe.inverse()),
            seed: self.seed,
            frame_index: self.index,
            ..*frame
        }
    }
}

/// What one image of a frame has for itself.
pub(super) struct Lane {
    pub(super) buffers: Buffers,
    /// None where the scene has no acquired volume.
    pub(super) fusion: Option<FusionResources>,
    pub(super) frame: Frame,
    pub(super) read_out: ReadOut,
    /// The contact of the probe with the skin.
    pub(super) touch: Option<SkinContact>,
    /// Packets of the first lane.
    pub(super) packets: Packets,
}

impl Lane {
    /// The first lane, with buffers of `arrays`, for images of up to these sizes.
    pub(super) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        arrays: impl Iterator<Item = &'static Array>,
        sizes: Sizes,
        volume_of: Option<&FusionResources>,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            buffers: Buffers::new(device, arrays, sizes)?,
            fusion: FusionResources::new(device, scene, volume_of)?,
            frame: sizes.frame,
            read_out: ReadOut::default(),
            touch: None,
            packets: Packets::default(),
        })
    }

    /// Another lane, which shares tables and volume with this one.
    pub(super) fn beside(
        &self,
        device: &Arc<Device>,
        scene: &Scene,
        arrays: impl Iterator<Item = &'static Array>,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            buffers: self.buffers.beside(device, arrays)?,
            fusion: FusionResources::new(device, scene, self.fusion.as_ref())?,
            frame: self.frame,
            read_out: ReadOut::default(),
            touch: None,
            packets: Packets::default(),
        })
    }

    /// Records the upload of the constants `frame`, and of the tissues with their seeds in it.
    pub(super) fn set(
        &mut self,
        cmd: &mut Commands<'_>,
        frame: Frame,
        tables: &Tables,
    ) -> Result<(), GpuError> {
        let seeded = |(i, tissue): (usize, &layout::Tissue)| layout::Tissue {
            seed: tissue_seed(frame.seed, i),
            ..*tissue
        };
        let tissues: Vec<layout::Tissue> = tables.tissues.iter().enumerate().map(seeded).collect();
        cmd.write(&self.buffers[&TISSUES], 0, bytemuck::cast_slice(&tissues))?;
        cmd.write(&self.buffers[&FRAME], 0, bytemuck::bytes_of(&frame))?;
        self.frame = frame;
        Ok(())
    }

    /// The pyramid of a fused image that is blended by bands.
    pub(super) fn pyramid(&self) -> &Pyramid {
        &self.fusion.as_ref().expect("an image with a volume").pyramid
    }

    /// Mask and acquired volume along the scanlines, with shadows if the frame has them.
    pub(super) fn prescan(&self) -> &Buffer {
        let fusion = self.fusion.as_ref().expect("an image with a volume");
        &self.buffers[if fusion.shaded { &SHADED } else { &PRESCAN }]
    }

    /// The finished image.
    pub(super) fn pixels(&self, fused: bool) -> &Buffer {
        &self.buffers[pixels(fused)]
    }
}

/// The array of the finished image.
pub(super) fn pixels(fused: bool) -> &'static Array {
    if fused { &FUSED } else { &PIXELS }
}
