//! The dispatches by which `trace` goes over the paths of a frame.

use std::ops::Range;

use super::layout::{
    self, FLAG_ROUGH_TRANSMISSION, Frame, Interaction, ROLE_BRANCHES, ROLE_MAIN, ROLE_WHOLE,
    SAMPLING_MAIN_PATH, TRACE_GROUP,
};
use super::push;
use super::stages::TRACE;

/// Largest buffer of interactions, bytes; frames that have more are traced by groups of lines.
const INTERACTION_BUDGET: u64 = 32 << 20;
/// Work groups that every Vulkan device supports along an axis.
const MOST_GROUPS: u32 = 65_535;

/// True if path 0 alone writes segments: in the main-path scheme, if all paths start alike.
pub(super) fn one_speaks_for_all(frame: &Frame) -> bool {
    let alike = frame.origin_jitter <= 0.0
        && frame.emission_lobe <= 0.0
        && frame.flags & FLAG_ROUGH_TRANSMISSION == 0;
    frame.sampling == SAMPLING_MAIN_PATH && alike
}

/// Paths for whose interactions there is memory at the same time.
pub(super) fn most_paths(frame: &Frame) -> u32 {
    if frame.sampling != SAMPLING_MAIN_PATH {
        return MOST_GROUPS;
    }
    let affordable = INTERACTION_BUDGET / path_bytes(frame);
    (MOST_GROUPS / slots(frame)).min(u32::try_from(affordable).unwrap_or(u32::MAX))
}

/// Interactions that a main path may have.
fn slots(frame: &Frame) -> u32 {
    frame.max_interactions.max(1)
}

fn path_bytes(frame: &Frame) -> u64 {
    u64::from(slots(frame)) * size_of::<Interaction>() as u64
}

/// Workers of a work group where so few leave threads of the device idle all the same. Threads of a group run in step,
/// and all of them wait for the longest path: H100, 1344 main paths of `abdomen`: 1.51 ms by 64 of a group, 1.28 by 16,
/// 1.14 by 8.
const FEW_LANES: u32 = 8;

/// Most workers of a dispatch: four times what the largest GPU runs at once, and far fewer than Vulkan allows.
const MOST_WORKERS: u32 = 1 << 20;

/// Pieces of work that a worker does one after the other, if there are enough.
const PIECES: u32 = 8;

/// Most paths that a worker takes one after the other at an interaction, which it then recalls once for all of them.
const MOST_IN_BLOCK: u32 = 8;

/// Pieces of work for each thread that a device runs at once, below which the blocks are halved: most of the room for
/// interactions is empty, and a thread that echoes eight times is the last to end. H100, blocks of 1 instead of 8: the
/// branches of `fetus` take 1.39 instead of 5.31 ms with 32 paths, those of `abdomen` 8.7 instead of 11.6 with 128.
const SPARE_PIECES: u64 = 16;

/// One dispatch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// The role of its paths: [`ROLE_WHOLE`], [`ROLE_MAIN`] or [`ROLE_BRANCHES`].
    pub role: u32,
    /// Its push constants.
    pub push: push::Trace,
    /// Number of workers. Each takes one piece after the other, so that no thread waits for the longer path of
    /// another one.
    pub workers: u32,
}

impl Round {
    /// The size of its dispatch: all threads of the work groups in which the workers are.
    pub fn threads(&self) -> [u32; 3] {
        [self.workers.div_ceil(self.push.lanes) * TRACE_GROUP, 1, 1]
    }

    /// Specialization constants, by id, that make `trace` a kernel for one role.
    pub fn constants(role: u32) -> &'static [(u32, u32)] {
        TRACE[role as usize].constants
    }
}

/// The number of lines, and of main paths per line, that are traced together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rounds {
    lines: u32,
    /// Main paths per line; 0 where paths choose a direction at every surface.
    mains: u32,
    slots: u32,
    /// Threads that the device runs at once, approximately.
    pub(super) at_once: u32,
}

impl Rounds {
    /// The rounds for batches of up to `paths` paths per line, on a device that runs about `at_once` threads at
    /// once. Where paths do not begin alike, only as many lines are traced together as give each of these threads a main path,
    /// so that a device with few threads stores few interactions.
    pub fn new(frame: &Frame, paths: u32, at_once: u32) -> Self {
        let lines = frame.scanlines * frame.layers;
        let mains = match frame.sampling {
            layout::SAMPLING_MAIN_PATH if one_speaks_for_all(frame) => 1,
            layout::SAMPLING_MAIN_PATH => paths,
            _ => 0,
        };
        let line_bytes = path_bytes(frame) * u64::from(mains);
        let affordable = INTERACTION_BUDGET.checked_div(line_bytes);
        let affordable = affordable.map_or(u32::MAX, |n| u32::try_from(n).unwrap_or(u32::MAX));
        let useful = match one_speaks_for_all(frame) {
            // What the main paths of all lines lose is known before any of them echoes.
            true => u32::MAX,
            false => at_once.checked_div(mains).unwrap_or(u32::MAX),
        };
        let together = affordable.min(useful).clamp(1, lines.max(1));
        Self {
            // The lines in groups of equal size.
            lines: lines.div_ceil(lines.div_ceil(together).max(1)).max(1),
            mains,
            slots: slots(frame),
            at_once,
        }
    }

    /// The same, but with no more lines together than there is room for their main paths.
    pub fn within(self, main_paths: u64) -> Self {
        let room = main_paths.checked_div(self.mains.into()).unwrap_or(u64::MAX);
        Self { lines: self.lines.min(u32::try_from(room).unwrap_or(u32::MAX)).max(1), ..self }
    }

    /// The roles of the dispatches.
    pub fn roles(&self) -> &'static [u32] {
        match self.mains {
            0 => &[ROLE_WHOLE],
            _ => &[ROLE_MAIN, ROLE_BRANCHES],
        }
    }

    /// Main paths that are traced together.
    pub fn main_paths(&self) -> u64 {
        u64::from(self.lines) * u64::from(self.mains)
    }

    /// The interactions for which there must be memory.
    pub fn interactions(&self) -> u64 {
        self.main_paths() * u64::from(self.slots)
    }

    /// Paths that a worker takes at an interaction, of `paths` that the main path stands for: as many as leave enough
    /// pieces of work for the device.
    fn block(&self, paths: u32) -> u32 {
        let pieces = |block| self.interactions() * u64::from(paths.div_ceil(block));
        let enough = SPARE_PIECES * u64::from(self.at_once);
        let mut block = MOST_IN_BLOCK;
        while block > 1 && pieces(block) < enough {
            block /= 2;
        }
        block
    }

    /// The dispatches that trace `paths` of all lines, in order, each after the one before. `turn` is the number
    /// of the frame's counter, of two, that the first dispatch uses; it is advanced to the next one.
    pub fn of(&self, frame: &Frame, paths: Range<u32>, turn: &mut u32) -> Vec<Round> {
        let all = frame.scanlines * frame.layers;
        let (begin, count) = (paths.start, paths.len() as u32);
        let alike = one_speaks_for_all(frame);
        let block = if alike { self.block(count) } else { 1 };
        let mut round = |role, count, line, lines: u32, per_line: u32, again| {
            let pieces = lines * per_line;
            let workers = self.at_once.max(pieces / PIECES);
            let workers = workers.min(pieces).clamp(1, MOST_WORKERS);
            // Twice an equal share, because pieces of other workers may be larger. Workers that begin later then
            // find none.
            let most = 2 * pieces.div_ceil(workers);
            let few = workers * (TRACE_GROUP / FEW_LANES) <= self.at_once;
            let lanes = if few { FEW_LANES } else { TRACE_GROUP };
            let push = push::Trace {
                path_begin: begin,
                path_count: count,
                line_begin: line,
                line_count: lines,
                pieces,
                most,
                turn: *turn,
                block,
                lanes,
                again,
            };
            *turn ^= 1;
            Round { role, push, workers }
        };
        if self.mains == 0 {
            return vec![round(ROLE_WHOLE, count, 0, all, count, 0)];
        }
        let (mains, blocks) = if alike { (1, count.div_ceil(block)) } else { (count, 1) };
        let mut rounds = Vec::new();
        let groups = || (0..all).step_by(self.lines as usize);
        let lines = |first| self.lines.min(all - first);
        // Where there is no room for the interactions of all lines, their main paths are followed twice.
        let ahead = alike && groups().len() > 1;
        if ahead {
            rounds.extend(groups().map(|first| round(ROLE_MAIN, 1, first, lines(first), 1, 0)));
        }
        for first in groups() {
            let again = u32::from(ahead);
            rounds.push(round(ROLE_MAIN, mains, first, lines(first), mains, again));
            let met = mains * self.slots * blocks;
            rounds.push(round(ROLE_BRANCHES, mains, first, lines(first), met, 0));
        }
        rounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{FLAG_ROUGH_TRANSMISSION, SAMPLING_PLAIN};

    fn frame(paths: u32, max_interactions: u32) -> Frame {
        Frame {
            scanlines: 192,
            layers: 7,
            paths,
            max_interactions,
            sampling: SAMPLING_MAIN_PATH,
            ..Frame::default()
        }
    }

    /// For each line, the number of rounds of `role` that take it.
    fn lines(rounds: &[Round], role: u32) -> Vec<u32> {
        let mut taken = vec![0; 192 * 7];
        for round in rounds.iter().filter(|r| r.role == role) {
            let first = round.push.line_begin as usize;
            for line in &mut taken[first..first + round.push.line_count as usize] {
                *line += 1;
            }
            assert_eq!(round.push.pieces % round.push.line_count, 0);
            assert!(round.workers * round.push.most >= round.push.pieces);
        }
        taken
    }

    #[test]
    fn every_line_is_traced_once_and_no_buffer_or_dispatch_is_too_large() {
        let mut own = frame(3000, 256);
        own.flags = FLAG_ROUGH_TRANSMISSION;
        for frame in [frame(8, 32), frame(100_000, 256), own] {
            let paths = frame.paths.min(most_paths(&frame));
            let rounds = Rounds::new(&frame, paths, 1 << 18);
            assert!(rounds.interactions() * size_of::<Interaction>() as u64 <= INTERACTION_BUDGET);
            let taken = rounds.of(&frame, 0..paths, &mut 0);
            assert_eq!(lines(&taken, ROLE_BRANCHES), [1; 192 * 7]);
            // Main paths that are alike are followed twice where there is no room for all of their interactions.
            let (first, again): (Vec<_>, Vec<_>) =
                taken.iter().filter(|r| r.role == ROLE_MAIN).partition(|r| r.push.again == 0);
            let [first, again] =
                [first, again].map(|rounds| rounds.into_iter().copied().collect::<Vec<_>>());
            assert_eq!(lines(&first, ROLE_MAIN), [1; 192 * 7]);
            assert!(again.is_empty() || lines(&again, ROLE_MAIN) == [1; 192 * 7]);
            let most = |rounds: &[Round]| rounds.iter().map(|r| r.threads()[0]).max();
            assert!(most(&taken) <= Some(TRACE_GROUP * MOST_GROUPS));
            // If one main path serves all paths, one batch holds all paths.
            let all = Rounds::new(&frame, frame.paths, 1 << 18);
            let all = all.of(&frame, 0..frame.paths, &mut 0);
            assert!(most(&all) <= Some(TRACE_GROUP * MOST_GROUPS));
            // Each dispatch leaves the other counter at zero for the next one.
            assert!(
                taken.iter().zip([0, 1].into_iter().cycle()).all(|(r, turn)| r.push.turn == turn)
            );
            // Main paths come before their branches; those that are alike all before any branches.
            let ahead = if again.is_empty() { 0 } else { first.len() };
            let roles: Vec<u32> = taken[ahead..].iter().map(|r| r.role).collect();
            assert!(roles.chunks(2).all(|r| r == [ROLE_MAIN, ROLE_BRANCHES]));
        }
    }

    #[test]
    fn one_main_path_stands_for_all_that_are_alike() {
        let pieces = |frame: &Frame| {
            let rounds = Rounds::new(frame, 40, 1 << 18).of(frame, 0..40, &mut 0);
            rounds.iter().map(|r| r.push.pieces).collect::<Vec<_>>()
        };
        let mut frame = frame(40, 32);
        assert_eq!(pieces(&frame), [1344, 1344 * 32 * 40]);
        frame.flags = FLAG_ROUGH_TRANSMISSION;
        let own = pieces(&frame);
        assert_eq!(own[1], 32 * own[0]);
        assert_eq!(own[0] % 40, 0);
        frame.sampling = SAMPLING_PLAIN;
        assert_eq!(pieces(&frame), [1344 * 40]);
    }

    #[test]
    fn a_device_of_few_threads_traces_groups_of_lines_one_after_the_other() {
        // Those that are alike are traced together on every device, if there is room.
        let frame = frame(8, 32);
        assert_eq!(Rounds::new(&frame, 8, 512).main_paths(), 1344);
        let few = Rounds::new(&frame, 8, 512).within(448);
        assert_eq!(few.main_paths(), 448);
        let taken = few.of(&frame, 0..8, &mut 0);
        assert_eq!(
            taken.iter().map(|r| r.push.again).collect::<Vec<_>>(),
            [0, 0, 0, 1, 0, 1, 0, 1, 0]
        );
        // Main paths of a large GPU are in groups of their own; here all threads of a group are needed.
        let large = Rounds::new(&frame, 8, 1 << 18).of(&frame, 0..8, &mut 0);
        assert_eq!(
            large.iter().map(|r| r.push.lanes).collect::<Vec<_>>(),
            [FEW_LANES, TRACE_GROUP]
        );
        assert_eq!(large[0].threads(), [8 * 1344, 1, 1]);
        assert_eq!(taken[0].push.lanes, TRACE_GROUP);
        // Few threads: as many paths at an interaction as a block takes.
        assert_eq!(taken[4].push.block, MOST_IN_BLOCK);
        assert_eq!(taken[4].push.pieces, 448 * 32);
        assert_eq!(lines(&taken, ROLE_BRANCHES), [1; 192 * 7]);
        assert_eq!(lines(&taken, ROLE_MAIN), [2; 192 * 7]);
        // A frame of 51 lines of one path of their own would trace them together, but there is room for two groups of 100.
        let own = Frame { flags: FLAG_ROUGH_TRANSMISSION, ..frame };
        let [hundred, fewer] = [100, 51].map(|scanlines| Frame { scanlines, layers: 1, ..own });
        let room = Rounds::new(&hundred, 1, 51).main_paths();
        assert_eq!((room, Rounds::new(&fewer, 1, 51).main_paths()), (50, 51));
        assert_eq!(Rounds::new(&fewer, 1, 51).within(room).main_paths(), 50);
        // Even for 0 threads at once, one line is traced.
        assert_eq!(Rounds::new(&own, 8, 0).main_paths(), 8);
    }
}
