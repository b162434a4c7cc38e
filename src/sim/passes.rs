//! The stages of a frame, each recorded with its bindings and the barrier behind it.

use std::time::{Duration, Instant};

use super::contact::{self, Coupling, Skins, Touch};
use super::fusion::{Fused, Simulated, Tint};
use super::stages::{Batches, Buffers, Kernels, Room, lines};
use super::{SimError, World, layout, tables};
use crate::gpu::{Binding, Buffer, Commands, GpuError, Kernel, Stage};
use crate::scene::Scene;

/// What the stages work on.
pub(super) struct Passes {
    pub(super) kernels: Kernels,
    pub(super) buffers: Buffers,
    /// Where the scene has an acquired volume.
    pub(super) fusion: Option<Fused>,
    pub(super) skins: Skins,
    /// How the probe touched the skin in the last frame.
    pub(super) touch: Option<Touch>,
    pub(super) world: World,
    pub(super) frame: layout::Frame,
    /// Those of the picture that there is.
    pub(super) shown: layout::Frame,
    pub(super) batches: Batches,
}

impl Passes {
    /// Brings the device up to date with `scene`; what the processor took for it.
    pub(super) fn update(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        coincident: bool,
        index: u32,
    ) -> Result<Duration, SimError> {
        cmd.scope("update");
        let began = Instant::now();
        self.world.update(cmd, scene)?;
        // A frame of fewer lines than the buffers were made for must not want more segments.
        let room =
            Room { segments: self.buffers.segments.size(), at_once: self.batches.rounds.at_once };
        (self.frame, self.batches) = frame_constants(scene, &self.world, coincident, index, &room);
        cmd.write(&self.buffers.frame, 0, bytemuck::bytes_of(&self.frame))?;
        if let Some(fusion) = &mut self.fusion {
            fusion.update(cmd, scene)?;
        }
        Ok(began.elapsed())
    }

    /// Holds the probe's face against the skin: which of its elements are coupled.
    pub(super) fn touch(&mut self, cmd: &mut Commands, scene: &Scene) -> Result<(), GpuError> {
        let coupling = Coupling::of(scene, &mut self.skins);
        let shares = contact::table(scene, coupling.as_ref());
        cmd.write(&self.buffers.contact, 0, bytemuck::cast_slice(&shares))?;
        self.touch = coupling.map(|coupling| coupling.touch);
        Ok(())
    }

    pub(super) fn clear(&self, cmd: &mut Commands) {
        let b = &self.buffers;
        for buffer in [&b.surface_echoes, &b.volume_echoes, &b.segment_count, &b.counters] {
            cmd.fill(buffer, 0);
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
    }

    pub(super) fn origin(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let (b, w) = (&self.buffers, &self.world);
        cmd.scope("origin");
        cmd.dispatch(
            &self.kernels.origin,
            [lines(&self.frame), 1, 1],
            &[],
            &[
                Binding::Buffer(&b.frame),
                Binding::Buffer(w.instances()),
                Binding::Buffer(w.vertices()),
                Binding::Buffer(w.triangles()),
                w.structure(),
                Binding::Buffer(&b.stacks),
                Binding::Buffer(&b.counters),
                Binding::Buffer(&b.tissues),
                Binding::Buffer(&b.scanlines),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        Ok(())
    }

    /// Traces a batch of paths; `turn` as in [`super::rounds::Rounds::of`].
    pub(super) fn trace(
        &self,
        cmd: &mut Commands,
        path_begin: u32,
        turn: &mut u32,
    ) -> Result<(), GpuError> {
        let (b, w) = (&self.buffers, &self.world);
        if path_begin > 0 {
            cmd.barrier(Stage::Compute, Stage::Transfer);
            cmd.fill(&b.segment_count, 0);
            cmd.barrier(Stage::Transfer, Stage::Compute);
        }
        let path_end = self.frame.paths.min(path_begin + self.batches.paths);
        cmd.scope("trace");
        let paths = path_begin..path_end;
        for round in self.batches.rounds.of(&self.frame, paths, turn) {
            cmd.dispatch(
                &self.kernels.trace[round.role as usize],
                [round.workers, 1, 1],
                bytemuck::cast_slice(&round.push),
                &[
                    Binding::Buffer(&b.frame),
                    Binding::Buffer(&b.tissues),
                    Binding::Buffer(&b.surfaces),
                    Binding::Buffer(w.instances()),
                    Binding::Buffer(w.vertices()),
                    Binding::Buffer(w.normals()),
                    Binding::Buffer(w.triangles()),
                    w.structure(),
                    Binding::Buffer(&b.stacks),
                    Binding::Buffer(&b.rows),
                    Binding::Buffer(&b.surface_echoes),
                    Binding::Buffer(&b.segments),
                    Binding::Buffer(&b.segment_count),
                    Binding::Buffer(&b.counters),
                    Binding::Buffer(w.fields()),
                    Binding::Buffer(&b.interactions),
                    Binding::Buffer(&b.interaction_count),
                    Binding::Buffer(&b.scanlines),
                ],
            )?;
            cmd.barrier(Stage::Compute, Stage::Compute);
        }
        Ok(())
    }

    pub(super) fn scatter(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let (b, w) = (&self.buffers, &self.world);
        // Lists of many paths are shared among workgroups: each clears and flushes its own window.
        let chunks = self.batches.paths_with_segments(&self.frame).div_ceil(8).clamp(1, 16);
        let bindings = [
            &b.frame,
            &b.tissues,
            w.instances(),
            &b.rows,
            &b.points,
            &b.segments,
            &b.segment_count,
            &b.volume_echoes,
            &b.counters,
            &b.scanlines,
            w.fields(),
        ]
        .map(Binding::Buffer);
        // The last one is the deforming kernel's alone.
        let bound = bindings.len() - usize::from(!w.deforms());
        cmd.scope("scatter");
        cmd.dispatch_groups(
            &self.kernels.scatter,
            [self.frame.scanlines, chunks, self.frame.samples.div_ceil(layout::SCATTER_WINDOW)],
            &[],
            &bindings[..bound],
        )?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        Ok(())
    }

    pub(super) fn beam(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let b = &self.buffers;
        let bindings = [
            &b.frame,
            &b.rows,
            &b.surface_echoes,
            &b.volume_echoes,
            &b.counters,
            &b.lateral,
            &b.contact,
        ];
        let threads = [self.frame.samples, self.frame.scanlines.div_ceil(layout::BEAM_LINES)];
        self.per_sample(cmd, &self.kernels.beam, threads, &bindings)
    }

    pub(super) fn axial(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let b = &self.buffers;
        let threads = [self.frame.samples.div_ceil(layout::AXIAL_SAMPLES), self.frame.scanlines];
        let bindings = [&b.frame, &b.rows, &b.lateral, &b.iq, &b.log_image];
        self.per_sample(cmd, &self.kernels.axial, threads, &bindings)
    }

    fn per_sample(
        &self,
        cmd: &mut Commands,
        kernel: &Kernel,
        [x, y]: [u32; 2],
        buffers: &[&Buffer],
    ) -> Result<(), GpuError> {
        let bindings: Vec<Binding> = buffers.iter().map(|b| Binding::Buffer(b)).collect();
        cmd.scope(kernel.name());
        cmd.dispatch(kernel, [x, y, 1], &[], &bindings)?;
        cmd.barrier(Stage::Compute, Stage::Compute);
        Ok(())
    }

    /// The finished image.
    pub(super) fn pixels(&self, fused: bool) -> &Buffer {
        let fused = self.fusion.as_ref().filter(|_| fused);
        fused.map_or(&self.buffers.pixels, |f| &f.pixels)
    }

    /// Mixes the image with the acquired volume, if there is one.
    pub(super) fn fuse(&self, cmd: &mut Commands, scene: &Scene) -> Result<bool, GpuError> {
        let (Some(fused), Some(fusion)) = (&self.fusion, &scene.fusion) else {
            return Ok(false);
        };
        let b = &self.buffers;
        let simulated = Simulated {
            frame: &self.frame,
            constants: &b.frame,
            scanlines: &b.scanlines,
            tissues: &b.tissues,
            rows: &b.rows,
            stacks: &b.stacks,
            counters: &b.counters,
            pixels: &b.pixels,
        };
        fused.record(cmd, &self.world, fusion, &simulated)?;
        Ok(true)
    }

    /// Colours what of the mixed image is acquired.
    pub(super) fn tint(&mut self, cmd: &mut Commands, tint: &Tint) -> Result<&Buffer, GpuError> {
        let fused = self.fusion.as_mut().expect("the frame was fused");
        let size = [self.frame.image_width, self.frame.image_height];
        fused.tint(cmd, &self.buffers.frame, size, tint)
    }

    pub(super) fn display(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let b = &self.buffers;
        cmd.scope("display");
        cmd.dispatch(
            &self.kernels.display,
            [self.frame.image_width, self.frame.image_height, 1],
            &[],
            &[
                Binding::Buffer(&b.frame),
                Binding::Buffer(&b.log_image),
                Binding::Buffer(&b.grey),
                Binding::Buffer(&b.pixels),
            ],
        )?;
        cmd.barrier(Stage::Compute, Stage::Transfer);
        Ok(())
    }
}

/// The frame's constants, with what only the world and the room for segments decide.
pub(super) fn frame_constants(
    scene: &Scene,
    world: &World,
    coincident: bool,
    index: u32,
    room: &Room,
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
    let batches = Batches::new(&frame, room);
    frame.segment_capacity = batches.capacity;
    (frame, batches)
}
