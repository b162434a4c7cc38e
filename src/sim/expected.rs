//! Surface echoes for the labels: the frame's own kernels once more, with other buffers in the place of the frame's, so
//! that the picture is the same with labels and without.

use super::lane::Lane;
use super::layout::Frame;
use super::pass::Extent;
use super::passes::Passes;
use super::stages::{AXIAL, BEAM, TRACE};
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
            cmd.write(&lane.buffers["direct_frame"], 0, bytemuck::bytes_of(&constants))?;
            // Segments are not wanted: those of the frame stay.
            cmd.fill(&lane.buffers["direct_count"], FULL);
        }
        cmd.barrier(Stage::Transfer, Stage::Compute);
        cmd.scope("expect");
        let instead = [
            ("frame", "direct_frame"),
            ("surface_echoes", "direct_echoes"),
            ("segment_count", "direct_count"),
            ("counters", "direct_counters"),
        ];
        let direct = direct(self.frame());
        let mut turn = 0;
        for begin in (0..direct.paths).step_by(self.batches.paths as usize) {
            let paths = begin..direct.paths.min(begin + self.batches.paths);
            for round in self.batches.rounds.of(&direct, paths, &mut turn) {
                let threads = Extent::Threads(round.threads());
                let push = bytemuck::cast_slice(&round.push);
                let pass = &TRACE[round.role as usize];
                self.record(cmd, pass, threads, push, &|lane| named(lane, &instead))?;
            }
        }
        Ok(())
    }

    /// Records the samples of IQ that surface echoes alone make: all of them, and the direct ones.
    pub(super) fn surface_samples(&self, cmd: &mut Commands) -> Result<(), GpuError> {
        cmd.scope("level");
        for (echoes, iq) in [("surface_echoes", "surface_iq"), ("direct_echoes", "direct_iq")] {
            let instead = [
                ("frame", "direct_frame"),
                ("surface_echoes", echoes),
                ("volume_echoes", "no_echoes"),
                ("point_echoes", "no_echoes"),
                ("counters", "direct_counters"),
                ("lateral", "label_lateral"),
                ("iq", iq),
                ("log_image", "label_log_image"),
            ];
            for pass in [&BEAM, &AXIAL] {
                let extent = pass.extent.expect("a stage of every frame states its extent");
                let threads = extent(self.frame());
                self.record(cmd, pass, threads, &[], &|lane| named(lane, &instead))?;
            }
        }
        Ok(())
    }
}

/// Names with the buffers of a lane that have the names beside them.
fn named<'l>(lane: &'l Lane, pairs: &[(&'static str, &str)]) -> Vec<(&'static str, &'l Buffer)> {
    pairs.iter().map(|&(name, other)| (name, &lane.buffers[other])).collect()
}
