//! Volumes of the left ventricle and of organs, from lengths and outlines. Lengths in mm, volumes in ml.

use std::f64::consts::PI;

use glam::DVec2;

/// Discs into which an outline is cut: Lang et al., J Am Soc Echocardiogr 2015;28:1-39.
const DISCS: usize = 20;
/// mm^3 of a ml.
const ML: f64 = 1000.0;

/// Volume from the inner diameter, ml: Teichholz et al., Am J Cardiol 1976;37:7-11; compared with two transcriptions
/// (`docs/exam.md`).
pub fn teichholz(diameter: f64) -> f64 {
    let d = diameter / 10.0;
    7.0 / (2.4 + d) * d.powi(3)
}

/// Part of `before` that is gone `after`, percent: ejection fraction of volumes, shortening of diameters.
pub fn lost(before: f64, after: f64) -> f64 {
    100.0 * (before - after) / before
}

/// Volume of an ellipsoid from its three axes, ml.
pub fn ellipsoid([a, b, c]: [f64; 3]) -> f64 {
    PI / 6.0 * a * b * c / ML
}

/// A ventricle's outline in discs.
#[derive(Clone, Debug, PartialEq)]
pub struct Discs {
    /// From the middle of the annulus to the apex, mm.
    pub length: f64,
    diameters: [f64; DISCS],
}

impl Discs {
    /// Cuts a traced outline, mm. Its first and last point are the ends of the annulus; the apex is the point farthest
    /// from the middle between them. None of fewer than three points, or of an outline without length.
    pub fn of(outline: &[DVec2]) -> Option<Self> {
        let (first, last) = (*outline.first()?, *outline.last()?);
        let annulus = (first + last) / 2.0;
        let far = |p: &&DVec2| p.distance(annulus);
        let apex = *outline.iter().max_by(|a, b| far(a).total_cmp(&far(b)))?;
        let length = apex.distance(annulus);
        if outline.len() < 3 || length == 0.0 {
            return None;
        }
        let along = (apex - annulus) / length;
        let local: Vec<DVec2> =
            outline.iter().map(|p| (*p - annulus).rotate(DVec2::new(along.x, -along.y))).collect();
        let diameter = |disc: usize| {
            let at = (disc as f64 + 0.5) / DISCS as f64 * length;
            let sides = local.windows(2).map(|pair| [pair[0], pair[1]]);
            let closed = sides.chain([[local[local.len() - 1], local[0]]]);
            let crossed = closed.filter(|[a, b]| (a.x <= at) != (b.x <= at));
            let offsets = crossed.map(|[a, b]| a.y + (at - a.x) / (b.x - a.x) * (b.y - a.y));
            let (low, high) = offsets.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
                (low.min(y), high.max(y))
            });
            (high - low).max(0.0)
        };
        Some(Self { length, diameters: std::array::from_fn(diameter) })
    }

    /// Volume from this plane alone, every disc round, ml.
    pub fn volume(&self) -> f64 {
        self.with(self)
    }

    /// Volume from two planes at a right angle, every disc an ellipse, ml; the longer one gives the length.
    pub fn with(&self, other: &Self) -> f64 {
        let pairs = self.diameters.iter().zip(&other.diameters);
        let areas: f64 = pairs.map(|(a, b)| PI / 4.0 * a * b).sum();
        areas * self.length.max(other.length) / DISCS as f64 / ML
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    /// Half an ellipse from annulus to annulus, turned and shifted.
    fn half(radius: f64, length: f64) -> Vec<DVec2> {
        let turn = DVec2::from_angle(0.7);
        (0..=400)
            .map(|i| {
                let (sin, cos) = (PI * f64::from(i) / 400.0).sin_cos();
                dvec2(40.0, 60.0) + turn.rotate(dvec2(length * sin, radius * cos))
            })
            .collect()
    }

    #[test]
    fn diameters_give_the_volumes_of_teichholz() {
        // Values of published normal ventricles: 50 mm hold 118 ml, 48 and 30 mm eject 60 to 72 %.
        assert_eq!(teichholz(50.0).round(), 118.0);
        assert!((60.0..=72.0).contains(&lost(teichholz(48.0), teichholz(30.0))));
        assert!((teichholz(50.0) - 875.0 / 7.4).abs() < 1e-9);
        assert!((teichholz(30.0) - 35.0).abs() < 1e-9);
        assert!((lost(teichholz(50.0), teichholz(30.0)) - 70.4).abs() < 0.01);
        assert_eq!(lost(50.0, 30.0), 40.0);
    }

    #[test]
    fn discs_of_half_an_ellipsoid_have_its_volume() {
        let (round, other) = (half(22.0, 80.0), half(18.0, 80.0));
        let of = |outline: &[DVec2]| Discs::of(outline).expect("an outline");
        let exact = |a: f64, b: f64| 2.0 / 3.0 * PI * a * b * 80.0 / ML;
        // The midpoint rule over 20 discs is off by 1/(8 n^2) of a paraboloid's end.
        let (single, both) = (of(&round).volume(), of(&round).with(&of(&other)));
        assert!((single / exact(22.0, 22.0) - 1.0).abs() < 2e-3, "{single}");
        assert!((both / exact(22.0, 18.0) - 1.0).abs() < 2e-3, "{both}");
        assert!((of(&round).length - 80.0).abs() < 1e-9);
        // A plane that is a tenth too wide is told apart.
        assert!((of(&half(24.2, 80.0)).volume() / exact(22.0, 22.0) - 1.21).abs() < 3e-3);
    }

    #[test]
    fn what_is_no_outline_has_no_discs() {
        assert_eq!(Discs::of(&[]), None);
        assert_eq!(Discs::of(&[DVec2::ZERO, DVec2::X]), None);
        assert_eq!(Discs::of(&[DVec2::ONE; 5]), None);
    }

    #[test]
    fn three_axes_make_an_ellipsoid() {
        assert!((ellipsoid([20.0; 3]) - 4.0 / 3.0 * PI).abs() < 1e-12);
    }
}
