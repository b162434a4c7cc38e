//! What lies in a mesh: whether it surrounds a point, and the area of its cross-sections.

use std::collections::HashMap;

use glam::DVec3;

use super::Mesh;

/// The solid angle of a ball is 4 pi: a point is inside where the mesh covers more than half of it.
const HALF: f64 = 2.0 * std::f64::consts::PI;

/// A part of the line in which a plane cuts the mesh: what it adds to the area and to the angle round the point.
struct Cut {
    /// The two edges that it runs between.
    edges: [[u32; 2]; 2],
    area: f64,
    angle: f64,
}

impl Mesh {
    fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|v| DVec3::from(self.positions[v as usize].map(f64::from)))
    }

    /// Returns whether the mesh surrounds a place of its space: by the solid angle that it covers there, so that small openings
    /// do no harm (van Oosterom and Strackee 1983, IEEE Trans. Biomed. Eng. 30, 125-126).
    pub fn surrounds(&self, place: DVec3) -> bool {
        let covered: f64 = (self.triangles.iter())
            .map(|&triangle| {
                let [a, b, c] = self.corners(triangle).map(|p| p - place);
                let [la, lb, lc] = [a, b, c].map(DVec3::length);
                let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
                2.0 * a.dot(b.cross(c)).atan2(below)
            })
            .sum();
        covered.abs() > HALF
    }

    /// The area of the cross-section around a place, across a direction; none where the plane cuts no closed line around it.
    pub fn cross_section(&self, place: DVec3, across: DVec3) -> Option<f64> {
        let normal = across.try_normalize()?;
        let cuts: Vec<Cut> =
            self.triangles.iter().filter_map(|&t| self.cut(t, place, normal)).collect();
        // Lines are told apart by the edges that their parts share.
        let mut line: Vec<usize> = (0..cuts.len()).collect();
        fn root(line: &mut [usize], mut i: usize) -> usize {
            while line[i] != i {
                line[i] = line[line[i]];
                i = line[i];
            }
            i
        }
        let mut first: HashMap<[u32; 2], usize> = HashMap::new();
        for (i, cut) in cuts.iter().enumerate() {
            for edge in cut.edges {
                let other = *first.entry(edge).or_insert(i);
                let (a, b) = (root(&mut line, i), root(&mut line, other));
                line[a] = b;
            }
        }
        let mut sums: HashMap<usize, [f64; 2]> = HashMap::new();
        for (i, cut) in cuts.iter().enumerate() {
            let sum = sums.entry(root(&mut line, i)).or_default();
            sum[0] += cut.area;
            sum[1] += cut.angle;
        }
        let around = sums.into_values().filter(|[_, angle]| angle.abs() > std::f64::consts::PI);
        around.map(|[area, _]| area.abs()).min_by(f64::total_cmp)
    }

    fn cut(&self, triangle: [u32; 3], place: DVec3, normal: DVec3) -> Option<Cut> {
        let corners = self.corners(triangle).map(|p| p - place);
        let heights = corners.map(|p| p.dot(normal));
        let mut ends = Vec::with_capacity(2);
        for i in 0..3 {
            let j = (i + 1) % 3;
            if (heights[i] >= 0.0) != (heights[j] >= 0.0) {
                let t = heights[i] / (heights[i] - heights[j]);
                let edge = [triangle[i].min(triangle[j]), triangle[i].max(triangle[j])];
                // Upwards or downwards: the line runs the same way round in all triangles.
                ends.push((corners[i].lerp(corners[j], t), edge, heights[i] >= 0.0));
            }
        }
        let [from, to] = <[_; 2]>::try_from(ends).ok()?;
        let (from, to) = if from.2 { (from, to) } else { (to, from) };
        let area = normal.dot(from.0.cross(to.0));
        Some(Cut { edges: [from.1, to.1], area: area / 2.0, angle: area.atan2(from.0.dot(to.0)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shapes;

    #[test]
    fn a_ball_surrounds_what_lies_in_it_and_is_cut_in_circles() {
        let ball = shapes::sphere(10.0, 5);
        for (place, inside) in [
            (DVec3::ZERO, true),
            (DVec3::new(6.0, 5.0, 5.0), true),
            (DVec3::new(6.0, 6.0, 6.0), false),
            (DVec3::X * 30.0, false),
        ] {
            assert_eq!(ball.surrounds(place), inside, "{place}");
        }
        for across in [DVec3::Z, DVec3::new(1.0, -2.0, 0.5)] {
            let place = across.normalize() * 6.0;
            let area = ball.cross_section(place, across).expect("a circle");
            // 8 mm: flat facets leave out some of it.
            let expected = std::f64::consts::PI * 64.0;
            assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
        }
        assert_eq!(ball.cross_section(DVec3::Z * 11.0, DVec3::Z), None);
        assert_eq!(ball.cross_section(DVec3::ZERO, DVec3::ZERO), None);
        // Beside it in the plane: the line does not run round the place.
        assert_eq!(ball.cross_section(DVec3::X * 12.0, DVec3::Z), None);
    }

    #[test]
    fn of_two_tubes_the_one_around_the_place_is_cut() {
        let mut tubes = shapes::cylinder(3.0, 40.0, 64);
        let count = tubes.positions.len() as u32;
        let other = shapes::cylinder(5.0, 40.0, 64);
        tubes.positions.extend(other.positions.iter().map(|[x, y, z]| [x + 20.0, *y, *z]));
        tubes.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + count)));
        for (x, radius) in [(0.5, 3.0), (21.0, 5.0)] {
            let area = tubes.cross_section(DVec3::X * x, DVec3::Z).expect("a circle");
            let expected: f64 = std::f64::consts::PI * radius * radius;
            assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
        }
    }
}
