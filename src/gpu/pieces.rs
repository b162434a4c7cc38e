//! A submission in pieces, where the window shares the simulation's queue.
//!
//! A queue runs in order, so a window that submits behind a frame of a second waits for a second.
//! In pieces of a few milliseconds, of which no more than two are ever handed over, it waits for
//! two of them. How long a dispatch takes follows from what one of its work groups took in the frame
//! before, which may have had fewer of them.

use std::collections::HashMap;

use super::timer::FrameTimings;

/// Longest time on the device that one piece should take, ms: two of them fit into an interface
/// frame of 1/60 s.
const PIECE_MS: f64 = 7.0;

/// Pieces of a dispatch that was never timed.
const UNTIMED: usize = 16;

/// A box of work groups: first one and extent, per axis.
pub(crate) type Groups = [[u32; 3]; 2];

/// How much the piece that is being recorded holds, and what is known of the dispatches to come.
#[derive(Default)]
pub(crate) struct Pieces {
    /// Mean time of one work group in scopes of each name, ms.
    group_ms: HashMap<String, f64>,
    /// Work groups of this frame by scope.
    groups: HashMap<String, f64>,
    /// What the commands recorded since the last cut will take, ms.
    load_ms: f64,
}

impl Pieces {
    /// Starts over.
    pub(crate) fn begin(&mut self) {
        self.load_ms = 0.0;
        self.groups.clear();
    }

    /// Notes a dispatch of `scope`.
    pub(crate) fn count(&mut self, scope: &str, groups: [u32; 3]) {
        *self.groups.entry(scope.to_owned()).or_default() += product(groups);
    }

    /// Takes over what the last frame took.
    pub(crate) fn learn(&mut self, timings: &FrameTimings) {
        for (name, groups) in &self.groups {
            let each = timings.of(name) / groups;
            if each.is_finite() {
                self.group_ms.insert(name.clone(), each);
            }
        }
    }

    /// Cuts a dispatch of `scope` into boxes; `whole` kernels know the number of groups along y and
    /// z and are only cut along x.
    pub(crate) fn cut(&self, scope: &str, groups: [u32; 3], whole: bool) -> (Vec<Groups>, f64) {
        let known = self.group_ms.get(scope);
        let (count, each_ms) = match known.map(|each| each * product(groups)) {
            Some(ms) => {
                let count = (ms / PIECE_MS).ceil().max(1.0);
                (count as usize, ms / count)
            }
            None => (UNTIMED, PIECE_MS),
        };
        (cut(groups, count, whole), each_ms)
    }

    /// Notes a dispatch of `ms`; whether the commands before it have to go first.
    pub(crate) fn add(&mut self, ms: f64) -> bool {
        let full = self.load_ms > 0.0 && self.load_ms + ms > PIECE_MS;
        self.load_ms = if full { ms } else { self.load_ms + ms };
        full
    }
}

fn product(groups: [u32; 3]) -> f64 {
    groups.map(f64::from).iter().product()
}

/// About `count` boxes of equal size that fill `groups`, cut along x, and along y where x is spent.
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
    use crate::gpu::FrameTimings;

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
        let mut pieces = Pieces::default();
        assert_eq!(
            pieces.cut("trace", [64, 1, 1], false).0.len(),
            16,
            "untimed"
        );
        let passes = vec![
            ("trace".into(), 20.0),
            ("trace".into(), 22.0),
            ("beam".into(), 3.0),
        ];
        for (scope, width) in [("trace", 64), ("trace", 64), ("beam", 64)] {
            pieces.count(scope, [width, 1, 1]);
        }
        pieces.learn(&FrameTimings { frame: 0, passes });
        let (boxes, each) = pieces.cut("trace", [64, 1, 1], false);
        assert_eq!((boxes.len(), each), (3, 7.0));
        let (boxes, _) = pieces.cut("trace", [64, 8, 1], false);
        assert_eq!(boxes.len(), 22, "a frame of eight times as many groups");
        assert_eq!(pieces.cut("beam", [64, 1, 1], false).0.len(), 1);
        pieces.begin();
        assert!(
            !pieces.add(3.0) && !pieces.add(3.0),
            "short ones go together"
        );
        assert!(pieces.add(3.0), "until the piece is full");
        assert!(!pieces.add(3.0));
    }
}
