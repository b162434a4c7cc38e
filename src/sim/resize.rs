//! Frames of another size than the simulator was made for, and where they are shown.

use super::passes::frame_constants;
use super::rounds::Rounds;
use super::shaders::Library;
use super::stages::{Buffers, Room, lines};
use super::{Fused, Settings, SimError, Simulator, Tables, layout};
use crate::gpu::Image;
use crate::scene::Scene;

impl Simulator {
    /// Makes room for frames of `scene`, whose lines, samples, paths, image, tissues and points may
    /// have become more; its meshes and volume must be those at creation. After the frames in flight, and only
    /// where there is too little. Whether there was.
    ///
    /// # Errors
    /// Device out of memory, a buffer over the device's limit; the simulator then stays as it was.
    pub fn fit(&mut self, library: &Library, scene: &Scene) -> Result<bool, SimError> {
        let world = &self.passes.world;
        let room = Room::of(&self.device);
        let (frame, batches) = frame_constants(scene, world, self.coincident, 0, &room);
        let tables = Tables::new(scene);
        if holds(&self.passes.buffers, &frame, &batches.rounds, &tables) {
            return Ok(false);
        }
        self.frames.wait()?;
        let buffers = Buffers::new(&self.device, &frame, &batches.rounds, &tables)?;
        let fusion = Fused::new(
            &self.device,
            library,
            scene,
            &frame,
            world.tracer(),
            self.passes.fusion.as_ref(),
        )?;
        let passes = &mut self.passes;
        (passes.buffers, passes.fusion) = (buffers, fusion);
        (passes.frame, passes.batches) = (frame, batches);
        passes.shown = frame;
        self.tables = tables;
        self.settings = Settings::of(scene);
        self.read_out = super::ReadOut::default();
        self.upload_tables()?;
        Ok(true)
    }

    /// Copies the next frames to an image of their size, [`image_size`] texels of RGBA; with nothing
    /// they stay in their buffer.
    pub fn show_on(&mut self, image: Option<Image>) {
        self.shown_on = image;
    }
}

/// Width and height of a scene's B-mode image, pixels.
pub fn image_size(scene: &Scene) -> [u32; 2] {
    let frame = super::tables::frame(scene, 0);
    [frame.image_width, frame.image_height]
}

fn holds(b: &Buffers, frame: &layout::Frame, rounds: &Rounds, tables: &Tables) -> bool {
    let samples = u64::from(frame.scanlines) * u64::from(frame.samples);
    let lines = u64::from(lines(frame));
    let segments = lines * u64::from(frame.segment_capacity);
    let pixels = u64::from(frame.image_width) * u64::from(frame.image_height);
    [
        (&b.scanlines, tables.scanlines.len() as u64, size_of::<layout::Scanline>()),
        (&b.rows, tables.rows.len() as u64, size_of::<layout::Row>()),
        (&b.tissues, tables.tissues.len() as u64, size_of::<layout::Tissue>()),
        (&b.surfaces, tables.surfaces.len() as u64, size_of::<layout::Surface>()),
        (&b.points, tables.points.len() as u64, 16),
        (&b.contact, 2 * u64::from(frame.scanlines) + 1, 4),
        (&b.stacks, lines * layout::START_WORDS as u64, 4),
        (&b.segments, segments, size_of::<layout::Segment>()),
        (&b.segment_count, lines, 4),
        (&b.interactions, rounds.interactions(), size_of::<layout::Interaction>()),
        (&b.interaction_count, rounds.main_paths(), 4),
        (&b.iq, samples, 8),
        (&b.pixels, pixels, 4),
    ]
    .into_iter()
    .all(|(buffer, count, each)| buffer.size() >= count * each as u64)
}
