//! The frame: scene and probe to B-mode image on the device. This crate and those below it (`base`, `gpu`, `scene`) are the engine.
//!
//! ```no_run
//! use insonify_gpu::{Device, DeviceOptions};
//! use insonify_scene::scene::Scene;
//! use insonify_sim::{Simulator, Tracer, shaders::Library};
//!
//! let (scene, _warnings) = Scene::load("scenes/abdomen.toml".as_ref(), &[])?;
//! let device = Device::new(&DeviceOptions::default())?;
//! let mut simulator = Simulator::new(&device, &Library::embedded(), &scene, Tracer::Bvh)?;
//! simulator.frame(&scene, 0)?;
//! let (width, height, rgba) = simulator.pixels()?;
//! image::save_buffer("abdomen.png", &rgba, width, height, image::ExtendedColorType::Rgba8)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

use insonify_base::output;
use insonify_gpu as gpu;
use insonify_scene::{probe, scene, settings, volume};

mod batches;
mod buffers;
pub mod bvh;
pub mod calibration;
pub mod colour;
pub mod contact;
pub mod dump;
mod echoes;
mod error;
mod expected;
pub mod facts;
pub mod fields;
pub mod fusion;
pub mod labels;
mod lane;
pub mod layout;
mod line;
pub mod lobe;
pub mod memory;
mod outputs;
mod packet;
pub mod pass;
mod pass_kernels;
mod passes;
pub mod placement;
mod pulses;
pub mod push;
mod read_out;
mod resize;
mod results;
pub mod rf;
pub mod rounds;
pub mod seen;
pub mod shaders;
mod sources;
pub mod special;
pub mod stages;
pub mod tables;
pub mod tracer;
pub mod trial;
mod upload;
pub mod view3d;
pub mod world;

// Tests here skip as those in tests/ do.
#[cfg(test)]
#[path = "../../tests/common/skip.rs"]
mod skip;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::gpu::{Abandon, AdapterKind, Device, FrameTimings, Frames, GpuError};
use crate::scene::Scene;
use crate::settings::Machine;
use batches::FrameBudget;
use bvh::Splits;
pub use colour::ColourMode;
pub use error::SimError;
use lane::Lane;
pub use lane::Shot;
use line::LineRange;
pub use memory::Memory;
use outputs::Last;
pub use outputs::Outputs;
pub use packet::{Correlation, Packet};
use pass_kernels::PassKernels;
use passes::Passes;
pub use resize::{beyond_some_devices, image_size};
use shaders::Library;
use sources::{Sources, TableCache};
use stages::{AXIAL, BEAM, CHART, DISPLAY, LABEL, LEVEL, SCATTER};
use tables::Tables;
pub use tracer::Tracer;
use upload::frame_constants;
use view3d::Viewer3d;
use world::World;

/// The kind of machine that a device is: a software driver on the processor, or a GPU.
pub fn machine(device: &Device) -> Machine {
    match device.info().kind {
        AdapterKind::Cpu => Machine::Software,
        _ => Machine::Gpu,
    }
}

/// A scene on the device, ready to be imaged frame by frame.
pub struct Simulator {
    device: Arc<Device>,
    submissions: Frames,
    passes: Passes,
    coincident: bool,
    sources: Sources,
    tables: Tables,
    table_cache: TableCache,
    counting: bool,
    last: Last,
    /// The kernel and buffers of the 3D view; made when it is first asked for.
    viewer3d: Option<Viewer3d>,
    update_time: Duration,
}

impl Simulator {
    /// Uploads `scene` and builds its acceleration structures for `tracer`.
    ///
    /// # Errors
    /// Device out of memory, a binding over the device's limit, geometry too deep for the tracer.
    pub fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        tracer: Tracer,
    ) -> Result<Self, SimError> {
        Self::with_splits(device, library, scene, tracer, Splits::default())
    }

    /// Like [`Self::new`], with trees of the compute tracer built as `splits` says.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn with_splits(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        tracer: Tracer,
        splits: Splits,
    ) -> Result<Self, SimError> {
        let shapers = Arc::new(world::ShapeKernels::new(device, library)?);
        let world = World::with_splits(device, &shapers, scene, tracer, splits)?;
        let coincident = scene.coincident_triangles() > 0;
        let budget = FrameBudget::of(device);
        let tables = Tables::new(scene);
        let constants = tables.frame(scene);
        let (frame, batches) = frame_constants(constants, &world, coincident, &budget, None);
        let lane =
            Lane::new(device, scene, stages::needed(scene), batches.sizes(&frame, &tables), None)?;
        let simulator = Self {
            device: Arc::clone(device),
            submissions: Frames::new(device, "frame")?,
            coincident,
            sources: Sources::of(scene),
            tables,
            table_cache: TableCache::default(),
            counting: false,
            last: Last::default(),
            viewer3d: None,
            update_time: Duration::ZERO,
            passes: Passes {
                kernels: PassKernels::new(
                    device,
                    library,
                    scene,
                    stages::of(scene),
                    &world,
                    false,
                )?,
                lanes: vec![lane],
                active: 1,
                skins: contact::Skins::default(),
                world,
                shown: frame,
                last: None,
                remembers: false,
                batches,
            },
        };
        simulator.upload_tables()?;
        Ok(simulator)
    }

    fn upload_tables(&self) -> Result<(), GpuError> {
        let buffers = &self.passes.lanes[0].buffers;
        let contents = tables::ARRAYS.map(|(array, content)| (array, content(&self.tables)));
        let filled = contents.into_iter().filter(|(_, bytes)| !bytes.is_empty());
        let arrays: Vec<_> = filled.map(|(array, bytes)| (&buffers[array], 0, bytes)).collect();
        self.device.upload_many(&arrays)
    }

    /// Simulates one frame of `scene` as it is now and returns the timings of the frames that have finished
    /// since the last call. `index` is the frame's number and selects the noise.
    /// Pose, placements and settings may differ from those of the frame before. Sizes (lines, samples, meshes,
    /// tissues, points, image, acquired volume; paths where each has segments of its own) must not exceed those
    /// at creation. A change of settings waits for the frames in flight.
    ///
    /// # Errors
    /// A Vulkan error; a lost device names the last pass.
    pub fn frame(&mut self, scene: &Scene, index: u32) -> Result<Vec<FrameTimings>, SimError> {
        self.frames(scene, &[Shot::of(scene, index)])
    }

    /// Simulates a frame of several images in one submission: of the scene as it is now, from the place and with the
    /// seed and number of each shot. Each is to the bit what [`Self::frame`] makes of it alone; labels say what has
    /// moved since the image before it. Else as [`Self::frame`]; [`Self::choose`] says which image is read.
    ///
    /// # Errors
    /// Those of [`Self::frame`]; device out of memory for as many images as [`Self::most_shots`] has not promised.
    ///
    /// # Panics
    /// Without shots.
    pub fn frames(&mut self, scene: &Scene, shots: &[Shot]) -> Result<Vec<FrameTimings>, SimError> {
        self.frames_into(scene, shots, &Outputs::default())
    }

    /// Like [`Self::frames`]; fills images with the first of them, too.
    ///
    /// # Errors
    /// Those of [`Self::frames`].
    ///
    /// # Panics
    /// Without shots.
    pub fn frames_into(
        &mut self,
        scene: &Scene,
        shots: &[Shot],
        outputs: &Outputs<'_>,
    ) -> Result<Vec<FrameTimings>, SimError> {
        self.make(scene, shots, None, outputs)
    }

    /// Makes images, or one line of them each. Levels are relative to the echo of a perfect mirror.
    fn make(
        &mut self,
        scene: &Scene,
        shots: &[Shot],
        line: Option<LineRange>,
        outputs: &Outputs<'_>,
    ) -> Result<Vec<FrameTimings>, SimError> {
        assert!(!shots.is_empty(), "a frame without images");
        let exchanged = self.adopt(scene)?;
        let labelled = scene.simulation.labels && line.is_none();
        let levelled = labelled && scene.simulation.levelled();
        let passes = &mut self.passes;
        // 1. Shapes, instance rows and the top level (mm, world), where something has moved.
        let mut cmd = self.submissions.begin()?;
        let updated = passes.update(&mut cmd, scene, &self.tables, self.coincident, shots, line)?;
        self.update_time = exchanged + updated;
        // 2. Coupled share of each element, 0..1.
        passes.touch(&mut cmd, scene, shots)?;
        let sizes = passes.batches.sizes(passes.frame(), &self.tables);
        passes.clear(&mut cmd, &sizes);
        // 3. Sums of echoes: complex, fixed point, what the way has weakened still to be taken off.
        passes.echoes(&mut cmd, push::Scatter::IMAGE, levelled)?;
        // 4. Lateral-smoothed complex baseband, with noise: level.
        passes.run(&mut cmd, &BEAM)?;
        // 5. IQ: level; log image: 0 black to 1 white.
        passes.run(&mut cmd, &AXIAL)?;
        // 6. The log image filtered. A line alone has too few beside it.
        if line.is_none() && scene.processing.is_on() {
            passes.enhance(&mut cmd, &scene.processing)?;
        }
        // From here on the frame is not abandoned, so that the picture is replaced as a whole.
        cmd.keep_on();
        // 7. RGBA, pixels of the picture's pitch (mm); of a frame that shows a volume at 9.
        let fusion = scene.fusion.as_ref().filter(|_| line.is_none() && scene.shows_volume());
        if fusion.is_none() {
            passes.run(&mut cmd, &DISPLAY)?;
        }
        let fused = fusion.is_some();
        self.last = Last { labelled, levelled, ..Last::default() };
        // 8. Labels of samples and pixels: indices, mm, dB (docs/labels.md).
        if labelled {
            passes.run(&mut cmd, &LABEL)?;
            if levelled {
                passes.surface_samples(&mut cmd)?;
                passes.run(&mut cmd, &LEVEL)?;
            }
            passes.run(&mut cmd, &CHART)?;
        }
        // 9. RGBA, mixed with the volume.
        if let Some(fusion) = fusion {
            passes.fuse(&mut cmd, fusion)?;
        }
        self.last.fused = fused;
        // 10. Copies for whoever shows them, and of what was read before.
        if let Some(image) = outputs.shown {
            cmd.copy_to_image(passes.lanes[0].pixels(fused), image)?;
        }
        if let (Some((image, tint)), true) = (outputs.tinted, fused) {
            let tinted = passes.tint(&mut cmd, &tint)?;
            cmd.copy_to_image(tinted, image)?;
            self.last.tinted = true;
        }
        if let (Some((image, opacity)), true) = (outputs.painted, labelled) {
            let painted = passes.paint(&mut cmd, scene, opacity, fused)?;
            cmd.copy_to_image(painted, image)?;
            self.last.painted = true;
        }
        passes.read_out(&mut cmd, &sizes)?;
        cmd.submit()?;
        if line.is_none() {
            passes.shown = *passes.frame();
        }
        Ok(self.submissions.take_timings())
    }

    /// Sets the question by which frames and 3D views may be abandoned: `wanted_no_longer` is asked now and
    /// then while they are recorded, and true means that something newer is wanted. They then fail with
    /// [`GpuError::Abandoned`], and the last picture stays. Where the window shares the queue, recording a
    /// frame takes about as long as the frame itself.
    pub fn abandon_when(&mut self, wanted_no_longer: Option<Abandon>) {
        self.submissions.abandon_when(wanted_no_longer);
    }

    /// Takes over settings, strategies and placements that the device does not have yet, after the
    /// frames in flight. Returns the time for structures that had to be built again.
    fn adopt(&mut self, scene: &Scene) -> Result<Duration, SimError> {
        let sources = Sources::of(scene);
        if sources != self.sources {
            // The tables carry scales and levels that belong to the frame's constants.
            self.submissions.wait()?;
            let tables = self.table_cache.take(&sources);
            let tables = tables.unwrap_or_else(|| Tables::new(scene));
            let left = std::mem::replace(&mut self.tables, tables);
            let before = std::mem::replace(&mut self.sources, sources);
            self.table_cache.put(before, left);
            // The others are made again when they are needed, with what the frame needs now.
            self.passes.lanes.truncate(1);
            (self.passes.active, self.last.chosen) = (1, 0);
            self.passes.lanes[0].buffers.add(&self.device, stages::needed(scene))?;
            self.upload_tables()?;
        }
        if self.passes.world.serves(scene) {
            return Ok(Duration::ZERO);
        }
        self.submissions.wait()?;
        let began = Instant::now();
        self.passes.world.exchange(&self.device, scene)?;
        Ok(began.elapsed())
    }

    /// True if the next frame of `scene` will wait for the driver's compiler, because its kernels have never run here.
    pub fn compiles(&self, scene: &Scene) -> bool {
        let longest = [&SCATTER].into_iter().chain(scene.simulation.labels.then_some(&LABEL));
        let tissue = self.passes.world.tissue();
        longest.into_iter().any(|pass| self.passes.kernels.of(pass, tissue).is_new())
    }

    /// Builds the pipelines again from `library`'s kernels, after the frames in flight.
    ///
    /// # Errors
    /// A kernel that the device refuses; the simulator keeps the ones that it had.
    pub fn reload(&mut self, library: &Library) -> Result<(), SimError> {
        self.submissions.wait()?;
        let shapers = world::ShapeKernels::new(&self.device, library)?;
        let world = &self.passes.world;
        let kernels = &self.passes.kernels;
        self.passes.kernels = kernels.again(&self.device, library, world, self.counting)?;
        self.viewer3d = None;
        self.passes.world.reload(shapers);
        Ok(())
    }

    /// Switches to the kernels of the compute tracer that count their steps (`node_visits` and the fields
    /// after it in [`Self::counters`]) if `counting`, else to those that do not. Counting makes rays slower.
    ///
    /// # Errors
    /// A kernel that the device refuses.
    ///
    /// # Panics
    /// With the ray query, whose steps cannot be counted.
    pub fn count(&mut self, library: &Library, counting: bool) -> Result<(), SimError> {
        assert_eq!(self.passes.world.tracer(), Tracer::Bvh, "what is counted");
        self.counting = counting;
        self.reload(library)
    }

    /// Processor time for recording the last frame's changes of the scene. Includes trees built for them, also
    /// those of instances that have left the group with which they shared a structure.
    pub fn update_time(&self) -> Duration {
        self.update_time
    }

    /// Waits for the frames in flight and returns their timings, oldest first.
    ///
    /// # Errors
    /// A lost device, with the last pass that had begun.
    pub fn wait(&mut self) -> Result<Vec<FrameTimings>, SimError> {
        self.submissions.wait()?;
        Ok(self.submissions.take_timings())
    }

    /// The constants of the chosen image of the last frame.
    pub fn constants(&self) -> &layout::Frame {
        &self.lane().frame
    }

    /// The tables as they are on the device.
    pub fn tables(&self) -> &Tables {
        &self.tables
    }
}
