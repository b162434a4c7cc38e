//! Fit of points to a surface, although part of them may not belong to it.
//!
//! Iterative closest points, as a least-squares problem (Fitzgibbon, Image and Vision Computing 21, 2003):
//! each point's distance from the surface goes through Tukey's biweight, whose cutoff follows from the
//! median distance and only ever shrinks, and Levenberg and Marquardt's method lowers their sum. So points
//! far off have no pull, and no step makes the fit worse.

use glam::{DAffine3, DQuat, DVec3};
use rayon::prelude::*;

use super::symmetric::{Square, eigen};
use super::{Transformation, TriangleSurface, scale_of};
use crate::issue::FileError;
use crate::statistics::Statistics;

/// Fewest points.
pub const MIN_POINTS: usize = 10;

/// Most steps.
const MOST_STEPS: usize = 300;
/// Largest movement of a typical point, mm, at which the search ends.
const CONVERGED: f64 = 1e-5;
/// Biweight cutoff in standard deviations: 95 % efficient on normal errors (Holland and Welsch 1977).
const BIWEIGHT_CUTOFF: f64 = 4.685;
/// Standard deviation over median magnitude of a normal distribution.
const DEVIATION_PER_MEDIAN: f64 = 1.4826;
/// Least cutoff, mm: below it distances are rounding.
const LEAST_CUTOFF: f64 = 1e-6;
/// Least and greatest scale of a similarity. A cloud of points that shrinks onto a spot of the surface
/// fits it perfectly.
const SCALES: (f64, f64) = (0.5, 2.0);
/// Mean squared change of distance by a unit motion below which the surface does not determine the motion.
const UNDETERMINED: f64 = 1e-3;

/// Number of components of a motion: shift, rotation and growth, all in mm of a typical point's movement.
const DEGREES_OF_FREEDOM: usize = 7;
type Motion = [f64; DEGREES_OF_FREEDOM];

/// Result of a fit of points to a surface.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Transform of the points to the surface: a similarity, never a reflection.
    pub transform: DAffine3,
    /// Remaining distances.
    pub residuals: Residuals,
    /// Number of steps.
    pub rounds: usize,
    /// True where it ended at a minimum and not at the limit of steps.
    pub settled: bool,
    /// Motions that the surface leaves open, in words; along them the points are where they started.
    pub loose: Vec<String>,
}

/// Distances of points from a surface, mm. Points beyond the cutoff count as foreign, and rms, median and
/// 95 % are of the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// Number of points.
    pub points: usize,
    /// Number of points that count.
    pub kept: usize,
    /// Distance from which on a point does not count.
    pub cutoff: f64,
    /// Root mean square.
    pub rms: f64,
    /// Median: half of them are nearer.
    pub median: f64,
    /// 95th percentile: 95 of 100 are nearer.
    pub p95: f64,
}

impl Residuals {
    fn of(matched: &[MatchedPoint], cutoff: f64) -> Self {
        let near: Vec<f64> = matched.iter().map(|m| m.off).filter(|d| *d < cutoff).collect();
        let statistics = Statistics::of(near.iter().copied());
        let squares: f64 = near.iter().map(|d| d * d).sum();
        Self {
            points: matched.len(),
            kept: near.len(),
            cutoff,
            rms: (squares / near.len() as f64).sqrt(),
            median: statistics.median,
            p95: statistics.p95,
        }
    }

    /// Share of the points that do not count.
    pub fn trimmed(&self) -> f64 {
        1.0 - self.kept as f64 / self.points as f64
    }
}

/// A point at its present place, and its nearest point of the surface.
struct MatchedPoint {
    at: DVec3,
    /// Unit vector from the surface to the point.
    away: DVec3,
    /// Distance.
    off: f64,
}

/// Fits `points` to `surface`, beginning with `start`: finds the nearest minimum. More than half of the points
/// have to belong to the surface, of which they may cover a part.
///
/// # Errors
/// Fewer than [`MIN_POINTS`] points, points that are no numbers or coincide; a start farther off than
/// the surface is large; a similarity that more than doubles or halves the scale.
pub fn fit(
    points: &[DVec3],
    surface: &TriangleSurface,
    start: DAffine3,
    transformation: Transformation,
) -> Result<Fit, FileError> {
    check(points)?;
    let mut transform = start;
    let mut matched = matches(points, surface, &transform);
    let typical = Statistics::of(matched.iter().map(|m| m.off)).median;
    if typical > surface.size() {
        return Err(FileError::data(
            format!(
                "at the start the points lie {typical:.0} mm off the surface, which is {:.0} mm large",
                surface.size()
            ),
            "give --landmarks, or --start centroids; check the frame of the points and which \
             surface is meant",
        ));
    }
    let mut cutoff = cutoff_of(&matched, f64::INFINITY);
    let (mut damping, mut rounds, mut settled) = (1e-3, 0, false);
    while rounds < MOST_STEPS && !settled {
        rounds += 1;
        let system = NormalEquations::of(&matched, cutoff, transformation);
        let cost = cost(&matched, cutoff);
        // Where no step helps, however short, this is the minimum.
        settled = true;
        while damping < 1e9 {
            let motion = system.step(damping);
            if dot(&motion, &motion).sqrt() < CONVERGED {
                break;
            }
            let next = system.increment(&motion) * transform;
            let there = matches(points, surface, &next);
            if self::cost(&there, cutoff) < cost {
                (transform, matched) = (next, there);
                damping = (damping / 10.0).max(1e-9);
                settled = false;
                break;
            }
            damping *= 10.0;
        }
        let growth = scale_of(&transform) / scale_of(&start);
        if !(SCALES.0..=SCALES.1).contains(&growth) {
            return Err(FileError::data(
                format!("the scale runs away: it is {growth:.2} times that of the start"),
                "give --landmarks, register with --transformation rigid, or give points of more \
                 of the surface",
            ));
        }
        cutoff = cutoff_of(&matched, cutoff);
    }
    Ok(Fit {
        transform,
        residuals: Residuals::of(&matched, cutoff),
        rounds,
        settled,
        loose: NormalEquations::of(&matched, cutoff, transformation).loose(transformation),
    })
}

fn check(points: &[DVec3]) -> Result<(), FileError> {
    let fail = |cause: String, remedy| Err(FileError::data(cause, remedy));
    if points.len() < MIN_POINTS {
        return fail(
            format!("{} points are given", points.len()),
            "give points all over the surface: hundreds are usual, ten the least; of a few that are \
             known in both, make --landmarks",
        );
    }
    if !points.iter().all(|p| p.is_finite()) {
        return fail(
            "points have coordinates that are no numbers".to_owned(),
            "give positions in mm",
        );
    }
    let first = points[0];
    if points.iter().all(|p| p.distance(first) < 1e-3) {
        return fail("all points are the same".to_owned(), "give points all over the surface");
    }
    Ok(())
}

fn matches(points: &[DVec3], surface: &TriangleSurface, transform: &DAffine3) -> Vec<MatchedPoint> {
    let matched = |p: &DVec3| {
        let at = transform.transform_point3(*p);
        let nearest = surface.nearest(at);
        let away = at - nearest.point;
        let off = away.length();
        MatchedPoint {
            at,
            // On the surface the difference is rounding.
            away: if off > LEAST_CUTOFF { away / off } else { nearest.normal },
            off,
        }
    };
    points.par_iter().map(matched).collect()
}

/// Cutoff from the median distance, at most `before`.
fn cutoff_of(matched: &[MatchedPoint], before: f64) -> f64 {
    let median = Statistics::of(matched.iter().map(|m| m.off)).median;
    (BIWEIGHT_CUTOFF * DEVIATION_PER_MEDIAN * median).max(LEAST_CUTOFF).min(before)
}

/// Sum of Tukey's biweight over the distances, mm2.
fn cost(matched: &[MatchedPoint], cutoff: f64) -> f64 {
    let loss = |m: &MatchedPoint| {
        let rest = 1.0 - (m.off / cutoff).powi(2).min(1.0);
        1.0 - rest.powi(3)
    };
    cutoff * cutoff / 6.0 * matched.iter().map(loss).sum::<f64>()
}

/// Normal equations of the distances, linear in a small motion about the points' centre.
struct NormalEquations {
    /// Eigenvalues of the matrix, and their directions.
    axes: [(f64, Motion); DEGREES_OF_FREEDOM],
    gradient: Motion,
    weight: f64,
    centre: DVec3,
    /// Root mean square distance of the points from the centre.
    reach: f64,
}

impl NormalEquations {
    fn of(matched: &[MatchedPoint], cutoff: f64, transformation: Transformation) -> Self {
        let count = matched.len() as f64;
        let centre = matched.iter().map(|m| m.at).sum::<DVec3>() / count;
        let squares = matched.iter().map(|m| m.at.distance_squared(centre));
        let reach = (squares.sum::<f64>() / count).sqrt();
        let mut matrix: Square<DEGREES_OF_FREEDOM> = Default::default();
        let (mut gradient, mut total) = (Motion::default(), 0.0);
        for m in matched.iter().filter(|m| m.off < cutoff) {
            let weight = (1.0 - (m.off / cutoff).powi(2)).powi(2);
            let arm = (m.at - centre) / reach;
            let (shift, turn) = (m.away, arm.cross(m.away));
            let growth = match transformation {
                Transformation::Rigid => 0.0,
                Transformation::Similarity => arm.dot(m.away),
            };
            let row = [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z, growth];
            for i in 0..DEGREES_OF_FREEDOM {
                for j in 0..DEGREES_OF_FREEDOM {
                    matrix[i][j] += weight * row[i] * row[j];
                }
                gradient[i] += weight * m.off * row[i];
            }
            total += weight;
        }
        Self { axes: eigen(matrix), gradient, weight: total, centre, reach }
    }

    /// The motion that lowers the sum; the more damping, the shorter. Components that the points do not determine
    /// are zero.
    fn step(&self, damping: f64) -> Motion {
        let trace: f64 = self.axes.iter().map(|(value, _)| value).sum();
        let mut motion = Motion::default();
        for (value, axis) in &self.axes {
            // Damped, so that it is positive also without an equation, such as for growth in a rigid fit.
            let stiffness = value + damping * trace / DEGREES_OF_FREEDOM as f64;
            if stiffness > 0.0 {
                let way = -dot(axis, &self.gradient) / stiffness;
                for (m, a) in motion.iter_mut().zip(axis) {
                    *m += way * a;
                }
            }
        }
        motion
    }

    fn increment(&self, motion: &Motion) -> DAffine3 {
        let part = |i: usize| DVec3::new(motion[i], motion[i + 1], motion[i + 2]);
        let about = DAffine3::from_scale_rotation_translation(
            DVec3::splat((motion[6] / self.reach).exp()),
            DQuat::from_scaled_axis(part(3) / self.reach),
            self.centre + part(0),
        );
        about * DAffine3::from_translation(-self.centre)
    }

    /// Motions that hardly change any distance.
    fn loose(&self, transformation: Transformation) -> Vec<String> {
        let least = UNDETERMINED * self.weight.max(f64::MIN_POSITIVE);
        let mut out = Vec::new();
        for (_, vector) in self.axes.iter().filter(|(value, _)| *value < least) {
            let part = |i: usize| DVec3::new(vector[i], vector[i + 1], vector[i + 2]);
            let (shift, turn, growth) = (part(0), part(3), vector[6].abs());
            let largest = shift.length().max(turn.length()).max(growth);
            let axis = |v: DVec3| {
                let v = v.normalize();
                format!("({:.2}, {:.2}, {:.2})", v.x, v.y, v.z)
            };
            if growth == largest {
                // A rigid fit has no growth.
                if transformation == Transformation::Similarity {
                    out.push("how large it is".to_owned());
                }
            } else if turn.length() == largest {
                out.push(format!("how far it is turned about {}", axis(turn)));
            } else {
                out.push(format!("where it is along {}", axis(shift)));
            }
        }
        out
    }
}

fn dot(a: &Motion, b: &Motion) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests;
