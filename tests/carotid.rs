//! What flows in the carotid that ships, against closed forms: rates, the speeds of its stenoses, the angles of its poses.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use insonify::scene::flow::Flow;

fn scene() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/carotid.toml");
    Scene::load(&path, &[]).expect("it ships").0
}

fn flow<'a>(scene: &'a Scene, name: &str) -> &'a Flow {
    scene.flows.iter().find(|flow| flow.name == name).expect(name)
}

/// Velocity where the beat is at its height, mm/s.
fn at(flow: &Flow, place: DVec3) -> DVec3 {
    let height = (0..1000).map(|i| f64::from(i) / 1000.0 * 1.1);
    let height = height.max_by(|a, b| flow.course.at(*a).total_cmp(&flow.course.at(*b)));
    flow.velocity(place, &DAffine3::IDENTITY, height.expect("a beat"))
}

/// A place of the internal carotid: a way along it from the fork, mm, 30 degrees into the neck.
fn internal(way: f64) -> DVec3 {
    let (sin, cos) = 30f64.to_radians().sin_cos();
    DVec3::new(0.0, way * cos, 17.0 + way * sin)
}

const ALONG: DVec3 = DVec3::new(0.0, 0.866_025_403_784_438_6, 0.5);

/// Rate of flow through the circle of 4 mm around a place of the internal carotid, ml/s.
fn rate(flow: &Flow, way: f64) -> f64 {
    let down = ALONG.cross(DVec3::X);
    let step = 0.04;
    let mut sum = 0.0;
    for i in -100..100 {
        for j in -100..100 {
            let [x, y] = [i, j].map(|k| step * (f64::from(k) + 0.5));
            if x.hypot(y) < 4.0 {
                sum += step * step * at_rate(flow, internal(way) + x * DVec3::X + y * down);
            }
        }
    }
    sum / 1000.0
}

fn at_rate(flow: &Flow, place: DVec3) -> f64 {
    flow.velocity(place, &DAffine3::IDENTITY, 0.2).dot(ALONG) / flow.course.at(0.2)
}

/// 13.3 ml/s arrive; the internal carotid begins with 6.3 mm, the external one with 4.725, and takes the square of that: 64 %.
/// No stenosis loses blood: before it, in it, in the jet and behind it, within 1 % (lines bend between their points).
#[test]
fn as_much_blood_goes_through_a_stenosis_as_without() {
    let scene = scene();
    let whole = PI * 3.15_f64.powi(2) / 2.0 * 850.0 / 1000.0;
    let expected = whole * 3.15_f64.powi(2) / (3.15_f64.powi(2) + (0.75 * 3.15_f64).powi(2));
    assert!((whole / 13.3 - 1.0).abs() < 0.01);
    // The planted error, shares by radii, would be seen.
    assert!((whole / 1.75 / expected - 1.0).abs() > 0.1);
    for name in ["carotid", "carotid 50", "carotid 70"] {
        for way in [9.0, 13.0, 16.0, 24.0, 40.0] {
            let found = rate(flow(&scene, name), way);
            println!("{name} at {way} mm: {found} {expected}");
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{name} at {way} mm: {found} {expected}"
            );
        }
    }
}

/// A throat of half the diameter of the internal carotid (4.84 mm), and of three tenths: as much faster as the areas say, with
/// a profile of the flattest exponent. They are graded as what they are by the velocities of the consensus of 2003.
#[test]
fn stenoses_are_as_fast_as_their_areas_say_and_are_graded_so() {
    let scene = scene();
    let mean = 850.0 / 2.0 * 0.64;
    let throat = internal(9.3);
    for (name, left, grade) in [
        ("carotid", None, 0.0..125.0),
        ("carotid 50", Some(0.5), 125.0..230.0),
        ("carotid 70", Some(0.3), 230.0..700.0),
    ] {
        // The middle of the throat, which plaque pushes up.
        let fastest =
            (-30..30).map(|i| at(flow(&scene, name), throat + DVec3::Z * f64::from(i) / 15.0));
        let psv = fastest.map(DVec3::length).fold(0.0, f64::max) / 10.0;
        let expected =
            left.map(|left: f64| mean * (3.15 / (2.42 * left)).powi(2) * 52.0 / 50.0 / 10.0);
        println!("{name}: {psv} {expected:?}");
        assert!(grade.contains(&psv), "{name}: {psv}");
        if let Some(expected) = expected {
            assert!((psv / expected - 1.0).abs() < 0.02, "{name}: {psv} {expected}");
        }
    }
}

/// The gate meets blood at 60 degrees in both poses along the arteries, also where plaque is narrowest.
#[test]
fn poses_along_meet_blood_at_sixty_degrees() {
    let scene = scene();
    for (pose, name, depth) in [
        ("common carotid along", "carotid", 16.8),
        ("internal carotid along", "carotid 50", 21.0),
        ("internal carotid along", "carotid 70", 21.0),
    ] {
        let found = scene.poses.iter().find(|p| p.name == pose).expect(pose);
        let place = found.world_from_probe.transform_point3(DVec3::Z * depth);
        let beam = found.world_from_probe.transform_vector3(DVec3::Z);
        let around = (-20..20).map(|i| at(flow(&scene, name), place + beam * f64::from(i) / 10.0));
        let fastest = around.max_by(|a, b| a.length().total_cmp(&b.length())).expect("some");
        let angle = fastest.angle_between(beam).to_degrees();
        println!("{pose}, {name}: {angle}");
        assert!((angle - 60.0).abs() < 1.0, "{pose}, {name}: {angle}");
    }
}
