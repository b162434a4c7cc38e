//! Records the echoes of all paths, batch after batch.

use super::layout::{self, ROLE_BRANCHES};
use super::pass::Extent;
use super::passes::{Instead, Passes};
use super::push;
use super::stages::{APERTURE, EXPECT, ORIGIN, SCATTER, TRACE, aperture, scatter, trace};
use crate::gpu::{Commands, GpuError, Stage};

impl Passes {
    pub(super) fn loses_by_aperture(&self) -> bool {
        self.frame().flags & layout::FLAG_APERTURE != 0
    }

    /// Records the echoes of all paths, batch after batch, of scatterers those that `push` names, and for labels of levels what
    /// is expected of them.
    pub(super) fn echoes(
        &self,
        cmd: &mut Commands,
        push: push::Scatter,
        levelled: bool,
    ) -> Result<(), GpuError> {
        self.run(cmd, &ORIGIN)?;
        let mut turn = 0;
        for begin in (0..self.frame().paths).step_by(self.batches.paths as usize) {
            self.trace(cmd, begin, &mut turn)?;
            self.scatter(cmd, push)?;
            if levelled {
                self.run(cmd, &EXPECT)?;
            }
        }
        match levelled {
            true => self.direct_echoes(cmd),
            false => Ok(()),
        }
    }

    /// Records the echoes of the scatterers that `push` names along the segments of the last batch.
    pub(super) fn scatter(&self, cmd: &mut Commands, push: push::Scatter) -> Result<(), GpuError> {
        cmd.scope(SCATTER.name);
        let [threads, ..] = self.kernels.of(&SCATTER, self.world.tissue()).local_size();
        let groups = scatter::extent(self.frame(), self.batches.rounds.at_once / threads);
        self.record(cmd, &SCATTER, groups, bytemuck::bytes_of(&push), &|_| Vec::new())
    }

    /// Records what the aperture lets through, of `apertures` or what is bound instead.
    pub(super) fn converge(
        &self,
        cmd: &mut Commands,
        instead: Instead<'_>,
    ) -> Result<(), GpuError> {
        cmd.scope(APERTURE.name);
        let [threads, ..] = self.kernels.of(&APERTURE, self.world.tissue()).local_size();
        let groups = aperture::extent(self.frame(), self.batches.rounds.at_once / threads);
        self.record(cmd, &APERTURE, groups, &[], instead)
    }

    /// Traces a batch of paths; `turn` is that of [`super::rounds::Rounds::of`].
    fn trace(&self, cmd: &mut Commands, path_begin: u32, turn: &mut u32) -> Result<(), GpuError> {
        if path_begin > 0 {
            cmd.barrier(Stage::Compute, Stage::Transfer);
            self.active().iter().for_each(|lane| cmd.fill(&lane.buffers[&trace::SEGMENT_COUNT], 0));
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
            let push = bytemuck::bytes_of(&round.push);
            self.record(cmd, &TRACE[round.role as usize], threads, push, &|_| Vec::new())?;
        }
        Ok(())
    }
}
