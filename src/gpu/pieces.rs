//! A submission in pieces.
//!
//! A queue runs in order, so a window that shares it and submits behind a frame of a second waits for a
//! second. In pieces of a few milliseconds, of which no more than two are ever handed over, it waits for
//! two of them. Without a waiting window the pieces are longer, but no dispatch runs so long that a driver
//! takes the device for hung (Windows: 2 s). The duration of a dispatch is estimated from that of one of its
//! work groups in the frame before, which may have had fewer of them; at first, by the clock, from a sixteenth of it
//! that goes ahead of the rest.

use std::collections::HashMap;
use std::sync::Arc;

use parking_lot::Mutex;

use super::timer::FrameTimings;

/// Longest time of one piece on the device where the window shares the queue, ms: two of them fit into
/// an interface frame of 1/60 s.
const SHARED_MS: f64 = 7.0;

/// Longest time elsewhere, ms: a tenth of the limit of Windows, so that a frame that suddenly takes several
/// times as long as the one before does no harm.
const ALONE_MS: f64 = 200.0;

/// Part of a dispatch that was never timed which goes ahead of the rest: one in so many.
const AHEAD: u32 = 16;

/// A box of work groups: first one and extent, per axis.
pub(crate) type Groups = [[u32; 3]; 2];

/// What the frames before have taken; of all submissions that are made in turn.
#[derive(Default)]
struct Known {
    /// Mean time of one work group in scopes of each name, ms.
    group_ms: HashMap<String, f64>,
    /// Wall-clock time of the last frame, ms, and its number of dispatches, where the queue has no timestamps.
    whole: Option<(f64, usize)>,
}

/// The load of the piece being recorded, and estimates for the dispatches to come.
pub(crate) struct Pieces {
    /// Longest time of one piece, ms.
    budget_ms: f64,
    known: Arc<Mutex<Known>>,
    /// Number of work groups of this frame by scope.
    groups: HashMap<String, f64>,
    /// Number of dispatches of this frame.
    dispatches: usize,
    /// Estimated time of the commands recorded since the last cut, ms.
    load_ms: f64,
}

impl Pieces {
    /// Pieces of a frame; `shared`: the window waits behind them.
    pub(crate) fn new(shared: bool) -> Self {
        Self {
            budget_ms: if shared { SHARED_MS } else { ALONE_MS },
            known: Arc::default(),
            groups: HashMap::new(),
            dispatches: 0,
            load_ms: 0.0,
        }
    }

    /// Pieces of submissions in turn with those of `self`: what one has learnt, both know.
    pub(crate) fn in_turn(&self) -> Self {
        Self {
            known: self.known.clone(),
            groups: HashMap::new(),
            dispatches: 0,
            load_ms: 0.0,
            ..*self
        }
    }

    /// Starts over.
    pub(crate) fn begin(&mut self) {
        self.handed_over();
        self.dispatches = 0;
        self.groups.clear();
    }

    /// Takes over the times of the last frame: its scopes or, where they were not timed, the whole
    /// wall-clock time.
    pub(crate) fn learn(&mut self, timings: &FrameTimings, wall_ms: f64) {
        let mut known = self.known.lock();
        known.whole = (timings.passes.is_empty()).then_some((wall_ms, self.dispatches.max(1)));
        if known.whole.is_some() {
            known.group_ms.clear();
            return;
        }
        for (name, groups) in &self.groups {
            let each = timings.of(name) / groups;
            if each.is_finite() {
                known.group_ms.insert(name.clone(), each);
            }
        }
    }

    /// The part of a dispatch of `scope` that goes ahead of the rest to be timed ([`Self::tried`]), and the rest; none
    /// where it is known how long it takes, or where it is too small to divide.
    pub(crate) fn ahead(&self, scope: &str, groups: [u32; 3], whole: bool) -> Option<[Groups; 2]> {
        let known = self.known.lock();
        if known.group_ms.contains_key(scope) || known.whole.is_some() {
            return None;
        }
        let axis = (0..if whole { 1 } else { 2 }).find(|&axis| groups[axis] > 1)?;
        let first = groups[axis].div_ceil(AHEAD);
        let (mut ahead, mut rest) = ([[0; 3], groups], [[0; 3], groups]);
        ahead[1][axis] = first;
        (rest[0][axis], rest[1][axis]) = (first, groups[axis] - first);
        Some([ahead, rest])
    }

    /// Notes that a box of work groups of `scope` alone took `ms` by the clock.
    pub(crate) fn tried(&mut self, scope: &str, [_, groups]: Groups, ms: f64) {
        self.known.lock().group_ms.insert(scope.to_owned(), ms / product(groups));
        *self.groups.entry(scope.to_owned()).or_default() += product(groups);
    }

    /// Cuts a dispatch of `scope`, or the rest of it, into boxes and says what each takes, ms; `whole` kernels use the
    /// number of groups along y and z and are only cut along x. What was never timed and cannot be is one box.
    pub(crate) fn cut(&mut self, scope: &str, all: Groups, whole: bool) -> (Vec<Groups>, f64) {
        let [base, groups] = all;
        self.dispatches += 1;
        *self.groups.entry(scope.to_owned()).or_default() += product(groups);
        let pieces = |ms: f64| (ms / self.budget_ms).ceil().max(1.0);
        let known = self.known.lock();
        let of_scope = known.group_ms.get(scope).map(|each| each * product(groups));
        let (count, each_ms) = match (of_scope, known.whole) {
            (Some(ms), _) => (pieces(ms) as usize, ms / pieces(ms)),
            // Any of the dispatches may be the one that takes all the time.
            (None, Some((ms, dispatches))) => match pieces(ms) {
                1.0 => (1, ms / dispatches as f64),
                count => (count as usize, ms / count),
            },
            (None, None) => (1, self.budget_ms),
        };
        let mut boxes = cut(groups, count, whole);
        for [begin, _] in &mut boxes {
            *begin = std::array::from_fn(|axis| begin[axis] + base[axis]);
        }
        (boxes, each_ms)
    }

    /// Notes that nothing that was recorded is left to be handed over.
    pub(crate) fn handed_over(&mut self) {
        self.load_ms = 0.0;
    }

    /// Notes a dispatch of `ms`; returns whether the commands before it have to go first.
    pub(crate) fn add(&mut self, ms: f64) -> bool {
        let full = self.load_ms > 0.0 && self.load_ms + ms > self.budget_ms;
        self.load_ms = if full { ms } else { self.load_ms + ms };
        full
    }
}

fn product(groups: [u32; 3]) -> f64 {
    groups.map(f64::from).iter().product()
}

/// About `count` boxes of equal size that fill `groups`, cut along x, and along y where x is used up.
fn cut(groups: [u32; 3], count: usize, whole: bool) -> Vec<Groups> {
    let count = u32::try_from(count).unwrap_or(u32::MAX);
    let along = |length: u32, count: u32| {
        let step = length.div_ceil(count.clamp(1, length.max(1)));
        (0..length)
            .step_by(step.max(1) as usize)
            .map(move |begin| (begin, step.min(length - begin)))
    };
    let rows = match whole {
        true => 1,
        false => count.div_ceil(groups[0].max(1)),
    };
    along(groups[1], rows)
        .flat_map(|(y, height)| {
            along(groups[0], count.div_ceil(rows))
                .map(move |(x, width)| [[x, y, 0], [width, height, groups[2]]])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Groups, Pieces, cut};
    use crate::FrameTimings;

    fn whole(groups: [u32; 3]) -> Groups {
        [[0; 3], groups]
    }

    fn volume(boxes: &[Groups]) -> u32 {
        boxes.iter().map(|b| b[1].iter().product::<u32>()).sum()
    }

    #[test]
    fn boxes_fill_the_groups_once() {
        for (groups, count, whole) in [
            ([1344, 4, 2], 20, true),
            ([21, 8, 1], 5, false),
            ([21, 8, 1], 100, false),
            ([21, 8, 1], 100, true),
            ([1, 1, 1], 3, false),
            ([7, 1, 1], 100, false),
        ] {
            let boxes = cut(groups, count, whole);
            assert_eq!(volume(&boxes), groups.iter().product::<u32>(), "{groups:?}");
            let mut begins: Vec<_> = boxes.iter().map(|b| b[0]).collect();
            begins.sort_unstable();
            begins.dedup();
            assert_eq!(begins.len(), boxes.len(), "{groups:?}");
            let inside = |b: &Groups| (0..3).all(|axis| b[0][axis] + b[1][axis] <= groups[axis]);
            assert!(boxes.iter().all(inside), "{groups:?}");
            if whole {
                assert!(boxes.iter().all(|b| b[1][1] == groups[1]), "{groups:?}");
            }
            assert!(boxes.len() <= 2 * count, "{groups:?}: {}", boxes.len());
        }
        assert!(cut([0, 4, 1], 3, false).is_empty());
    }

    #[test]
    fn pieces_are_as_long_as_they_may_be() {
        let mut pieces = Pieces::new(true);
        pieces.begin();
        let passes = vec![("trace".into(), 20.0), ("trace".into(), 22.0), ("beam".into(), 3.0)];
        for scope in ["trace", "trace", "beam"] {
            pieces.cut(scope, whole([64, 1, 1]), false);
        }
        pieces.learn(&FrameTimings { frame: 0, passes }, 1e3);
        let (boxes, each) = pieces.cut("trace", whole([64, 1, 1]), false);
        assert_eq!((boxes.len(), each), (3, 7.0));
        let (boxes, _) = pieces.cut("trace", whole([64, 8, 1]), false);
        assert_eq!(boxes.len(), 22, "a frame of eight times as many groups");
        assert_eq!(pieces.cut("beam", whole([64, 1, 1]), false).0.len(), 1);
        pieces.begin();
        assert!(!pieces.add(3.0) && !pieces.add(3.0), "short ones go together");
        assert!(pieces.add(3.0), "until the piece is full");
        assert!(!pieces.add(3.0));
    }

    #[test]
    fn a_dispatch_that_was_never_timed_sends_a_part_ahead() {
        let mut pieces = Pieces::new(true);
        let in_turn = pieces.in_turn();
        assert!(pieces.ahead("origin", [1, 8, 1], true).is_none(), "cannot be divided");
        assert_eq!(pieces.cut("origin", whole([1, 8, 1]), true).0.len(), 1);
        let along_y = pieces.ahead("beam", [1, 8, 3], false).unwrap();
        assert_eq!(along_y, [[[0; 3], [1, 1, 3]], [[0, 1, 0], [1, 7, 3]]]);

        let [first, rest] = pieces.ahead("trace", [40, 2, 1], true).unwrap();
        assert_eq!([first, rest], [[[0; 3], [3, 2, 1]], [[3, 0, 0], [37, 2, 1]]]);
        // Of a device that takes 2 ms for each group the rest is 148 ms.
        pieces.tried("trace", first, 12.0);
        let (boxes, each) = pieces.cut("trace", rest, true);
        assert!(boxes.len() == 19 || boxes.len() == 22, "{}", boxes.len());
        assert!(each <= 7.0);
        assert_eq!(volume(&boxes), 74);
        assert!(boxes.iter().all(|b| b[0][0] >= 3 && b[0][0] + b[1][0] <= 40));
        // One that takes 0.01 ms is not cut again, nor is its next submission.
        pieces.tried("trace", first, 0.06);
        assert_eq!(pieces.cut("trace", rest, true).0, [rest]);
        assert!(in_turn.ahead("trace", [40, 2, 1], true).is_none());

        // Times that the queue took replace those of the clock: all of the groups count.
        pieces.begin();
        let passes = vec![("trace".into(), 80.0)];
        pieces.tried("trace", first, 1e3);
        pieces.cut("trace", rest, true);
        pieces.learn(&FrameTimings { frame: 0, passes }, 1e3);
        assert_eq!(pieces.cut("trace", whole([7, 1, 1]), true), (vec![whole([7, 1, 1])], 7.0));
    }

    #[test]
    fn without_a_window_pieces_are_longer() {
        let mut pieces = Pieces::new(false);
        let passes = vec![("trace".into(), 150.0), ("scatter".into(), 2100.0)];
        for scope in ["trace", "scatter"] {
            pieces.cut(scope, whole([64, 1, 1]), false);
        }
        pieces.learn(&FrameTimings { frame: 0, passes }, 1e4);
        assert_eq!(pieces.cut("trace", whole([64, 1, 1]), false).0.len(), 1);
        let (boxes, each) = pieces.cut("scatter", whole([64, 1, 1]), false);
        assert!(boxes.len() >= 11 && each <= 200.0, "{} of {each}", boxes.len());
    }

    #[test]
    fn without_timestamps_the_clock_counts() {
        let mut pieces = Pieces::new(true);
        let frame = |pieces: &mut Pieces| -> usize {
            pieces.begin();
            let cut = |p: &mut Pieces| p.cut("trace", whole([64, 1, 1]), false).0.len();
            (0..10).map(|_| cut(pieces)).sum()
        };
        assert!(pieces.ahead("trace", [64, 1, 1], false).is_some());
        pieces.tried("trace", whole([4, 1, 1]), 14.0);
        assert_eq!(frame(&mut pieces), 320, "by the clock");
        pieces.learn(&FrameTimings::default(), 5.0);
        assert_eq!(frame(&mut pieces), 10, "a fast device is not cut");
        assert!(pieces.ahead("trace", [64, 1, 1], false).is_none());
        let (_, each) = pieces.cut("trace", whole([64, 1, 1]), false);
        assert!(each < 1.0, "nor are its dispatches submitted one by one: {each}");
        pieces.learn(&FrameTimings::default(), 70.0);
        assert_eq!(
            pieces.cut("trace", whole([64, 1, 1]), false),
            (super::cut([64, 1, 1], 10, false), 7.0)
        );
    }
}
