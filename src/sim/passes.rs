//! Records the stages of a frame, each with its bindings and the barrier behind it.

use std::cmp::Reverse;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::batches::{Batches, FrameBudget};
use super::contact::{self, Coupling, Skins};
use super::lane::{Lane, Shot};
use super::layout::{self, ROLE_BRANCHES};
use super::line::OneLine;
use super::pass::{Extent, Pass, Sizes, Variants};
use super::shaders::Library;
use super::stages::{self, APERTURE, EXPECT, ORIGIN, SCATTER, TRACE, aperture, scatter};
use super::tables::Tables;
use super::{SimError, World};
use crate::gpu::{Binding, Buffer, Commands, Device, GpuError, Kernel, Stage};
use crate::scene::Scene;

/// For a lane, the buffers that a dispatch binds instead of those of the same names.
pub(super) type Instead<'g> = &'g dyn Fn(&Lane) -> Vec<(&'static str, &Buffer)>;

/// The kernels, buffers and geometry on which the stages work.
pub(super) struct Passes {
    pub(super) kernels: PassKernels,
    /// At least one.
    pub(super) lanes: Vec<Lane>,
    /// Lanes of the last frame: the first ones.
    pub(super) active: usize,
    pub(super) skins: Skins,
    pub(super) world: World,
    /// Constants of the last complete picture.
    pub(super) shown: layout::Frame,
    /// Constants of the last image: what labels say has moved has moved since then.
    pub(super) last: Option<layout::Frame>,
    /// True if the anatomy of the last image was kept for labels, and lines were made since.
    pub(super) remembers: bool,
    /// Those of all lanes.
    pub(super) batches: Batches,
}

impl Passes {
    /// The lanes of the last frame.
    pub(super) fn active(&self) -> &[Lane] {
        &self.lanes[..self.active]
    }

    /// Constants of the last frame's first image. Others differ from it only by what a [`Shot`] says.
    pub(super) fn frame(&self) -> &layout::Frame {
        &self.lanes[0].frame
    }

    /// Brings the device up to date with `scene` and as many lanes as there are shots; returns the processor time for
    /// it.
    pub(super) fn update(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        tables: &Tables,
        coincident: bool,
        shots: &[Shot],
        line: Option<OneLine>,
    ) -> Result<Duration, SimError> {
        cmd.scope("update");
        let began = Instant::now();
        let labelled = scene.simulation.labels;
        self.lanes[0].buffers.add(cmd.device(), stages::needed(scene))?;
        while self.lanes.len() < shots.len() {
            self.lanes.push(self.lanes[0].beside(cmd.device(), scene)?);
        }
        self.active = shots.len();
        if labelled && self.last.is_some() && !self.remembers {
            self.world.remember(cmd)?;
        }
        // Labels say what has moved since the last image, whatever lines were made between.
        self.remembers = labelled && line.is_some();
        self.world.update(cmd, scene)?;
        // A frame of fewer lines than the buffers were made for must not want more room.
        let buffers = &self.lanes[0].buffers;
        let budget = FrameBudget {
            segments: buffers["segments"].size(),
            at_once: self.batches.rounds.at_once,
            main_paths: buffers.room().main_paths,
        };
        let frame;
        (frame, self.batches) =
            frame_constants(tables.frame(scene), &self.world, coincident, &budget, line.as_ref());
        if labelled && self.last.is_none() {
            self.world.remember(cmd)?;
        }
        for (lane, shot) in self.lanes.iter_mut().zip(shots) {
            let frame = shot.constants(&frame);
            lane.set(cmd, frame, tables)?;
            if line.is_some() {
                continue;
            }
            // What the last image was made of, where labels say what has moved since; for the first one its own.
            let last = self.last.replace(frame).unwrap_or(frame);
            if labelled {
                cmd.write(&lane.buffers["frame_before"], 0, bytemuck::bytes_of(&last))?;
            }
            if let Some(fusion) = &mut lane.fusion {
                fusion.update(cmd, scene, &lane.buffers)?;
            }
        }
        Ok(began.elapsed())
    }

    /// Computes which elements of the probe's face are coupled to the skin, and writes them to the device.
    pub(super) fn touch(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        shots: &[Shot],
    ) -> Result<(), GpuError> {
        for (lane, shot) in self.lanes.iter_mut().zip(shots) {
            let coupling = Coupling::at(scene, &shot.world_from_probe, &mut self.skins);
            let shares = contact::table(scene, coupling.as_ref());
            cmd.write(&lane.buffers["contact"], 0, bytemuck::cast_slice(&shares))?;
            lane.touch = coupling.map(|coupling| coupling.touch);
        }
        Ok(())
    }

    pub(super) fn clear(&self, cmd: &mut Commands, sizes: &Sizes) {
        self.active().iter().for_each(|lane| lane.buffers.clear(cmd, sizes));
        cmd.barrier(Stage::Transfer, Stage::Compute);
    }

    /// Records a pass with the threads and buffers that it states.
    pub(super) fn run(&self, cmd: &mut Commands, pass: &Pass) -> Result<(), GpuError> {
        self.run_with(cmd, pass, &|_| Vec::new())
    }

    /// Like [`Self::run`], with other buffers.
    pub(super) fn run_with(
        &self,
        cmd: &mut Commands,
        pass: &Pass,
        instead: Instead<'_>,
    ) -> Result<(), GpuError> {
        cmd.scope(pass.name);
        let extent = pass.extent.expect("a pass recorded this way states its extent");
        self.record(cmd, pass, extent(self.frame()), &[], instead)
    }

    /// Records a dispatch of a pass for every lane, and the barrier behind all of them.
    pub(super) fn record(
        &self,
        cmd: &mut Commands,
        pass: &Pass,
        extent: Extent,
        push: &[u8],
        instead: Instead<'_>,
    ) -> Result<(), GpuError> {
        let kernel = self.kernels.of(pass, self.world.deforms());
        // By number: what a kernel declares and does not use is not in its SPIR-V.
        let binds = kernel.bindings().iter().map(|info| pass.binds[info.binding as usize]);
        let binds: Vec<&str> = binds.collect();
        for lane in self.active() {
            let given = instead(lane);
            let bound = binds.iter().map(|name| self.binding(lane, name, &given));
            let bindings: Vec<Binding> = bound.collect();
            match extent {
                Extent::Threads(threads) => cmd.dispatch(kernel, threads, push, &bindings)?,
                Extent::Groups(groups) => cmd.dispatch_groups(kernel, groups, push, &bindings)?,
            }
        }
        cmd.barrier(Stage::Compute, pass.then);
        Ok(())
    }

    fn binding<'a>(
        &'a self,
        lane: &'a Lane,
        name: &str,
        given: &[(&str, &'a Buffer)],
    ) -> Binding<'a> {
        if let Some((_, buffer)) = given.iter().find(|(of, _)| *of == name) {
            return Binding::Buffer(buffer);
        }
        match (name, &lane.fusion) {
            ("acquired", Some(fusion)) => Binding::Image(fusion.shown()),
            _ => self.world.binding(name).unwrap_or_else(|| Binding::Buffer(&lane.buffers[name])),
        }
    }

    pub(super) fn loses_by_aperture(&self) -> bool {
        self.frame().flags & layout::FLAG_APERTURE != 0
    }

    /// Records the echoes of all paths, batch after batch, and for labels of levels what is expected of them.
    pub(super) fn echoes(&self, cmd: &mut Commands, levelled: bool) -> Result<(), GpuError> {
        self.run(cmd, &ORIGIN)?;
        let mut turn = 0;
        for begin in (0..self.frame().paths).step_by(self.batches.paths as usize) {
            self.trace(cmd, begin, &mut turn)?;
            cmd.scope(SCATTER.name);
            let [threads, ..] = self.kernels.of(&SCATTER, self.world.deforms()).local_size();
            let groups = scatter::extent(self.frame(), self.batches.rounds.at_once / threads);
            self.record(cmd, &SCATTER, groups, &[], &|_| Vec::new())?;
            if levelled {
                self.run(cmd, &EXPECT)?;
            }
        }
        match levelled {
            true => self.direct_echoes(cmd),
            false => Ok(()),
        }
    }

    /// Records what the aperture lets through, of `apertures` or what is bound instead.
    pub(super) fn converge(
        &self,
        cmd: &mut Commands,
        instead: Instead<'_>,
    ) -> Result<(), GpuError> {
        cmd.scope(APERTURE.name);
        let [threads, ..] = self.kernels.of(&APERTURE, self.world.deforms()).local_size();
        let groups = aperture::extent(self.frame(), self.batches.rounds.at_once / threads);
        self.record(cmd, &APERTURE, groups, &[], instead)
    }

    /// Traces a batch of paths; `turn` is that of [`super::rounds::Rounds::of`].
    fn trace(&self, cmd: &mut Commands, path_begin: u32, turn: &mut u32) -> Result<(), GpuError> {
        if path_begin > 0 {
            cmd.barrier(Stage::Compute, Stage::Transfer);
            self.active().iter().for_each(|lane| cmd.fill(&lane.buffers["segment_count"], 0));
            cmd.barrier(Stage::Transfer, Stage::Compute);
        }
        let path_end = self.frame().paths.min(path_begin + self.batches.paths);
        cmd.scope("trace");
        let mut converges = self.loses_by_aperture();
        for round in self.batches.rounds.of(self.frame(), path_begin..path_end, turn) {
            // Behind the main paths of all lines, in front of what echoes there.
            if converges && round.role == ROLE_BRANCHES {
                self.converge(cmd, &|_| Vec::new())?;
                cmd.scope("trace");
                converges = false;
            }
            let threads = Extent::Threads(round.threads());
            let push = bytemuck::cast_slice(&round.push);
            self.record(cmd, &TRACE[round.role as usize], threads, push, &|_| Vec::new())?;
        }
        Ok(())
    }

    /// Records copies of results of a frame of these sizes that were read of the frame before.
    pub(super) fn read_out(&mut self, cmd: &mut Commands, sizes: &Sizes) -> Result<(), GpuError> {
        // Stages of labels may have been the last to write.
        cmd.barrier(Stage::Compute, Stage::Transfer);
        for lane in &mut self.lanes[..self.active] {
            lane.read_out.record(cmd, &lane.buffers, sizes)?;
        }
        cmd.barrier(Stage::Transfer, Stage::Host);
        Ok(())
    }
}

/// The kernels of the passes that frames of a scene may run.
pub(super) struct PassKernels(Vec<PassKernel>);

struct PassKernel {
    pass: &'static Pass,
    kernel: Kernel,
    /// The variant for deforming tissue, where there is one: a mesh that a program reshapes begins to deform.
    deforming: Option<Kernel>,
    /// True if the frames that the scene began with run it.
    needed: bool,
}

impl PassKernel {
    fn of(&self, deforms: bool) -> &Kernel {
        self.deforming.as_ref().filter(|_| deforms).unwrap_or(&self.kernel)
    }
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
                Variants::Tissue => Some("rigid"),
            };
            let kernel = |suffix: Option<&str>| {
                let stem =
                    suffix.map_or(pass.name.into(), |suffix| format!("{}_{suffix}", pass.name));
                Kernel::when_needed(device, &stem, library.words(&stem), pass.constants)
            };
            let deforming = match pass.variants {
                Variants::Tissue => Some(kernel(Some("deforming"))?),
                _ => None,
            };
            kernels.push(PassKernel { pass, kernel: kernel(suffix)?, deforming, needed });
        }
        let deforms = world.deforms();
        // The kernels that take longest to compile begin first.
        let due = kernels.iter().filter(|made| made.needed);
        let mut due: Vec<_> = due.map(|made| made.of(deforms)).collect();
        due.sort_by_key(|kernel| Reverse(library.words(kernel.name()).len()));
        due.iter().for_each(|kernel| kernel.prepare());
        Ok(Self(kernels))
    }

    /// The kernel of a pass, for a world whose tissue deforms or one whose tissue does not.
    pub(super) fn of(&self, pass: &Pass, deforms: bool) -> &Kernel {
        let is = |made: &&PassKernel| {
            made.pass.name == pass.name && made.pass.constants == pass.constants
        };
        self.0.iter().find(is).expect("a pass of the scene").of(deforms)
    }
}

/// A frame's constants with those that depend on the world and on the room for segments.
pub(super) fn frame_constants(
    mut frame: layout::Frame,
    world: &World,
    coincident: bool,
    budget: &FrameBudget,
    line: Option<&OneLine>,
) -> (layout::Frame, Batches) {
    if let Some(line) = line {
        line.narrow(&mut frame);
    }
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
