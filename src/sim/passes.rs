//! Records a pass for all lanes: its dispatch with its bindings, and the barrier behind it.

use super::batches::Batches;
use super::contact::Skins;
use super::lane::Lane;
use super::layout;
use super::pass::{Array, Extent, Pass, Sizes};
use super::pass_kernels::PassKernels;
use super::stages::mask::ACQUIRED;
use super::world::World;
use crate::gpu::{Binding, Buffer, Commands, GpuError, Stage};

/// For a lane, the buffers that a dispatch binds instead of those of the arrays beside them.
pub(super) type Instead<'g> = &'g dyn Fn(&Lane) -> Vec<(&'static Array, &Buffer)>;

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
        let kernel = self.kernels.of(pass, self.world.tissue());
        // By number: what a kernel declares and does not use is not in its SPIR-V.
        let binds = kernel.bindings().iter().map(|info| pass.binds[info.binding as usize]);
        let binds: Vec<&Array> = binds.collect();
        for lane in self.active() {
            let given = instead(lane);
            let bound = binds.iter().map(|array| self.binding(lane, array, &given));
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
        array: &Array,
        given: &[(&Array, &'a Buffer)],
    ) -> Binding<'a> {
        if let Some((_, buffer)) = given.iter().find(|(of, _)| *of == array) {
            return Binding::Buffer(buffer);
        }
        match &lane.fusion {
            Some(fusion) if *array == ACQUIRED => Binding::Image(fusion.shown()),
            _ => self.world.binding(array).unwrap_or_else(|| Binding::Buffer(&lane.buffers[array])),
        }
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
