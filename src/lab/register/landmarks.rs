//! The similarity between corresponding points, in closed form.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::Transformation;
use super::symmetric::eigen;
use crate::issue::FileError;

/// Least breadth of landmarks as a share of their length: below it they are nearly on a line, and errors of a
/// few mm turn everything right about it. Landmarks that leave a plane by less do not distinguish a structure
/// from its mirror image.
const LEAST_BREADTH: f64 = 0.02;

/// A point known in both frames, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// Name.
    pub name: String,
    /// Position in the volume.
    pub from: DVec3,
    /// Position in the model.
    pub to: DVec3,
}

/// The transformation that takes each landmark's `from` to its `to` with the least sum of squared
/// distances: the rotation by Horn (J. Opt. Soc. Am. A 4(4), 1987), the scale by Umeyama (IEEE PAMI
/// 13(4), 1991). Never a reflection.
///
/// # Errors
/// Fewer than three landmarks; landmarks that are no numbers, coincide or lie on a line; four or more
/// out of a plane that a reflection would fit far better.
pub fn closed_form(
    landmarks: &[Landmark],
    transformation: Transformation,
) -> Result<DAffine3, FileError> {
    if landmarks.len() < 3 {
        return Err(FileError::data(
            format!("{} landmarks are given", landmarks.len()),
            "give at least three that are not on a line, better six, spread over the structure",
        ));
    }
    let finite = |l: &&Landmark| !(l.from.is_finite() && l.to.is_finite());
    if let Some(bad) = landmarks.iter().find(finite) {
        return Err(FileError::data(
            format!("landmark `{}` has a coordinate that is no number", bad.name),
            "give its position in mm",
        ));
    }
    let from = CentredPoints::of(landmarks.iter().map(|l| l.from));
    let to = CentredPoints::of(landmarks.iter().map(|l| l.to));
    let is_flat = from.spread("volume")? | to.spread("model")?;
    let covariance =
        landmarks.iter().map(|l| outer(l.from - from.mean, l.to - to.mean)).sum::<DMat3>();
    let turns = eigen(horn(&covariance));
    let with = |sign: f64, (along, [w, x, y, z]): (f64, [f64; 4])| {
        let scale = match transformation {
            Transformation::Rigid => 1.0,
            Transformation::Similarity => sign * along / from.squares,
        };
        let matrix3 = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w)) * (sign * scale);
        DAffine3::from_mat3_translation(matrix3, to.mean - matrix3 * from.mean)
    };
    let found = with(1.0, turns[0]);
    // The best rotation of what is reflected through the mean.
    let mirrored = with(-1.0, turns[3]);
    let (error, mirrored) = (rms(&found, landmarks), rms(&mirrored, landmarks));
    if !is_flat && 2.0 * mirrored < error {
        return Err(FileError::data(
            format!(
                "the landmarks are mirrored: with left and right exchanged they fit to \
                 {mirrored:.1} mm, without to {error:.1} mm"
            ),
            "exchange those that are on the wrong side, or undo the reflection of the model or of \
             the volume's frame",
        ));
    }
    Ok(found)
}

/// Root mean square of the distances that `transform` leaves between landmarks, mm: the fiducial
/// registration error. Zero without landmarks.
pub fn rms(transform: &DAffine3, landmarks: &[Landmark]) -> f64 {
    let squares = landmarks.iter().map(|l| off(transform, l).powi(2));
    (squares.sum::<f64>() / landmarks.len().max(1) as f64).sqrt()
}

/// The landmark that `transform` leaves farthest off, and its distance, mm; none without landmarks.
pub fn worst<'l>(transform: &DAffine3, landmarks: &'l [Landmark]) -> Option<(&'l Landmark, f64)> {
    let all = landmarks.iter().map(|l| (l, off(transform, l)));
    all.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn off(transform: &DAffine3, landmark: &Landmark) -> f64 {
    transform.transform_point3(landmark.from).distance(landmark.to)
}

/// The matrix of `a` times the transpose of `b`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Horn's matrix of a sum of `outer(from, to)`: its quadratic form is the sum of how far each `from`,
/// turned by a unit quaternion (w, x, y, z), lies along its `to`.
fn horn(sum: &DMat3) -> [[f64; 4]; 4] {
    let [[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]] = sum.to_cols_array_2d();
    [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ]
}

/// Points of one frame about their mean.
struct CentredPoints {
    mean: DVec3,
    /// Sum of squared distances from it.
    squares: f64,
    covariance: DMat3,
}

impl CentredPoints {
    fn of(points: impl ExactSizeIterator<Item = DVec3> + Clone) -> Self {
        let count = points.len() as f64;
        let mean = points.clone().sum::<DVec3>() / count;
        let covariance = points.clone().map(|p| outer(p - mean, p - mean)).sum::<DMat3>() / count;
        Self { mean, squares: points.map(|p| p.distance_squared(mean)).sum(), covariance }
    }

    /// Returns whether the points lie in a plane. Fails where they leave a rotation open.
    fn spread(&self, side: &str) -> Result<bool, FileError> {
        let [length, breadth, height] =
            eigen(self.covariance.to_cols_array_2d()).map(|(square, _)| square.max(0.0).sqrt());
        let cause = if length < 1e-3 {
            format!("the landmarks of the {side} are one point")
        } else if breadth < LEAST_BREADTH * length {
            format!("the landmarks of the {side} lie on a line")
        } else {
            return Ok(height < LEAST_BREADTH * length);
        };
        let remedy = "add one that is far from that line: the rotation about it is open";
        Err(FileError::data(cause, remedy))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_3;

    use glam::DQuat;

    use super::*;
    use crate::register::scale_of;

    const PLACES: [[f64; 3]; 5] = [
        [10.0, -4.0, 30.0],
        [-22.0, 7.0, 41.0],
        [3.0, 35.0, 12.0],
        [18.0, 22.0, 55.0],
        [-5.0, -31.0, 20.0],
    ];

    fn moved(by: DAffine3, count: usize) -> Vec<Landmark> {
        let landmark = |(i, &p): (usize, &[f64; 3])| Landmark {
            name: format!("L{i}"),
            from: p.into(),
            to: by.transform_point3(p.into()),
        };
        PLACES[..count].iter().enumerate().map(landmark).collect()
    }

    fn similarity(scale: f64) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(
            DVec3::splat(scale),
            DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.5 * FRAC_PI_3),
            DVec3::new(120.0, -40.0, 7.0),
        )
    }

    #[test]
    fn any_similarity_is_found_exactly() {
        for count in [3, 4, 5] {
            let truth = similarity(1.0);
            let made = closed_form(&moved(truth, count), Transformation::Rigid);
            assert!(made.expect("well spread").abs_diff_eq(truth, 1e-10));
            let truth = similarity(0.83);
            let made = closed_form(&moved(truth, count), Transformation::Similarity);
            assert!(made.expect("well spread").abs_diff_eq(truth, 1e-10));
        }
    }

    #[test]
    fn a_rigid_fit_of_what_has_grown_keeps_the_scale_and_is_no_worse_than_its_neighbours() {
        let all = moved(similarity(1.2), 5);
        let made = closed_form(&all, Transformation::Rigid).expect("well spread");
        assert!((scale_of(&made) - 1.0).abs() < 1e-12);
        let least = rms(&made, &all);
        for axis in DVec3::AXES {
            for sign in [-1.0, 1.0] {
                let centre = made.transform_point3(all[0].from);
                let turned = DAffine3::from_translation(centre)
                    * DAffine3::from_axis_angle(axis, sign * 0.01)
                    * DAffine3::from_translation(-centre);
                for other in [turned * made, DAffine3::from_translation(sign * 0.1 * axis) * made] {
                    assert!(rms(&other, &all) > least);
                }
            }
        }
        // Planted: the inverse is not mistaken for it.
        assert!(rms(&made.inverse(), &all) > 10.0 * least);
    }

    #[test]
    fn a_reflection_is_refused_and_never_returned() {
        let mut all = moved(similarity(1.0), 5);
        for l in &mut all {
            l.from.x = -l.from.x;
        }
        let error = closed_form(&all, Transformation::Similarity).expect_err("mirrored");
        assert!(error.to_string().contains("mirrored"), "{error}");
        // Three points and their mirror image are congruent.
        let made = closed_form(&all[..3], Transformation::Rigid).expect("congruent");
        assert!((made.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert!(rms(&made, &all[..3]) < 1e-9);
        // Four nearly in a plane, off by chance: the reflection fits a little better.
        let flat = [[0.0, 0.0], [50.0, 0.0], [0.0, 40.0], [45.0, 38.0]];
        let heights = [[0.4, -0.5], [-0.3, 0.4], [-0.2, 0.1], [0.5, -0.4]];
        let flat = flat.iter().zip(heights).map(|([x, y], [a, b])| Landmark {
            name: String::new(),
            from: DVec3::new(*x, *y, a),
            to: DVec3::new(x + 0.3 * a, y - 0.8 * b, b),
        });
        let made = closed_form(&flat.collect::<Vec<_>>(), Transformation::Rigid);
        assert!(made.expect("near a plane").matrix3.determinant() > 0.0);
    }

    #[test]
    fn landmarks_that_do_not_determine_a_rotation_are_refused_with_a_remedy() {
        let truth = similarity(1.0);
        let on_a_line = |n: usize| {
            let mut all = moved(truth, 4);
            for (i, l) in all.iter_mut().enumerate() {
                l.from = DVec3::new(30.0 * (i as f64).powi(n as i32), 5.0, 5.0);
                l.to = truth.transform_point3(l.from);
            }
            all
        };
        let mut broken = moved(truth, 4);
        broken[2].to.y = f64::NAN;
        for (all, cause) in [
            (Vec::new(), "0 landmarks"),
            (moved(truth, 2), "2 landmarks"),
            (on_a_line(1), "on a line"),
            (on_a_line(0)[1..].to_vec(), "one point"),
            (broken, "`L2` has a coordinate that is no number"),
        ] {
            let error = closed_form(&all, Transformation::Rigid).expect_err(cause);
            assert!(error.to_string().contains(cause), "{error}");
            assert!(!error.remedy.is_empty());
        }
    }
}
