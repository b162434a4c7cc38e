//! Frames larger than the simulator was made for.

use super::batches::FrameBudget;
use super::lane::Lane;
use super::stages;
use super::upload::frame_constants;
use super::{Last, SimError, Simulator, Sources, Tables};
use crate::scene::Scene;

impl Simulator {
    /// Makes room for frames of `scene`, whose lines, samples, paths, image, tissues and points may
    /// have become more; its meshes and volume must be those at creation. Returns whether there was too
    /// little room: then the frames in flight were waited for and every buffer is another one.
    ///
    /// # Errors
    /// Device out of memory, a buffer over the device's limit; the simulator then stays as it was.
    pub fn fit(&mut self, scene: &Scene) -> Result<bool, SimError> {
        let world = &self.passes.world;
        let budget = FrameBudget::of(&self.device);
        let tables = Tables::new(scene);
        let constants = tables.frame(scene);
        let (frame, batches) = frame_constants(constants, world, self.coincident, &budget, None);
        let sizes = batches.sizes(&frame, &tables);
        if self.passes.lanes[0].buffers.hold(&sizes) {
            return Ok(false);
        }
        self.submissions.wait()?;
        let volume_of = self.passes.lanes[0].fusion.as_ref();
        let lane = Lane::new(&self.device, scene, stages::needed(scene), sizes, volume_of)?;
        let passes = &mut self.passes;
        (passes.lanes, passes.active, passes.batches) = (vec![lane], 1, batches);
        passes.shown = frame;
        self.tables = tables;
        self.sources = Sources::of(scene);
        // The new buffers hold no frame yet.
        self.last = Last::default();
        self.upload_tables()?;
        Ok(true)
    }
}

/// Width and height of a scene's B-mode image, pixels.
pub fn image_size(scene: &Scene) -> [u32; 2] {
    super::tables::raster(scene).0
}
