//! Sound around the masks of a fused image: it goes straight on, is absorbed, and loses at each surface
//! what a fluid interface reflects at normal incidence.

use super::stack::Stack;
use super::world::{Crossing, World};
use insonify::sim::layout::{FLAG_COINCIDENT, FLAG_MASKED};

/// Crossings farther apart than this, mm, are not the same surface.
const COINCIDENT: f64 = 1e-3;

/// Where the paths of a line begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Media there.
    pub media: Stack,
    /// Distance along the line, mm.
    pub travelled: f64,
    /// Weight that is left; 0 where nothing of the line is heard.
    pub weight: f64,
    /// Interfaces up to there.
    pub interactions: u32,
}

impl Start {
    /// At the line's own start.
    pub fn at_face(media: Stack) -> Self {
        Self { media, travelled: 0.0, weight: 1.0, interactions: 0 }
    }
}

/// One meeting with a surface, or with two that coincide.
pub(super) struct Toggled {
    /// Whose echo it is.
    pub(super) hit: Crossing,
    /// Media behind.
    pub(super) after: Stack,
    /// Distance of the last crossing that counted.
    pub(super) last: f64,
    /// How many crossings that were.
    pub(super) count: usize,
    /// How many media were one too many.
    pub(super) overflow: u32,
}

impl World<'_> {
    /// What the first of `crossings` does to the media.
    pub(super) fn toggled(&self, stack: &Stack, crossings: &[Crossing]) -> Toggled {
        let nearest = crossings[0];
        let mut here = vec![nearest];
        if self.frame.flags & FLAG_COINCIDENT != 0 {
            let other = crossings[1..]
                .iter()
                .find(|c| c.instance != nearest.instance && c.t - nearest.t <= COINCIDENT);
            here.extend(other);
            here.sort_by_key(|c| c.instance);
        }
        let mut after = stack.clone();
        let mut overflow = 0;
        for c in &here {
            if !c.entry {
                after.leave(c.instance);
            } else if !after.enter(c.instance) {
                overflow += 1;
            }
        }
        Toggled {
            hit: here[0],
            after,
            last: here.iter().map(|c| c.t).fold(nearest.t, f64::max),
            count: here.len(),
            overflow,
        }
    }

    /// Share of the weight that is left behind a surface around the masks between these media.
    pub(super) fn passed(&self, before: &Stack, after: &Stack) -> f64 {
        let impedance = |s| f64::from(self.tissues[self.medium(s).0 as usize].impedance);
        let (z1, z2) = (impedance(before), impedance(after));
        1.0 - ((z2 - z1) / (z2 + z1)).powi(2)
    }

    /// Share of the weight that is left after `t` mm in these media.
    pub(super) fn unabsorbed(&self, media: &Stack, t: f64) -> f64 {
        let tissue = &self.tissues[self.medium(media).0 as usize];
        (-f64::from(tissue.absorption) * t).exp()
    }

    /// Whether echoes are wanted from where these media are.
    pub(super) fn is_heard(&self, media: &Stack) -> bool {
        media.is_heard(self.frame, self.instances)
    }

    fn masks(&self, crossing: &Crossing) -> bool {
        self.instances[crossing.instance as usize].masks != 0
    }

    /// Whether one of `crossings` is with a mask.
    pub(super) fn meets_mask(&self, crossings: &[Crossing]) -> bool {
        crossings.iter().any(|c| self.masks(c))
    }

    /// Where paths begin whose line starts in `media` and goes on through `crossings`: at the last
    /// surface before something is heard. Also how many media were one too many.
    pub(super) fn start(&self, media: Stack, crossings: &[Crossing]) -> (Start, u32) {
        let frame = self.frame;
        let alike = frame.origin_jitter <= 0.0 && frame.emission_lobe <= 0.0;
        let mut start = Start::at_face(media);
        if frame.flags & FLAG_MASKED == 0 || !alike || self.is_heard(&start.media) {
            return (start, 0);
        }
        let first = crossings.iter().find(|c| self.masks(c));
        let Some(first) = first.filter(|c| c.t < f64::from(frame.depth)) else {
            start.weight = 0.0;
            return (start, 0);
        };
        let (mut rest, mut overflow) = (crossings, 0);
        while !rest.is_empty() && rest[0].t <= first.t {
            let toggled = self.toggled(&start.media, rest);
            overflow += toggled.overflow;
            if self.is_heard(&toggled.after) {
                break;
            }
            start.weight *= self.unabsorbed(&start.media, toggled.last - start.travelled);
            if self.medium(&start.media) != self.medium(&toggled.after) {
                start.weight *= self.passed(&start.media, &toggled.after);
                start.interactions += 1;
            }
            start.travelled = toggled.last;
            start.media = toggled.after;
            rest = &rest[toggled.count..];
        }
        (start, overflow)
    }
}
