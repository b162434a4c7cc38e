//! The centre line of a tube.

use glam::DVec3;

/// A line of straight parts with the tube's radius at each point, in the mesh's space.
#[derive(Clone, Debug, PartialEq)]
pub struct CentreLine {
    /// At least two.
    points: Vec<DVec3>,
    /// One per point, above zero.
    radii: Vec<f64>,
    /// Unit direction at each point: that of the parts on both sides.
    directions: Vec<DVec3>,
}

/// The place of a centre line nearest to another place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Place along the line, in points: 1.5 is half-way between the second and the third.
    pub place: f64,
    /// Distance from there.
    pub distance: f64,
    /// Unit direction of the line there.
    pub along: DVec3,
    /// Radius of the tube there.
    pub radius: f64,
}

impl CentreLine {
    /// The line through `points`; none where there are fewer than two, two that follow each other are the same, or a radius
    /// is not above zero.
    pub fn new(points: Vec<DVec3>, radii: Vec<f64>) -> Option<Self> {
        let parts: Vec<DVec3> =
            points.windows(2).map(|ends| (ends[1] - ends[0]).normalize_or_zero()).collect();
        let sound = !parts.is_empty() && parts.iter().all(|part| *part != DVec3::ZERO);
        let wide = radii.len() == points.len() && radii.iter().all(|radius| *radius > 0.0);
        if !sound || !wide {
            return None;
        }
        let last = parts.len() - 1;
        let direction = |i: usize| {
            let [before, behind] = [parts[i.saturating_sub(1)], parts[i.min(last)]];
            (before + behind).try_normalize().unwrap_or(behind)
        };
        Some(Self { directions: (0..points.len()).map(direction).collect(), points, radii })
    }

    /// Its points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Radii of the tube at its points.
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// Radius of the tube where it begins: that in which the flow's speed is stated.
    pub fn radius(&self) -> f64 {
        self.radii[0]
    }

    /// A place along the line, in points, in the mesh's space, and the radius there.
    pub fn at(&self, place: f64) -> (DVec3, f64) {
        let i = (place.max(0.0) as usize).min(self.points.len() - 2);
        let on = place - i as f64;
        let radius = self.radii[i] + on * (self.radii[i + 1] - self.radii[i]);
        (self.points[i].lerp(self.points[i + 1], on), radius)
    }

    /// The place on the line nearest to `place`. `open` says whether it goes straight on beyond its beginning and its end.
    pub fn nearest(&self, place: DVec3, open: [bool; 2]) -> Nearest {
        let last = self.points.len() - 2;
        let parts = self.points.windows(2).enumerate().map(|(i, ends)| {
            let part = ends[1] - ends[0];
            let on = (place - ends[0]).dot(part) / part.length_squared();
            let low = if i == 0 && open[0] { f64::NEG_INFINITY } else { 0.0 };
            let high = if i == last && open[1] { f64::INFINITY } else { 1.0 };
            let on = on.clamp(low, high);
            (i, on, place.distance_squared(ends[0] + on * part))
        });
        let (i, on, squared) = parts.min_by(|a, b| a.2.total_cmp(&b.2)).expect("two points");
        let on = on.clamp(0.0, 1.0);
        let along = self.directions[i].lerp(self.directions[i + 1], on);
        Nearest {
            place: i as f64 + on,
            distance: squared.sqrt(),
            along: along.try_normalize().unwrap_or(self.directions[i]),
            radius: self.radii[i] + on * (self.radii[i + 1] - self.radii[i]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_is_followed_and_the_ends_go_straight_on() {
        let points = vec![DVec3::ZERO, DVec3::Z * 10.0, DVec3::new(10.0, 0.0, 10.0)];
        let line = CentreLine::new(points, vec![4.0, 2.0, 1.0]).expect("a line");
        let open = [true; 2];
        let near = line.nearest(DVec3::new(0.0, 3.0, -5.0), open);
        assert_eq!((near.distance, near.along, near.radius), (3.0, DVec3::Z, 4.0));
        let near = line.nearest(DVec3::new(12.0, 0.0, 9.0), open);
        assert_eq!((near.distance, near.along, near.radius), (1.0, DVec3::X, 1.0));
        // A line that does not go on ends in a cap.
        let near = line.nearest(DVec3::new(0.0, 3.0, -4.0), [false, true]);
        assert_eq!((near.distance, near.along, near.place), (5.0, DVec3::Z, 0.0));
        let near = line.nearest(DVec3::new(0.0, 0.0, 10.0), open);
        assert!(near.along.abs_diff_eq(DVec3::new(1.0, 0.0, 1.0).normalize(), 1e-12));
        let near = line.nearest(DVec3::new(0.0, 0.0, 5.0), open);
        assert_eq!((near.radius, near.place), (3.0, 0.5));
        assert_eq!(line.at(0.5), (DVec3::Z * 5.0, 3.0));
    }

    #[test]
    fn what_is_no_line_is_refused() {
        let (a, b) = (DVec3::ZERO, DVec3::X);
        assert!(CentreLine::new(vec![a], vec![1.0]).is_none());
        assert!(CentreLine::new(vec![a, a], vec![1.0; 2]).is_none());
        assert!(CentreLine::new(vec![a, b], vec![1.0, 0.0]).is_none());
        assert!(CentreLine::new(vec![a, b], vec![1.0, f64::NAN]).is_none());
        assert!(CentreLine::new(vec![a, b], vec![1.0]).is_none());
    }
}
