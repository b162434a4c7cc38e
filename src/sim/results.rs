//! Results of the last frame, read from its buffers.

use super::pass::Sizes;
use super::{SimError, Simulator, layout};

impl Simulator {
    /// The counters of the last frame.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn counters(&mut self) -> Result<layout::Counters, SimError> {
        Ok(bytemuck::pod_read_unaligned(&self.read("counters")?))
    }

    /// The integer accumulators of the last frame, surface then volume echoes: complex pairs, [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn echoes(&mut self) -> Result<[Vec<i32>; 2], SimError> {
        let both = [self.read("surface_echoes")?, self.read("volume_echoes")?];
        Ok(both.map(|bytes| bytemuck::pod_collect_to_vec(&bytes)))
    }

    /// Segments of the last frame per line e * scanlines + l, in no particular order; where the paths
    /// were traced in several batches, those of the last batch.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn segments(&mut self) -> Result<Vec<Vec<layout::Segment>>, SimError> {
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.read("segment_count")?);
        let segments: Vec<layout::Segment> = bytemuck::pod_collect_to_vec(&self.read("segments")?);
        let capacity = self.passes.frame.segment_capacity as usize;
        let lines = segments.chunks(capacity).zip(&counts);
        Ok(lines.map(|(line, &count)| line[..capacity.min(count as usize)].to_vec()).collect())
    }

    /// Echoes after the lateral stage, with noise, before the axial kernel: complex pairs, [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn lateral(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats("lateral")
    }

    /// Complex baseband before TGC, relative to a perfect mirror: complex pairs, [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn iq(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats("iq")
    }

    /// Log-compressed envelope, 0..1: [L][K].
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn log_image(&mut self) -> Result<Vec<f32>, SimError> {
        self.floats("log_image")
    }

    pub(super) fn floats(&mut self, name: &str) -> Result<Vec<f32>, SimError> {
        Ok(bytemuck::pod_collect_to_vec(&self.read(name)?))
    }

    /// The content of buffer `name` after the last frame.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>, SimError> {
        self.frames.wait()?;
        Ok(self.passes.buffers.read(&self.device, name, &self.sizes())?)
    }

    /// Sizes of the last frame.
    pub(super) fn sizes(&self) -> Sizes {
        self.passes.batches.sizes(&self.passes.frame, &self.tables)
    }
}
