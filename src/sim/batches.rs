//! Batches: how many paths of a frame are traced before their segments are scattered.

use super::layout;
use super::pass::{Sizes, lines};
use super::rounds::{self, Rounds, one_speaks_for_all};
use super::tables::Tables;
use crate::gpu::Device;

/// Largest segment buffer, bytes: the portable minimum of maxStorageBufferRange is 128 MiB.
const SEGMENT_BUDGET: u64 = 96 << 20;

/// The memory and threads of a device that a frame may use.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameBudget {
    /// Bytes for segments.
    pub(super) segments: u64,
    /// Threads that the device runs at once, approximately.
    pub(super) at_once: u32,
    /// Main paths for whose interactions there is room.
    pub(super) main_paths: u64,
}

impl FrameBudget {
    /// The budget on a device where no buffers have been made yet.
    pub(super) fn of(device: &Device) -> Self {
        Self { segments: SEGMENT_BUDGET, at_once: device.threads_at_once(), main_paths: u64::MAX }
    }
}

/// The paths of a frame divided into batches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Batches {
    /// Segments that one line may hold; no batch can exceed it.
    pub(super) capacity: u32,
    /// Paths traced before their segments are scattered.
    pub(super) paths: u32,
    /// The dispatches in which `trace` works on them.
    pub(super) rounds: Rounds,
}

impl Batches {
    /// The largest batches for whose segments `budget` has memory.
    pub(super) fn new(frame: &layout::Frame, budget: &FrameBudget) -> Self {
        let per_path = per_path(frame);
        let line_bytes = u64::from(lines(frame)) * size_of::<layout::Segment>() as u64;
        let affordable = u32::try_from(budget.segments / line_bytes.max(1)).unwrap_or(u32::MAX);
        if one_speaks_for_all(frame) {
            return Self {
                capacity: per_path.min(affordable.max(1)),
                paths: frame.paths,
                rounds: Rounds::new(frame, frame.paths, budget.at_once).within(budget.main_paths),
            };
        }
        // Paths that choose a direction at every surface write no interactions down.
        let room = match frame.sampling {
            layout::SAMPLING_MAIN_PATH => u32::try_from(budget.main_paths).unwrap_or(u32::MAX),
            _ => u32::MAX,
        };
        let most = (affordable / per_path).min(rounds::most_paths(frame)).min(room);
        let paths = most.clamp(1, frame.paths);
        Self {
            capacity: paths * per_path,
            paths,
            rounds: Rounds::new(frame, paths, budget.at_once).within(budget.main_paths),
        }
    }

    /// The numbers from which buffer sizes follow, for a frame divided into these batches.
    pub(super) fn sizes(&self, frame: &layout::Frame, tables: &Tables) -> Sizes {
        Sizes {
            frame: *frame,
            tissues: tables.tissues.len() as u64,
            main_paths: self.rounds.main_paths(),
            interactions: self.rounds.interactions(),
        }
    }
}

/// Segments for which a path has room. A path with B interactions has at most B + 1 segments. In the
/// main-path scheme its branches have more, most of which end below the volume floor: room for three times
/// as many. What does not fit is counted and reported.
pub(super) fn per_path(frame: &layout::Frame) -> u32 {
    let branches = frame.sampling == layout::SAMPLING_MAIN_PATH;
    (frame.max_interactions + 1) * if branches { 4 } else { 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of 48 lines, whose 40 paths each have segments of their own, by a sampling.
    fn frame(sampling: u32) -> layout::Frame {
        layout::Frame {
            scanlines: 48,
            layers: 1,
            paths: 40,
            max_interactions: 8,
            sampling,
            flags: layout::FLAG_ROUGH_TRANSMISSION,
            ..layout::Frame::default()
        }
    }

    #[test]
    fn room_for_main_paths_limits_frames_that_have_some() {
        let paths = |sampling: u32, main_paths: u64| {
            let budget = FrameBudget { segments: SEGMENT_BUDGET, at_once: 64, main_paths };
            let batches = Batches::new(&frame(sampling), &budget);
            (batches.paths, batches.rounds.main_paths())
        };
        assert_eq!(paths(layout::SAMPLING_MAIN_PATH, u64::MAX), (40, 40));
        assert_eq!(paths(layout::SAMPLING_MAIN_PATH, 7), (7, 7));
        // A frame of such paths alone leaves no room, and needs none.
        assert_eq!(paths(layout::SAMPLING_PLAIN, 0), (40, 0));
    }
}
