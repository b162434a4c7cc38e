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

/// Bytes that every device of Vulkan takes in one buffer (maxStorageBufferRange, Vulkan 1.3, 49.1); software drivers take no
/// more.
const EVERYWHERE: u64 = 1 << 27;

/// The buffer of a frame that grows with settings alone and is larger than every device takes, with the remedy; none as a rule.
pub fn beyond_some_devices(scene: &Scene) -> Option<(String, &'static str)> {
    let [width, height] = image_size(scene).map(u64::from);
    let lines = u64::from(scene.probe.scanlines) * u64::from(scene.probe.samples);
    let buffers = [
        (
            format!("an image of {width} x {height} pixels"),
            4 * width * height,
            "lower imaging.image_height",
        ),
        (
            format!("{} scanlines of {} samples", scene.probe.scanlines, scene.probe.samples),
            8 * lines,
            "lower probe.scanlines or probe.samples",
        ),
    ];
    let (what, bytes, remedy) = buffers.into_iter().find(|(_, bytes, _)| *bytes > EVERYWHERE)?;
    let message = format!(
        "{what} take {} MiB in one buffer; devices need not take more than {}, and drivers without a GPU do not",
        bytes >> 20,
        EVERYWHERE >> 20
    );
    Some((message, remedy))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::Probe;
    use crate::scene::Tissue;

    #[test]
    fn what_some_devices_refuse_is_told() {
        let liver = Tissue::shipped("liver").expect("shipped");
        let mut scene = Scene::homogeneous(liver, Probe::paper_table1());
        assert_eq!(beyond_some_devices(&scene), None);
        scene.imaging.image_height = 8192;
        let fault = beyond_some_devices(&scene).expect("too high");
        assert!(fault.0.contains("x 8192 pixels") && fault.1.contains("image_height"), "{fault:?}");
        scene.imaging.image_height = 400;
        (scene.probe.scanlines, scene.probe.samples) = (4096, 65_536);
        let fault = beyond_some_devices(&scene).expect("too many");
        assert!(fault.0.contains("2048 MiB") && fault.1.contains("probe.samples"), "{fault:?}");
    }
}
