//! Sound around the masks of a fused image: it goes straight on, is absorbed, and loses at each surface
//! the part that a fluid interface reflects at normal incidence.

use super::stack::Stack;
use super::world::{Crossing, World};
use insonify::sim::layout::{FLAG_COINCIDENT, FLAG_MASKED};

/// Largest distance of crossings, mm, that can be the same surface.
const COINCIDENT: f64 = 1e-3;

/// The start of the paths of a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Media there.
    pub media: Stack,
    /// Distance along the line, mm.
    pub travelled: f64,
    /// Weight at the start; 0 if nothing of the line is heard.
    pub weight: f64,
    /// Interfaces before the start.
    pub interactions: u32,
}

impl Start {
    /// The line's own start, at the face.
    pub fn at_face(media: Stack) -> Self {
        Self { media, travelled: 0.0, weight: 1.0, interactions: 0 }
    }
}

/// A crossing of one surface, or of two coincident ones.
pub(super) struct Toggled {
    /// The crossing that echoes.
    pub(super) hit: Crossing,
    /// Media behind.
    pub(super) after: Stack,
    /// Distance of the last crossing that counted.
    pub(super) last: f64,
    /// Number of crossings that were counted.
    pub(super) count: usize,
    /// Number of media that did not fit into the stack.
    pub(super) overflow: u32,
}

impl World<'_> {
    /// The change of media at the first of `crossings`.
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
                continue;
            }
            // The couplant ends at the first surface.
            if after.0 == [self.frame.couplant] {
                after.0.clear();
            }
            overflow += u32::from(!after.enter(c.instance));
        }
        Toggled {
            hit: here[0],
            after,
            last: here.iter().map(|c| c.t).fold(nearest.t, f64::max),
            count: here.len(),
            overflow,
        }
    }

    /// Share of the weight transmitted by a surface around the masks between these media.
    pub(super) fn passed(&self, before: &Stack, after: &Stack) -> f64 {
        let impedance = |s| f64::from(self.tissues[self.medium(s).0 as usize].impedance);
        let (z1, z2) = (impedance(before), impedance(after));
        1.0 - ((z2 - z1) / (z2 + z1)).powi(2)
    }

    /// Share of the weight that remains after `t` mm in these media.
    pub(super) fn unabsorbed(&self, media: &Stack, t: f64) -> f64 {
        let tissue = &self.tissues[self.medium(media).0 as usize];
        (-f64::from(tissue.absorption) * t).exp()
    }

    /// True if echoes are wanted from inside these media.
    pub(super) fn is_heard(&self, media: &Stack) -> bool {
        media.is_heard(self.frame, self.instances)
    }

    fn masks(&self, crossing: &Crossing) -> bool {
        self.instances[crossing.instance as usize].masks != 0
    }

    /// True if one of `crossings` is with a mask.
    pub(super) fn meets_mask(&self, crossings: &[Crossing]) -> bool {
        crossings.iter().any(|c| self.masks(c))
    }

    /// The start of the paths of a line that begins in `media` and continues through `crossings`: the last
    /// surface before something is heard. Also the number of media that did not fit into the stack.
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
