//! Measurements in the image plane, mm lateral and mm deep.

use std::f64::consts::PI;

use glam::DVec2;
use serde::{Deserialize, Serialize};

pub use insonify_lab::exam::CaliperKind;
use insonify_lab::exam::Measured;

/// Result of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// Length, mm.
    Distance(f64),
    /// Size of an ellipse.
    Ellipse {
        /// Both axes, mm, in the order in which they were drawn.
        axes: [f64; 2],
        /// Circumference, mm.
        circumference: f64,
        /// Area, mm^2.
        area: f64,
    },
    /// Angle, 0 to 180 degrees.
    Angle(f64),
    /// Size of a traced outline.
    Trace {
        /// Circumference, mm.
        circumference: f64,
        /// Area, mm^2.
        area: f64,
    },
}

/// A measurement and its points, as many as [`CaliperKind::points`] says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Caliper {
    /// Kind of the measurement.
    pub kind: CaliperKind,
    /// Its points, mm. The third point of an ellipse lies on its second axis.
    pub points: Vec<DVec2>,
    /// Its name, or an empty text.
    pub label: String,
}

impl Caliper {
    /// A measurement without a name.
    ///
    /// # Panics
    /// When there are not as many points as `kind` takes: of a trace, three.
    pub fn new(kind: CaliperKind, points: Vec<DVec2>) -> Self {
        assert!(kind.points().map_or(points.len() >= 3, |count| points.len() == count));
        let mut made = Self { kind, points, label: String::new() };
        made.settle();
        made
    }

    /// Moves a point. The second axis of an ellipse keeps its length when an end of the first moves.
    pub fn drag(&mut self, point: usize, to: DVec2) {
        let width = self.half_width();
        self.points[point] = to;
        if self.kind == CaliperKind::Ellipse && point < 2 {
            self.points[2] = self.centre() + width * self.normal();
        }
        self.settle();
    }

    /// Moves all points.
    pub fn shift(&mut self, by: DVec2) {
        for point in &mut self.points {
            *point += by;
        }
    }

    /// Result of the measurement.
    pub fn reading(&self) -> Reading {
        let p = &self.points;
        match self.kind {
            CaliperKind::Distance => Reading::Distance(p[0].distance(p[1])),
            CaliperKind::Ellipse => {
                let [a, b] = [p[0].distance(p[1]) / 2.0, self.half_width().abs()];
                Reading::Ellipse {
                    axes: [2.0 * a, 2.0 * b],
                    circumference: circumference(a, b),
                    area: PI * a * b,
                }
            }
            CaliperKind::Angle => {
                let arms = [p[0] - p[1], p[2] - p[1]];
                let is_drawn = arms.iter().all(|arm| arm.length() > 0.0);
                let angle = if is_drawn { arms[0].angle_to(arms[1]) } else { 0.0 };
                Reading::Angle(angle.abs().to_degrees())
            }
            CaliperKind::Trace => {
                let next = |i: usize| p[(i + 1) % p.len()];
                let sides = p.iter().enumerate().map(|(i, point)| (*point, next(i)));
                let (around, twice) = sides.fold((0.0, 0.0), |(around, twice), (a, b)| {
                    (around + a.distance(b), twice + a.perp_dot(b))
                });
                Reading::Trace { circumference: around, area: f64::abs(twice) / 2.0 }
            }
        }
    }

    /// The measurement for the worksheet.
    pub fn measured(&self) -> Measured {
        let mut out = Measured { name: self.label.clone(), ..Measured::default() };
        match self.reading() {
            Reading::Distance(mm) => out.length = Some(mm),
            Reading::Angle(degrees) => out.angle = Some(degrees),
            Reading::Ellipse { circumference, area, .. }
            | Reading::Trace { circumference, area } => {
                (out.circumference, out.area) = (Some(circumference), Some(area));
            }
        }
        if self.kind == CaliperKind::Trace {
            out.outline.clone_from(&self.points);
        }
        out
    }

    /// A point of the outline of an ellipse, `angle` radians from the first end of its first axis.
    pub fn outline(&self, angle: f64) -> DVec2 {
        let (sin, cos) = angle.sin_cos();
        let centre = self.centre();
        centre + cos * (self.points[0] - centre) + sin * (self.points[2] - centre)
    }

    fn centre(&self) -> DVec2 {
        (self.points[0] + self.points[1]) / 2.0
    }

    /// Unit normal of the first axis; downwards while that has no length.
    fn normal(&self) -> DVec2 {
        let axis = self.points[1] - self.points[0];
        axis.perp().normalize_or(DVec2::Y)
    }

    fn half_width(&self) -> f64 {
        match self.kind {
            CaliperKind::Ellipse => (self.points[2] - self.centre()).dot(self.normal()),
            CaliperKind::Distance | CaliperKind::Angle | CaliperKind::Trace => 0.0,
        }
    }

    /// Puts the third point of an ellipse onto its second axis.
    fn settle(&mut self) {
        if self.kind == CaliperKind::Ellipse {
            self.points[2] = self.centre() + self.half_width() * self.normal();
        }
    }
}

/// Circumference of an ellipse with half axes `a` and `b`, by the arithmetic-geometric mean (Abramowitz
/// and Stegun, Handbook of Mathematical Functions, 17.3.3 and 17.6.4): exact to rounding.
fn circumference(a: f64, b: f64) -> f64 {
    let (large, small) = (a.max(b), a.min(b));
    if small <= 0.0 {
        return 4.0 * large;
    }
    let (mut mean, mut root) = (large, small);
    let (mut sum, mut weight) = (large * large - (large * large - small * small) / 2.0, 1.0);
    // Each step doubles the digits.
    for _ in 0..64 {
        let half = (mean - root) / 2.0;
        (mean, root) = ((mean + root) / 2.0, (mean * root).sqrt());
        sum -= weight * half * half;
        weight *= 2.0;
        if half <= mean * 1e-16 {
            break;
        }
    }
    2.0 * PI * sum / mean
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::{DVec2, dvec2};

    use super::{Caliper, CaliperKind, Reading, circumference};

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{a} {b}");
    }

    fn made(kind: CaliperKind, points: &[[f64; 2]]) -> Caliper {
        Caliper::new(kind, points.iter().map(|&p| DVec2::from(p)).collect())
    }

    #[test]
    fn distances_are_those_of_pythagoras() {
        for (points, expected) in [
            ([[0.0, 10.0], [30.0, 10.0]], 30.0),
            ([[5.0, 10.0], [5.0, 52.5]], 42.5),
            ([[-1.0, 2.0], [2.0, 6.0]], 5.0),
            ([[1.0, 1.0], [1.0, 1.0]], 0.0),
        ] {
            let Reading::Distance(mm) = made(CaliperKind::Distance, &points).reading() else {
                panic!("a distance");
            };
            close(mm, expected);
        }
    }

    #[test]
    fn angles_lie_between_their_arms() {
        for (points, expected) in [
            ([[1.0, 0.0], [0.0, 0.0], [0.0, 7.0]], 90.0),
            ([[2.0, 2.0], [0.0, 0.0], [5.0, 0.0]], 45.0),
            ([[-3.0, 1.0], [0.0, 1.0], [9.0, 1.0]], 180.0),
            ([[3.0, 1.0], [0.0, 1.0], [9.0, 1.0]], 0.0),
            ([[0.0, 1.0], [0.0, 1.0], [9.0, 1.0]], 0.0),
            // On both sides of the arc tangent's branch cut.
            ([[-1.0, 0.1], [0.0, 0.0], [-1.0, -0.1]], 2.0 * 0.1_f64.atan().to_degrees()),
        ] {
            let Reading::Angle(degrees) = made(CaliperKind::Angle, &points).reading() else {
                panic!("an angle");
            };
            close(degrees, expected);
        }
    }

    #[test]
    fn an_ellipse_is_measured_along_its_axes() {
        // The third point need not lie on the second axis: only its distance from the first axis counts.
        let drawn = made(CaliperKind::Ellipse, &[[10.0, 20.0], [10.0, 50.0], [18.0, 24.0]]);
        assert_eq!(drawn.points[2], dvec2(18.0, 35.0));
        let Reading::Ellipse { axes, circumference, area } = drawn.reading() else {
            panic!("an ellipse");
        };
        assert_eq!(axes, [30.0, 16.0]);
        close(area, PI * 15.0 * 8.0);
        // Compared with the drawn outline: the polygon's error falls with the square of its sides.
        let sides = 20_000;
        let at = |i| drawn.outline(2.0 * PI * f64::from(i) / f64::from(sides));
        let length: f64 = (0..sides).map(|i| at(i).distance(at(i + 1))).sum();
        assert!((length - circumference).abs() < 1e-6, "{length} {circumference}");
        // An end moves the second axis with it, unchanged.
        let mut moved = drawn.clone();
        moved.drag(1, dvec2(40.0, 20.0));
        let Reading::Ellipse { axes, .. } = moved.reading() else {
            panic!("an ellipse");
        };
        close(axes[0], 30.0);
        close(axes[1], 16.0);
        close(moved.points[2].x, 25.0);
        moved.shift(dvec2(1.0, -1.0));
        close(moved.points[2].x, 26.0);
    }

    #[test]
    fn a_trace_is_measured_along_its_sides() {
        let square = made(CaliperKind::Trace, &[[1.0, 1.0], [1.0, 4.0], [4.0, 4.0], [4.0, 1.0]]);
        assert_eq!(square.reading(), Reading::Trace { circumference: 12.0, area: 9.0 });
        let circle: Vec<DVec2> =
            (0..2000).map(|i| 25.0 * DVec2::from_angle(PI * f64::from(i) / 1000.0)).collect();
        let measured = Caliper::new(CaliperKind::Trace, circle).measured();
        assert!((measured.area.expect("closed") / (625.0 * PI) - 1.0).abs() < 1e-5);
        assert!((measured.circumference.expect("closed") / (50.0 * PI) - 1.0).abs() < 1e-5);
        assert_eq!(measured.outline.len(), 2000);
    }

    #[test]
    fn circumferences_are_exact() {
        close(circumference(7.0, 7.0), 14.0 * PI);
        close(circumference(7.0, 0.0), 28.0);
        assert_eq!(circumference(0.0, 0.0), 0.0);
        close(circumference(3.0, 8.0), circumference(8.0, 3.0));
        for (a, b) in [(1.0_f64, 0.9), (48.0, 36.0), (10.0, 1.0), (5.0, 0.05)] {
            // The integral of the speed along the outline; the trapezium rule is exact to rounding
            // for a smooth period.
            let steps = 20_000;
            let speed = |i: i32| {
                let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(steps)).sin_cos();
                (a * sin).hypot(b * cos)
            };
            let sum: f64 = (0..steps).map(speed).sum();
            let integral = sum * 2.0 * PI / f64::from(steps);
            let found = circumference(a, b);
            assert!((found - integral).abs() < 1e-9 * integral, "{a} {b}: {found} {integral}");
        }
    }
}
