//! A vessel with its branches, through which one flow runs.

use glam::{DMat3, DVec3};

use super::line::{CentreLine, Nearest};

/// Flattest profile, as an exponent, whose shear at the wall generations of scatterers bear. Of a flatter one that counts
/// which it has at [`CORE`] of its radius: the layer beyond loses scatterers before they are renewed, instead of all of the vessel
/// being renewed for its sake.
const FLATTEST: f64 = 4.0;
/// Share of the radius of a flat profile within which its shear counts.
const CORE: f64 = 0.9;
/// How much more a change of speed along the vessel counts than one across it: what flows is carried straight on, by the speed
/// where it rests, so that by the end of a generation's life its speed has to be the same to a quarter.
const ALONG: f64 = 6.0;
/// Parts of a piece of a centre line at which its speed is looked at.
const PARTS: usize = 8;
/// Share of its radius by which a branch may begin beside the end of its parent and still be one of those into which it divides.
const AT_END: f64 = 0.1;

/// A tube with its branches. What flows in the first line shares itself out at each junction by the cross-sections in
/// which the branches begin, and in which the parent goes on: no blood is lost.
#[derive(Clone, Debug, PartialEq)]
pub struct Vessel {
    /// The root, then branches, each behind its parent.
    branches: Vec<Branch>,
}

/// One line of a vessel.
#[derive(Clone, Debug, PartialEq)]
struct Branch {
    line: CentreLine,
    /// Exponent of the profile at each point.
    exponents: Vec<f64>,
    /// Share of the root's rate of flow where it begins.
    share: f64,
    /// Junctions along it: place, in points, and the share of the root's flow that goes on behind it.
    junctions: Vec<(f64, f64)>,
    /// True where the line goes straight on beyond its beginning and its end.
    open: [bool; 2],
}

/// A place along a line of a vessel.
struct Part {
    place: DVec3,
    radius: f64,
    /// Speed of the middle over that of the root's beginning.
    axis: f64,
    /// Its change along the line, per unit of length.
    change: f64,
    exponent: f64,
}

/// A line of a vessel as it is given.
#[derive(Clone, Debug, PartialEq)]
pub struct Tube {
    /// The centre line, with the tube's radii.
    pub line: CentreLine,
    /// Exponent K of the profile 1 - (r/R)^K at each point: 2 is Poiseuille's parabola, more is flatter.
    pub exponents: Vec<f64>,
}

/// Why lines are no vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Index of the line that begins on none before it.
    pub line: usize,
    /// Distance to the nearest one's wall, in the mesh's own units.
    pub gap: f64,
}

impl Tube {
    /// A tube whose profile has the same exponent everywhere.
    pub fn new(line: CentreLine, exponent: f64) -> Self {
        Self { exponents: vec![exponent; line.points().len()], line }
    }
}

impl Vessel {
    /// A vessel of one tube.
    pub fn tube(line: CentreLine, exponent: f64) -> Self {
        Self::new(vec![Tube::new(line, exponent)]).expect("one line needs no other")
    }

    /// The vessel of these lines: the root first, and each branch behind the line in whose tube it begins.
    ///
    /// # Errors
    /// A branch that begins in no line before it.
    ///
    /// # Panics
    /// Without a line, or with exponents that are not one for each point.
    pub fn new(tubes: Vec<Tube>) -> Result<Self, Apart> {
        assert!(!tubes.is_empty(), "a vessel has a root");
        // Parent of each line behind the first, and the place on it.
        let mut parents = Vec::new();
        for (i, tube) in tubes.iter().enumerate().skip(1) {
            let begin = tube.line.points()[0];
            let near = tubes[..i].iter().map(|t| t.line.nearest(begin, [false; 2])).enumerate();
            let gap = |near: &Nearest| near.distance - near.radius;
            let (parent, near) =
                near.min_by(|a, b| gap(&a.1).total_cmp(&gap(&b.1))).expect("the root");
            if gap(&near) > 0.0 {
                return Err(Apart { line: i, gap: gap(&near) });
            }
            let end = (tubes[parent].line.points().len() - 1) as f64;
            let last = tubes[parent].line.at(end);
            let ends = last.0.distance(begin) <= AT_END * last.1;
            parents.push((parent, if ends { end } else { near.place }));
        }
        let whole = tubes.into_iter().map(|Tube { line, exponents }| {
            assert_eq!(exponents.len(), line.points().len(), "an exponent for each point");
            Branch { line, exponents, share: 1.0, junctions: Vec::new(), open: [true; 2] }
        });
        let mut vessel = Self { branches: whole.collect() };
        for parent in 0..vessel.branches.len() {
            vessel.share_out(parent, &parents);
        }
        Ok(vessel)
    }

    /// Shares the flow of a line out among those that begin on it.
    fn share_out(&mut self, parent: usize, parents: &[(usize, f64)]) {
        let own = parents.iter().enumerate().filter(|(_, (of, _))| *of == parent);
        let mut children: Vec<(f64, usize)> = own.map(|(i, (_, at))| (*at, i + 1)).collect();
        children.sort_by(|a, b| a.0.total_cmp(&b.0));
        let last = (self.branches[parent].line.points().len() - 1) as f64;
        let mut arriving = self.branches[parent].share;
        for together in children.chunk_by(|a, b| a.0 == b.0) {
            let at = together[0].0;
            let goes_on = match at < last {
                true => self.branches[parent].line.at(at).1.powi(2),
                false => 0.0,
            };
            let area = |child: usize| self.branches[child].line.radius().powi(2);
            let areas: Vec<f64> = together.iter().map(|(_, child)| area(*child)).collect();
            let per_area = arriving / (goes_on + areas.iter().sum::<f64>());
            for ((_, child), area) in together.iter().zip(areas) {
                self.branches[*child].share = per_area * area;
                self.branches[*child].open[0] = false;
            }
            arriving = per_area * goes_on;
            let branch = &mut self.branches[parent];
            branch.junctions.push((at, arriving));
            branch.open[1] &= at < last;
        }
    }

    /// Number of lines.
    pub fn lines(&self) -> usize {
        self.branches.len()
    }

    /// A line, and the share of the root's rate of flow that runs through it where it begins.
    pub fn line(&self, i: usize) -> (&CentreLine, f64) {
        (&self.branches[i].line, self.branches[i].share)
    }

    /// Velocity over the speed in the middle of the root's beginning, in the directions of the space to which `placed` brings the
    /// mesh. Where tubes overlap, as at a junction, it is the mean of theirs, weighted by their profiles: so it is
    /// continuous, and blood stands still only where it is outside of all.
    pub fn velocity(&self, place: DVec3, placed: &DMat3) -> DVec3 {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for branch in &self.branches {
            let near = branch.line.nearest(place, branch.open);
            if near.distance >= near.radius {
                continue;
            }
            let exponent = branch.exponent(near.place);
            let profile = 1.0 - (near.distance / near.radius).powf(exponent);
            let axis = self.axis(branch, near.place, near.radius);
            sum += profile * (axis * profile) * (*placed * near.along).normalize_or_zero();
            weights += profile;
        }
        match weights > 0.0 {
            true => sum / weights,
            false => DVec3::ZERO,
        }
    }

    /// Speed in the middle of a branch over that in the middle of the root's beginning, as the rates of flow say.
    fn axis(&self, branch: &Branch, at: f64, radius: f64) -> f64 {
        let root = &self.branches[0];
        // Rate of flow of a tube whose middle has the speed 1, over pi.
        let rate = |radius: f64, exponent: f64| radius.powi(2) * exponent / (exponent + 2.0);
        branch.share(at) * rate(root.line.radius(), root.exponents[0])
            / rate(radius, branch.exponent(at))
    }

    /// Places along the lines.
    fn parts(&self) -> impl Iterator<Item = Part> + '_ {
        self.branches.iter().flat_map(move |branch| {
            let last = (branch.line.points().len() - 1) * PARTS;
            let at = |i: usize| {
                let at = i as f64 / PARTS as f64;
                let (place, radius) = branch.line.at(at);
                (place, radius, self.axis(branch, at, radius), branch.exponent(at))
            };
            (0..=last).map(move |i| {
                let (place, radius, axis, exponent) = at(i);
                let (next, _, later, _) = at(if i == last { i - 1 } else { i + 1 });
                let change = (later - axis).abs() / next.distance(place);
                Part { place, radius, axis, change, exponent }
            })
        })
    }

    /// Largest speed over that of the root's beginning, and its largest change per unit of length by which generations are renewed;
    /// of the parts of the lines that `within` holds, or of all where it holds none.
    pub fn extremes(&self, within: impl Fn(DVec3) -> bool) -> (f64, f64) {
        let most = |all: bool| {
            let parts = self.parts().filter(|part| all || within(part.place));
            parts.fold((0.0, 0.0), |(speed, shear), part| {
                let steep = match part.exponent <= FLATTEST {
                    true => part.exponent,
                    false => FLATTEST.min(part.exponent * CORE.powf(part.exponent - 1.0)),
                };
                let change = f64::max(part.axis * steep / part.radius, ALONG * part.change);
                (f64::max(speed, part.axis), f64::max(shear, change))
            })
        };
        let own = most(false);
        if own.0 > 0.0 { own } else { most(true) }
    }

    /// The narrowest radius of the parts of the lines that `within` holds, or of all where it holds none.
    pub fn narrowest(&self, within: impl Fn(DVec3) -> bool) -> f64 {
        let least = |all: bool| {
            let parts = self.parts().filter(|part| all || within(part.place));
            parts.map(|part| part.radius).fold(f64::INFINITY, f64::min)
        };
        let own = least(false);
        if own.is_finite() { own } else { least(true) }
    }
}

impl Branch {
    /// Exponent of the profile at a place along the line, in points.
    fn exponent(&self, at: f64) -> f64 {
        let i = (at as usize).min(self.exponents.len() - 2);
        let t = at - i as f64;
        self.exponents[i] + t * (self.exponents[i + 1] - self.exponents[i])
    }

    /// Share of the root's rate of flow at a place along the line, in points.
    fn share(&self, at: f64) -> f64 {
        let passed = self.junctions.iter().rev().find(|(junction, _)| *junction < at);
        passed.map_or(self.share, |(_, share)| *share)
    }
}

#[cfg(test)]
#[path = "vessel/tests.rs"]
mod tests;
