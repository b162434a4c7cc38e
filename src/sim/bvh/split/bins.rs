//! Candidate divisions of a node, and the cheapest of them by the surface-area heuristic.

use glam::Vec3A;
use obvhs::aabb::Aabb;

/// Most bins along each axis.
pub(super) const BINS: usize = 32;

/// A division of a node: bin `bin` of at most [`BINS`] along `axis` is the first of the right child.
#[derive(Clone, Copy)]
pub(super) struct Division {
    pub(super) axis: usize,
    pub(super) bin: usize,
    /// The cost: the sum over both children of surface times number of parts.
    pub(super) cost: f32,
    pub(super) children: [Side; 2],
}

/// One child of a division.
#[derive(Clone, Copy)]
pub(super) struct Side {
    pub(super) bounds: Aabb,
    pub(super) parts: usize,
}

pub(super) const NOTHING: Side = Side { bounds: Aabb::INVALID, parts: 0 };

impl Side {
    pub(super) fn cost(self) -> f32 {
        match self.parts {
            0 => 0.0,
            parts => self.bounds.half_area() * parts as f32,
        }
    }

    pub(super) fn grown(self, bounds: &Aabb) -> Self {
        Self { bounds: self.bounds.union(bounds), ..self }
    }

    pub(super) fn without_one(self) -> Self {
        Self { parts: self.parts.saturating_sub(1), ..self }
    }
}

/// Bins: slices of equal thickness along an axis of a box.
pub(super) struct Bins {
    axis: usize,
    count: usize,
    low: f32,
    extent: f32,
}

impl Bins {
    /// The bins for a node of `parts` parts: few parts need few bins.
    pub(super) fn new(bounds: &Aabb, axis: usize, parts: usize) -> Self {
        Self {
            axis,
            count: BINS.min(2 * parts),
            low: bounds.min[axis],
            extent: bounds.max[axis] - bounds.min[axis],
        }
    }

    /// The bin of a point in the box; 0 where the box is flat.
    pub(super) fn of(&self, point: Vec3A) -> usize {
        let slice = (point[self.axis] - self.low) * (self.count as f32 / self.extent);
        (slice as usize).min(self.count - 1)
    }

    /// The coordinate at which slice `bin` begins.
    pub(super) fn plane(&self, bin: usize) -> f32 {
        self.low + self.extent * (bin as f32 / self.count as f32)
    }

    /// The cheapest division between two bins. `entering` has box and number of the parts that begin in each bin,
    /// `leaving` the number that end there. Both children together may have at most `most` parts.
    pub(super) fn best(
        &self,
        entering: &[Side],
        leaving: &[usize],
        most: usize,
    ) -> Option<Division> {
        let mut high = [NOTHING; BINS];
        let mut all = NOTHING;
        for bin in (1..self.count).rev() {
            all = all.grown(&entering[bin].bounds);
            all.parts += leaving[bin];
            high[bin] = all;
        }
        let mut low = NOTHING;
        let divisions = (1..self.count).map(|bin| {
            low = low.grown(&entering[bin - 1].bounds);
            low.parts += entering[bin - 1].parts;
            Division {
                axis: self.axis,
                bin,
                cost: low.cost() + high[bin].cost(),
                children: [low, high[bin]],
            }
        });
        cheapest(divisions.filter(|d| {
            let [low, high] = d.children.map(|side| side.parts);
            low > 0 && high > 0 && low + high <= most
        }))
    }
}

pub(super) fn cheapest(divisions: impl Iterator<Item = Division>) -> Option<Division> {
    divisions.min_by(|a, b| a.cost.total_cmp(&b.cost))
}
