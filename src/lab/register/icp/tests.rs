use std::sync::LazyLock;

use super::*;
use crate::random::{gaussian, pcg4d, unit};
use crate::register::surface::{Triangle, samples};
use crate::scene::{Mesh, shapes};

/// An ellipsoid with a bump beside its longest axis: no motion maps it onto itself.
static MODEL: LazyLock<Vec<Triangle>> = LazyLock::new(|| {
    let mesh = shapes::ellipsoid([40.0, 28.0, 22.0], 5);
    let bump = DVec3::new(0.7, 0.5, 0.5).normalize();
    triangles(&mesh, |p| {
        let near = (p.normalize().dot(bump) - 1.0) / 0.05;
        p * (1.0 + 0.25 * near.exp())
    })
});

fn triangles(mesh: &Mesh, change: impl Fn(DVec3) -> DVec3) -> Vec<Triangle> {
    let at = |i: u32| change(DVec3::from(mesh.positions[i as usize].map(f64::from)));
    mesh.triangles.iter().map(|t| t.map(at)).collect()
}

/// The model from the volume: 12 mm and 9 degrees.
fn truth(scale: f64) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        DVec3::splat(scale),
        DQuat::from_axis_angle(DVec3::new(0.3, -0.8, 0.5).normalize(), 9f64.to_radians()),
        12.0 * DVec3::new(0.6, 0.64, -0.48),
    )
}

/// Normal numbers of deviation 1 mm along each axis, by point.
fn noise(i: usize) -> DVec3 {
    let words = pcg4d([i as u32, 3, 5, 7]);
    DVec3::from([0, 1, 2].map(|axis| gaussian(words[axis])))
}

/// Points of the model at their places in the volume, `share` of them anywhere in twice their box.
fn cloud(truth: &DAffine3, count: usize, sigma: f64, share: f64) -> Vec<DVec3> {
    let lps_from_model = truth.inverse();
    let mut out: Vec<DVec3> = samples(&MODEL, count)
        .into_iter()
        .enumerate()
        .map(|(i, p)| lps_from_model.transform_point3(p) + sigma * noise(i))
        .collect();
    let low = out.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = out.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    for (i, p) in out.iter_mut().enumerate() {
        let words = pcg4d([i as u32, 11, 13, 17]);
        if unit(words[3]) < share {
            *p = middle
                + 2.0 * half * DVec3::from([0, 1, 2].map(|axis| 2.0 * unit(words[axis]) - 1.0));
        }
    }
    out
}

/// Largest distance between the places of the model's surface by `found` and by `truth`, mm, and the angle
/// between their rotations, degrees.
fn error(found: &DAffine3, truth: &DAffine3) -> (f64, f64) {
    let off = samples(&MODEL, 500).into_iter().map(|p| {
        let volume = truth.inverse().transform_point3(p);
        found.transform_point3(volume).distance(p)
    });
    let rotation = |t: &DAffine3| t.to_scale_rotation_translation().1;
    let angle = rotation(found).angle_between(rotation(truth));
    (off.fold(0.0, f64::max), angle.to_degrees())
}

fn surface() -> TriangleSurface {
    TriangleSurface::new(&MODEL).expect("a surface")
}

#[test]
fn a_displaced_surface_is_found_from_where_it_is() {
    let truth = truth(1.0);
    let points = cloud(&truth, 2000, 0.0, 0.0);
    let (off, angle) = error(&DAffine3::IDENTITY, &truth);
    // Planted: without a search both tolerances are exceeded many times.
    assert!(off > 10.0 && angle > 8.9, "{off} {angle}");
    for start in [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::new(6.0, -8.0, 0.0))] {
        let made = fit(&points, &surface(), start, Transformation::Rigid).expect("found");
        let (off, angle) = error(&made.transform, &truth);
        assert!(made.settled && off < 0.01 && angle < 0.01, "{made:?} {off} {angle}");
        assert!(made.residuals.rms < 1e-3 && made.loose.is_empty(), "{made:?}");
        // Planted: its inverse is no answer.
        assert!(error(&made.transform.inverse(), &truth).0 > 20.0);
    }
}

#[test]
fn noise_averages_out_and_is_measured() {
    let truth = truth(1.0);
    let points = cloud(&truth, 3000, 0.3, 0.0);
    let made = fit(&points, &surface(), DAffine3::IDENTITY, Transformation::Rigid).expect("found");
    let (off, angle) = error(&made.transform, &truth);
    // About its longest axis the ellipsoid is nearly round: there the standard error is 0.1 degrees.
    assert!(off < 0.1 && angle < 0.3, "{off} {angle}");
    let r = &made.residuals;
    // Only motion across the surface shows; median and 95 % are those of a normal law.
    assert!((r.rms / 0.3 - 1.0).abs() < 0.06, "{r:?}");
    assert!((r.median / (0.6745 * 0.3) - 1.0).abs() < 0.08, "{r:?}");
    assert!((r.p95 / (1.96 * 0.3) - 1.0).abs() < 0.08, "{r:?}");
    assert!(r.trimmed() < 0.001, "{r:?}");
}

#[test]
fn points_of_something_else_do_no_harm() {
    let truth = truth(1.0);
    let points = cloud(&truth, 3000, 0.3, 0.2);
    let made = fit(&points, &surface(), DAffine3::IDENTITY, Transformation::Rigid).expect("found");
    let (off, angle) = error(&made.transform, &truth);
    assert!(off < 0.3 && angle < 0.3, "{off} {angle}");
    let trimmed = made.residuals.trimmed();
    assert!((0.15..0.2).contains(&trimmed), "{trimmed}");
    // Planted: least squares over all points are pulled away.
    let mut transform = DAffine3::IDENTITY;
    for _ in 0..50 {
        let matched = matches(&points, &surface(), &transform);
        let system = NormalEquations::of(&matched, 1e9, Transformation::Rigid);
        transform = system.increment(&system.step(1e-6)) * transform;
    }
    let (worse, _) = error(&transform, &truth);
    assert!(worse > 1.0, "{worse}");
}

#[test]
fn far_starts_arrive_in_spite_of_many_strays() {
    let truth = truth(1.0);
    let points = cloud(&truth, 1500, 0.3, 0.4);
    for i in 0..8 {
        let turn = DAffine3::from_axis_angle(noise(100 + i).normalize(), 60f64.to_radians());
        let shift = DAffine3::from_translation(12.0 * noise(900 + i).normalize());
        let start = shift * turn * truth;
        let made = fit(&points, &surface(), start, Transformation::Rigid).expect("found");
        let (off, angle) = error(&made.transform, &truth);
        assert!(off < 0.4 && angle < 0.4, "{i}: {off} {angle}");
        assert!(made.residuals.trimmed() > 0.3, "{made:?}");
    }
}

#[test]
fn a_part_of_the_surface_is_enough() {
    let truth = truth(1.0);
    let mut points = cloud(&truth, 3000, 0.3, 0.1);
    let high = truth.inverse().transform_point3(DVec3::new(0.0, 0.0, -2.0)).z;
    points.retain(|p| p.z > high);
    let made = fit(&points, &surface(), DAffine3::IDENTITY, Transformation::Rigid).expect("found");
    let (off, angle) = error(&made.transform, &truth);
    assert!(off < 0.3 && angle < 0.3, "{off} {angle}");
}

#[test]
fn a_scale_is_found_where_it_may_change_and_kept_where_not() {
    let truth = truth(1.07);
    let points = cloud(&truth, 3000, 0.3, 0.2);
    let start = DAffine3::IDENTITY;
    let made = fit(&points, &surface(), start, Transformation::Similarity).expect("found");
    let (off, angle) = error(&made.transform, &truth);
    assert!(off < 0.4 && angle < 0.3, "{off} {angle}");
    assert!((scale_of(&made.transform) / 1.07 - 1.0).abs() < 0.005);
    let rigid = fit(&points, &surface(), start, Transformation::Rigid).expect("found");
    assert!((scale_of(&rigid.transform) - 1.0).abs() < 1e-9);
    assert!(rigid.residuals.median > 3.0 * made.residuals.median);
}

#[test]
fn motions_that_the_surface_does_not_determine_stay_and_are_reported() {
    let ball = TriangleSurface::new(&triangles(&shapes::sphere(30.0, 5), |p| p)).expect("a ball");
    let points: Vec<_> = samples(&triangles(&shapes::sphere(30.0, 5), |p| p), 1000)
        .into_iter()
        .map(|p| p + DVec3::new(3.0, -2.0, 1.0))
        .collect();
    let made = fit(&points, &ball, DAffine3::IDENTITY, Transformation::Rigid).expect("found");
    let turned = made.loose.iter().filter(|l| l.contains("turned about"));
    assert_eq!((turned.count(), made.loose.len()), (3, 3), "{made:?}");
    let shift = made.transform.translation;
    assert!(shift.distance(DVec3::new(-3.0, 2.0, -1.0)) < 0.02, "{made:?}");
    let quarter = triangles(&shapes::cuboid([50.0, 40.0, 30.0]), |p| p);
    let floor: Vec<_> = quarter.iter().copied().filter(|t| t.iter().all(|p| p.z < 0.0)).collect();
    let points = samples(&floor, 500);
    let plane = TriangleSurface::new(&floor).expect("a plane");
    // Its rim would hold larger ones.
    let small: Vec<_> = points.into_iter().map(|p| p * DVec3::new(0.5, 0.5, 1.0)).collect();
    let made = fit(&small, &plane, DAffine3::IDENTITY, Transformation::Similarity).expect("found");
    let words = made.loose.join("; ");
    assert_eq!(made.loose.len(), 4, "{words}");
    assert!(words.contains("along") && words.contains("how large"), "{words}");
}

#[test]
fn points_that_do_not_fit_a_surface_are_refused() {
    let good = cloud(&truth(1.0), 50, 0.0, 0.0);
    let mut broken = good.clone();
    broken[7].z = f64::INFINITY;
    let far = DAffine3::from_translation(DVec3::new(0.0, 900.0, 0.0));
    let here = DAffine3::IDENTITY;
    for (points, start, cause, remedy) in [
        (vec![], here, "0 points are given", "--landmarks"),
        (good[..9].to_vec(), here, "9 points are given", "--landmarks"),
        (vec![DVec3::ONE; 20], here, "the same", "all over"),
        (broken, here, "no numbers", "mm"),
        (good, far, "mm off the surface", "--landmarks"),
    ] {
        let error = fit(&points, &surface(), start, Transformation::Rigid).expect_err(cause);
        assert!(error.to_string().contains(cause), "{error}");
        assert!(error.remedy.contains(remedy), "{}", error.remedy);
    }
    // A handful of points on one spot shrinks onto it.
    let spot = samples(&MODEL, 40_000);
    let spot = spot.iter().filter(|p| p.x > 36.0).map(|p| DVec3::new(-3.0 * p.x + 148.0, p.y, p.z));
    let spot: Vec<_> = spot.collect();
    let error = fit(&spot, &surface(), here, Transformation::Similarity);
    let error = error.map(|f| f.transform).expect_err("it shrinks");
    assert!(error.to_string().contains("scale runs away"), "{error}");
}
