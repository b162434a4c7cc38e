//! The frame: scene and probe to B-mode image on the device.

mod batches;
mod buffers;
pub mod bvh;
pub mod calibration;
pub mod contact;
pub mod dump;
mod expected;
pub mod facts;
pub mod fields;
pub mod fusion;
pub mod labels;
pub mod layout;
pub mod memory;
pub mod pass;
mod passes;
pub mod placement;
mod read_out;
mod resize;
mod results;
mod rf;
pub mod rounds;
pub mod shaders;
pub mod special;
pub mod stages;
pub mod tables;
pub mod tracer;
pub mod view3d;
pub mod world;

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::gpu::{Abandon, AdapterKind, Device, FrameTimings, Frames, GpuError, Image};
use crate::scene::{Scene, Surface, Tissue, Wire};
use crate::settings::{Machine, Settings};
use batches::FrameBudget;
use buffers::Buffers;
use bvh::Splits;
use contact::SkinContact;
use fusion::{FusionResources, Tint};
pub use memory::Memory;
use passes::{PassKernels, Passes, frame_constants};
use read_out::ReadOut;
pub use resize::image_size;
use shaders::Library;
use stages::{AXIAL, BEAM, CHART, DISPLAY, EXPECT, LABEL, LEVEL, ORIGIN, SCATTER};
use tables::Tables;
pub use tracer::Tracer;
use view3d::Viewer3d;
use world::World;

/// Why a scene cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The Vulkan layer failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The geometry does not fit the tracer.
    #[error(transparent)]
    World(#[from] world::WorldError),
}

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
    frames: Frames,
    passes: Passes,
    coincident: bool,
    sources: Sources,
    tables: Tables,
    table_cache: TableCache,
    counting: bool,
    /// True if the last frame was mixed with an acquired volume.
    fused: bool,
    /// True if the last frame has labels.
    labelled: bool,
    /// The image into which the next frames are copied.
    shown_on: Option<Image>,
    /// The kernel and buffers of the 3D view; made when it is first asked for.
    viewer3d: Option<Viewer3d>,
    tinted_on: Option<(Image, Tint)>,
    read_out: ReadOut,
    update_time: Duration,
}

/// Tables of settings used before, kept because settings come back: live quality changes between levels.
#[derive(Default)]
struct TableCache(Vec<(Sources, Tables)>);

impl TableCache {
    /// Most tables kept: more than there are levels of quality.
    const MOST: usize = 12;

    fn take(&mut self, sources: &Sources) -> Option<Tables> {
        let at = self.0.iter().position(|(made_of, _)| made_of == sources)?;
        Some(self.0.remove(at).1)
    }

    fn put(&mut self, sources: Sources, tables: Tables) {
        if self.0.len() == Self::MOST {
            self.0.remove(0);
        }
        self.0.push((sources, tables));
    }
}

/// The settings from which the tables on the device were made.
#[derive(PartialEq)]
struct Sources {
    settings: Settings,
    tissues: Vec<Tissue>,
    surfaces: Vec<[Surface; 2]>,
    wires: Vec<Wire>,
}

impl Sources {
    fn of(scene: &Scene) -> Self {
        Self {
            settings: scene.settings.clone(),
            tissues: scene.tissues.clone(),
            surfaces: scene.instances.iter().map(|i| i.surface).collect(),
            wires: scene.wires.clone(),
        }
    }
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
        let (frame, batches) = frame_constants(scene, &world, coincident, 0, &budget);
        let tables = Tables::new(scene);
        let buffers = Buffers::new(device, scene, batches.sizes(&frame, &tables))?;
        let fusion = FusionResources::new(device, scene, None)?;
        let simulator = Self {
            device: Arc::clone(device),
            frames: Frames::new(device, "frame")?,
            coincident,
            sources: Sources::of(scene),
            tables,
            table_cache: TableCache::default(),
            counting: false,
            fused: false,
            labelled: false,
            shown_on: None,
            viewer3d: None,
            tinted_on: None,
            read_out: ReadOut::default(),
            update_time: Duration::ZERO,
            passes: Passes {
                kernels: PassKernels::new(device, library, scene, &world, false)?,
                buffers,
                fusion,
                skins: contact::Skins::default(),
                touch: None,
                world,
                frame,
                shown: frame,
                began: false,
                batches,
            },
        };
        simulator.upload_tables()?;
        Ok(simulator)
    }

    fn upload_tables(&self) -> Result<(), GpuError> {
        let buffers = &self.passes.buffers;
        let arrays = self.tables.arrays().into_iter().filter(|(_, bytes)| !bytes.is_empty());
        let arrays: Vec<_> = arrays.map(|(name, bytes)| (&buffers[name], 0, bytes)).collect();
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
        let exchanged = self.adopt(scene)?;
        let labelled = scene.simulation.labels;
        let passes = &mut self.passes;
        let mut cmd = self.frames.begin()?;
        self.update_time = exchanged + passes.update(&mut cmd, scene, self.coincident, index)?;
        passes.touch(&mut cmd, scene)?;
        passes.clear(&mut cmd);
        passes.run(&mut cmd, &ORIGIN)?;
        let mut turn = 0;
        for begin in (0..passes.frame.paths).step_by(passes.batches.paths as usize) {
            passes.trace(&mut cmd, begin, &mut turn)?;
            passes.run(&mut cmd, &SCATTER)?;
            if labelled {
                passes.run(&mut cmd, &EXPECT)?;
            }
        }
        if labelled {
            passes.direct_echoes(&mut cmd)?;
        }
        passes.run(&mut cmd, &BEAM)?;
        passes.run(&mut cmd, &AXIAL)?;
        // From here on the frame is not abandoned, so that the picture is replaced as a whole.
        cmd.keep_on();
        passes.run(&mut cmd, &DISPLAY)?;
        self.labelled = labelled;
        if labelled {
            passes.run(&mut cmd, &LABEL)?;
            passes.surface_samples(&mut cmd)?;
            passes.run(&mut cmd, &LEVEL)?;
            passes.run(&mut cmd, &CHART)?;
        }
        self.fused = scene.shows_volume() && passes.fuse(&mut cmd, scene)?;
        if let Some(image) = &self.shown_on {
            cmd.copy_to_image(passes.pixels(self.fused), image)?;
        }
        if let (Some((image, tint)), true) = (&self.tinted_on, self.fused) {
            let tinted = passes.tint(&mut cmd, tint)?;
            cmd.copy_to_image(tinted, image)?;
        }
        self.read_out.record(&mut cmd, passes.pixels(self.fused))?;
        cmd.submit()?;
        passes.shown = passes.frame;
        Ok(self.frames.take_timings())
    }

    /// Sets the question by which frames and 3D views may be abandoned: `wanted_no_longer` is asked now and
    /// then while they are recorded, and true means that something newer is wanted. They then fail with
    /// [`GpuError::Abandoned`], and the last picture stays. Where the window shares the queue, recording a
    /// frame takes about as long as the frame itself.
    pub fn abandon_when(&mut self, wanted_no_longer: Option<Abandon>) {
        self.frames.abandon_when(wanted_no_longer);
    }

    /// Takes over settings, strategies and placements that the device does not have yet, after the
    /// frames in flight. Returns the time for structures that had to be built again.
    fn adopt(&mut self, scene: &Scene) -> Result<Duration, SimError> {
        let sources = Sources::of(scene);
        if sources != self.sources {
            // The tables carry scales and levels that belong to the frame's constants.
            self.frames.wait()?;
            let tables = self.table_cache.take(&sources);
            let tables = tables.unwrap_or_else(|| Tables::new(scene));
            let left = std::mem::replace(&mut self.tables, tables);
            let before = std::mem::replace(&mut self.sources, sources);
            self.table_cache.put(before, left);
            self.passes.buffers.add(&self.device, stages::needed(scene))?;
            self.upload_tables()?;
        }
        if self.passes.world.serves(scene) {
            return Ok(Duration::ZERO);
        }
        self.frames.wait()?;
        let began = Instant::now();
        self.passes.world.exchange(&self.device, scene)?;
        Ok(began.elapsed())
    }

    /// True if the first frame will wait for the driver's compiler, because its kernels have never run here.
    pub fn compiles(&self) -> bool {
        self.passes.kernels.of(&SCATTER).is_new()
    }

    /// Builds the pipelines again from `library`'s kernels, after the frames in flight.
    ///
    /// # Errors
    /// A kernel that the device refuses; the simulator keeps the ones that it had.
    pub fn reload(&mut self, library: &Library) -> Result<(), SimError> {
        self.frames.wait()?;
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

    /// The contact of the probe with the skin in the last frame; none where the scene asks for no contact.
    pub fn contact(&self) -> Option<SkinContact> {
        self.passes.touch
    }

    /// The device memory that the scene takes.
    pub fn memory(&self) -> Memory {
        let fusion = self.passes.fusion.as_ref();
        Memory {
            volume: fusion.map_or(0, FusionResources::volume_bytes),
            ..self.passes.world.memory()
        }
    }

    /// Waits for the frames in flight and returns their timings, oldest first.
    ///
    /// # Errors
    /// A lost device, with the last pass that had begun.
    pub fn wait(&mut self) -> Result<Vec<FrameTimings>, SimError> {
        self.frames.wait()?;
        Ok(self.frames.take_timings())
    }

    /// The constants of the last frame.
    pub fn constants(&self) -> &layout::Frame {
        &self.passes.frame
    }

    /// The tables as they are on the device.
    pub fn tables(&self) -> &Tables {
        &self.tables
    }

    /// The B-mode image of the last frame: width, height, RGBA bytes row by row; transparent outside
    /// the sector.
    ///
    /// # Errors
    /// A Vulkan error.
    pub fn pixels(&mut self) -> Result<(u32, u32, Vec<u8>), SimError> {
        let (width, height) = (self.passes.frame.image_width, self.passes.frame.image_height);
        let mut bytes = vec![0; 4 * width as usize * height as usize];
        match self.read_out.take() {
            Some(copy) => self.frames.read(copy, &mut bytes)?,
            None => {
                self.frames.wait()?;
                let pixels = self.passes.pixels(self.fused);
                self.device.read_into(pixels, 0, &mut bytes)?;
            }
        }
        Ok((width, height, bytes))
    }

    /// A warning for the user about how the scene was uploaded, if there is one.
    pub fn warning(&self) -> Option<&str> {
        self.passes.fusion.as_ref().and_then(FusionResources::warning)
    }
}
