//! Surface echoes for the labels: the frame's own kernels once more, with other buffers in the place of the frame's, so
//! that the picture is the same with labels and without.

use super::lane::Lane;
use super::layout::Frame;
use super::pass::{Array, Extent};
use super::passes::Passes;
use super::stages::{AXIAL, BEAM, TRACE, axial, beam, expect, inputs, scatter, trace};
use crate::gpu::{Buffer, Commands, GpuError, Stage};

/// A number of segments that leaves no room for another, and enough for all of them to be counted.
const FULL: u32 = 1 << 31;

impl Passes {
    /// Records the echoes that surfaces send back to the probe at once: all paths again, none of which is reflected.
    /// What is random in an echo is that of the frame, so that the rest of its echoes are those that came by
    /// reflections. Runs behind the last `scatter` and in front of `beam`.
    pub(super) fn direct_echoes(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        let direct = |frame: &Frame| Frame { max_reflections: 0, noise: 0.0, ..*frame };
        for lane in self.active() {
            let constants = direct(&lane.frame);
            cmd.write(&lane.buffers[&expect::DIRECT_FRAME], 0, bytemuck::bytes_of(&constants))?;
            // Segments are not wanted: those of the frame stay.
            cmd.fill(&lane.buffers[&expect::DIRECT_COUNT], FULL);
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("expect");
        let instead = [
            (&inputs::FRAME, &expect::DIRECT_FRAME),
            (&trace::SURFACE_ECHOES, &expect::DIRECT_ECHOES),
            (&trace::SEGMENT_COUNT, &expect::DIRECT_COUNT),
            (&inputs::COUNTERS, &expect::DIRECT_COUNTERS),
        ];
        let direct = direct(self.frame());
        let mut turn = 0;
        for begin in (0..direct.paths).step_by(self.batches.paths as usize) {
            let paths = begin..direct.paths.min(begin + self.batches.paths);
            for round in self.batches.rounds.of(&direct, paths, &mut turn) {
                let threads = Extent::Threads(round.threads());
                let push = bytemuck::bytes_of(&round.push);
                let pass = &TRACE[round.role as usize];
                self.record(cmd, pass, threads, push, &|lane| in_place(lane, &instead))?;
            }
        }
        Ok(())
    }

    /// Records the samples of IQ that surface echoes alone make: all of them, and the direct ones.
    pub(super) fn surface_samples(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        cmd.scope("level");
        for (echoes, iq) in [
            (&trace::SURFACE_ECHOES, &expect::SURFACE_IQ),
            (&expect::DIRECT_ECHOES, &expect::DIRECT_IQ),
        ] {
            let instead = [
                (&inputs::FRAME, &expect::DIRECT_FRAME),
                (&trace::SURFACE_ECHOES, echoes),
                (&scatter::VOLUME_ECHOES, &expect::NO_ECHOES),
                (&scatter::POINT_ECHOES, &expect::NO_ECHOES),
                (&inputs::COUNTERS, &expect::DIRECT_COUNTERS),
                (&beam::LATERAL, &expect::LABEL_LATERAL),
                (&axial::IQ, iq),
                (&axial::LOG_IMAGE, &expect::LABEL_LOG_IMAGE),
            ];
            for pass in [&BEAM, &AXIAL] {
                let extent = pass.extent.expect("a stage of every frame states its extent");
                let threads = extent(self.frame());
                self.record(cmd, pass, threads, &[], &|lane| in_place(lane, &instead))?;
            }
        }
        Ok(())
    }
}

/// Arrays, each with the buffer that a lane has of the array beside it.
fn in_place<'l>(
    lane: &'l Lane,
    pairs: &[(&'static Array, &Array)],
) -> Vec<(&'static Array, &'l Buffer)> {
    pairs.iter().map(|&(array, other)| (array, &lane.buffers[other])).collect()
}
