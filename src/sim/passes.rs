//! Records the stages of a frame, each with its bindings and the barrier behind it.

use std::cmp::Reverse;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::batches::{Batches, FrameBudget};
use super::buffers::Buffers;
use super::contact::{self, Coupling, SkinContact, Skins};
use super::fusion::FusionResources;
use super::pass::{Extent, Pass, Variants};
use super::shaders::Library;
use super::stages::{self, CONVERT, DARKEN, FUSE, MASK, SHADOW, TRACE};
use super::{SimError, World, layout, tables};
use crate::gpu::{Binding, Buffer, Commands, Device, GpuError, Kernel, Stage};
use crate::scene::Scene;
use crate::settings::Blend;

/// The kernels, buffers and geometry on which the stages work.
pub(super) struct Passes {
    pub(super) kernels: PassKernels,
    pub(super) buffers: Buffers,
    /// None where the scene has no acquired volume.
    pub(super) fusion: Option<FusionResources>,
    pub(super) skins: Skins,
    /// The contact of the probe with the skin in the last frame.
    pub(super) touch: Option<SkinContact>,
    pub(super) world: World,
    pub(super) frame: layout::Frame,
    /// Constants of the frame whose picture is complete.
    pub(super) shown: layout::Frame,
    /// True if a frame has been made: what labels say has moved has moved since the last one.
    pub(super) began: bool,
    pub(super) batches: Batches,
}

impl Passes {
    /// Brings the device up to date with `scene`; returns the processor time for it.
    pub(super) fn update(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        coincident: bool,
        index: u32,
    ) -> Result<Duration, SimError> {
        cmd.scope("update");
        let began = Instant::now();
        self.buffers.add(cmd.device(), stages::needed(scene))?;
        if self.began {
            self.remember(cmd, scene)?;
        }
        self.world.update(cmd, scene)?;
        // A frame of fewer lines than the buffers were made for must not want more segments.
        let budget = FrameBudget {
            segments: self.buffers["segments"].size(),
            at_once: self.batches.rounds.at_once,
        };
        (self.frame, self.batches) =
            frame_constants(scene, &self.world, coincident, index, &budget);
        if !self.began {
            self.remember(cmd, scene)?;
            self.began = true;
        }
        cmd.write(&self.buffers["frame"], 0, bytemuck::bytes_of(&self.frame))?;
        if let Some(fusion) = &mut self.fusion {
            fusion.update(cmd, scene, &self.buffers)?;
        }
        Ok(began.elapsed())
    }

    /// Keeps what the last frame was made of, where labels say what has moved since; of the first frame its own.
    fn remember(&mut self, cmd: &mut Commands, scene: &Scene) -> Result<(), GpuError> {
        if scene.simulation.labels {
            self.world.remember(cmd)?;
            cmd.write(&self.buffers["frame_before"], 0, bytemuck::bytes_of(&self.frame))?;
        }
        Ok(())
    }

    /// Computes which elements of the probe's face are coupled to the skin, and writes them to the device.
    pub(super) fn touch(&mut self, cmd: &mut Commands, scene: &Scene) -> Result<(), GpuError> {
        let coupling = Coupling::of(scene, &mut self.skins);
        let shares = contact::table(scene, coupling.as_ref());
        cmd.write(&self.buffers["contact"], 0, bytemuck::cast_slice(&shares))?;
        self.touch = coupling.map(|coupling| coupling.touch);
        Ok(())
    }

    pub(super) fn clear(&self, cmd: &mut Commands) {
        self.buffers.clear(cmd);
        cmd.barrier(Stage::Transfer, Stage::Compute);
    }

    /// Records a pass with the threads and buffers that it states.
    pub(super) fn run(&self, cmd: &mut Commands, pass: &Pass) -> Result<(), GpuError> {
        self.run_with(cmd, pass, &[])
    }

    /// Like [`Self::run`], with the buffers `given` instead of those of the same names.
    pub(super) fn run_with(
        &self,
        cmd: &mut Commands,
        pass: &Pass,
        given: &[(&str, &Buffer)],
    ) -> Result<(), GpuError> {
        cmd.scope(pass.name);
        let extent = pass.extent.expect("a pass recorded this way states its extent");
        self.record(cmd, pass, extent(&self.frame), &[], given)
    }

    /// Records a dispatch of a pass and the barrier behind it; `given` as for [`Self::run_with`].
    pub(super) fn record(
        &self,
        cmd: &mut Commands,
        pass: &Pass,
        extent: Extent,
        push: &[u8],
        given: &[(&str, &Buffer)],
    ) -> Result<(), GpuError> {
        let kernel = self.kernels.of(pass);
        // By number: what a kernel declares and does not use is not in its SPIR-V.
        let binds = kernel.bindings().iter().map(|info| pass.binds[info.binding as usize]);
        let bindings: Vec<Binding> = binds.map(|name| self.binding(name, given)).collect();
        match extent {
            Extent::Threads(threads) => cmd.dispatch(kernel, threads, push, &bindings)?,
            Extent::Groups(groups) => cmd.dispatch_groups(kernel, groups, push, &bindings)?,
        }
        cmd.barrier(Stage::Compute, pass.then);
        Ok(())
    }

    fn binding<'a>(&'a self, name: &str, given: &[(&str, &'a Buffer)]) -> Binding<'a> {
        if let Some((_, buffer)) = given.iter().find(|(of, _)| *of == name) {
            return Binding::Buffer(buffer);
        }
        match (name, &self.fusion) {
            ("acquired", Some(fusion)) => Binding::Image(fusion.shown()),
            _ => self.world.binding(name).unwrap_or_else(|| Binding::Buffer(&self.buffers[name])),
        }
    }

    /// Traces a batch of paths; `turn` is that of [`super::rounds::Rounds::of`].
    pub(super) fn trace(
        &self,
        cmd: &mut Commands,
        path_begin: u32,
        turn: &mut u32,
    ) -> Result<(), GpuError> {
        if path_begin > 0 {
            cmd.barrier(Stage::Compute, Stage::Transfer);
            cmd.fill(&self.buffers["segment_count"], 0);
            cmd.barrier(Stage::Transfer, Stage::Compute);
        }
        let path_end = self.frame.paths.min(path_begin + self.batches.paths);
        cmd.scope("trace");
        for round in self.batches.rounds.of(&self.frame, path_begin..path_end, turn) {
            let threads = Extent::Threads([round.workers, 1, 1]);
            let push = bytemuck::cast_slice(&round.push);
            self.record(cmd, &TRACE[round.role as usize], threads, push, &[])?;
        }
        Ok(())
    }

    /// Mixes the image with the acquired volume, if there is one.
    pub(super) fn fuse(&self, cmd: &mut Commands, scene: &Scene) -> Result<bool, GpuError> {
        let (Some(fused), Some(fusion)) = (&self.fusion, &scene.fusion) else {
            return Ok(false);
        };
        // The output of `display` is read by kernels here, not only copied.
        cmd.barrier(Stage::Compute, Stage::Compute);
        self.run(cmd, &MASK)?;
        let mut prescan = &self.buffers["prescan"];
        if fusion.background_shadows {
            self.run(cmd, &SHADOW)?;
            self.run(cmd, &DARKEN)?;
            prescan = &self.buffers["shaded"];
        }
        self.run_with(cmd, &CONVERT, &[("prescan", prescan)])?;
        // Without blending by bands, the kernel binds any buffer as `change` and does not read it.
        let mut change = &self.buffers["background"];
        match fusion.blend {
            Blend::Multiband => {
                self.bands(cmd, &fused.pyramid, fusion.levels())?;
                change = fused.pyramid.change();
            }
            Blend::Linear | Blend::Smooth => self.blur(cmd)?,
        }
        self.run_with(cmd, &FUSE, &[("change", change)])?;
        Ok(true)
    }

    /// The finished image.
    pub(super) fn pixels(&self, fused: bool) -> &Buffer {
        &self.buffers[if fused { "fused" } else { "pixels" }]
    }
}

/// The kernels of the passes that frames of a scene may run.
pub(super) struct PassKernels(Vec<PassKernel>);

struct PassKernel {
    pass: &'static Pass,
    kernel: Kernel,
    /// True if the frames that the scene began with run it.
    needed: bool,
}

impl PassKernels {
    pub(super) fn new(
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let passes = stages::of(scene).map(|pass| (pass, (pass.needed)(scene)));
        Self::of_passes(device, library, passes, world, counting)
    }

    /// The same kernels from another library, in the variants that count steps if `counting`.
    pub(super) fn again(
        &self,
        device: &Arc<Device>,
        library: &Library,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let passes = self.0.iter().map(|made| (made.pass, made.needed));
        Self::of_passes(device, library, passes, world, counting)
    }

    fn of_passes(
        device: &Arc<Device>,
        library: &Library,
        passes: impl Iterator<Item = (&'static Pass, bool)>,
        world: &World,
        counting: bool,
    ) -> Result<Self, GpuError> {
        let mut kernels = Vec::new();
        for (pass, needed) in passes {
            let tracer = world.tracer().suffix();
            let suffix = match pass.variants {
                Variants::One => None,
                Variants::Counting if counting => Some("count"),
                Variants::Tracer | Variants::Counting => Some(tracer),
                Variants::Tissue if world.deforms() => Some("deforming"),
                Variants::Tissue => Some("rigid"),
            };
            let stem = suffix.map_or(pass.name.into(), |suffix| format!("{}_{suffix}", pass.name));
            let kernel = Kernel::when_needed(device, &stem, library.words(&stem), pass.constants)?;
            kernels.push(PassKernel { pass, kernel, needed });
        }
        // The kernels that take longest to compile begin first.
        let mut due: Vec<_> = kernels.iter().filter(|made| made.needed).collect();
        due.sort_by_key(|made| Reverse(library.words(made.kernel.name()).len()));
        due.iter().for_each(|made| made.kernel.prepare());
        Ok(Self(kernels))
    }

    pub(super) fn of(&self, pass: &Pass) -> &Kernel {
        let is = |made: &&PassKernel| {
            made.pass.name == pass.name && made.pass.constants == pass.constants
        };
        &self.0.iter().find(is).expect("a pass of the scene").kernel
    }
}

/// The frame's constants, including those that depend on the world and on the room for segments.
pub(super) fn frame_constants(
    scene: &Scene,
    world: &World,
    coincident: bool,
    index: u32,
    budget: &FrameBudget,
) -> (layout::Frame, Batches) {
    let mut frame = tables::frame(scene, index);
    if coincident {
        frame.flags |= layout::FLAG_COINCIDENT;
    }
    let (ray_mask, ambiguous) = world.ray_mask();
    frame.ray_mask = ray_mask;
    if ambiguous {
        frame.flags |= layout::FLAG_SLOTS;
    }
    let batches = Batches::new(&frame, budget);
    frame.segment_capacity = batches.capacity;
    (frame, batches)
}
