use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::{Body, Hand, PRESS, Spot};
use crate::contact::Skin;
use crate::probe::{Probe, ProbeKind};
use crate::scene::Scene;

fn skin(shape: &str) -> Skin {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    let text = format!(
        "[contact]\nmesh = [\"skin\"]\n[[mesh]]\nname = \"skin\"\ntissue = \"skin\"\nshape = {{ {shape} }}\n"
    );
    std::fs::write(&file, text).unwrap();
    let scene = Scene::load(&file, &[]).unwrap().0;
    Body::of(&scene).unwrap().at(0.0)
}

/// A pose over the pole of a ball, its depth axis down and its lateral axis along x.
fn above(radius: f64) -> DAffine3 {
    let axes = DMat3::from_cols(DVec3::X, -DVec3::Y, -DVec3::Z);
    DAffine3::from_mat3_translation(axes, DVec3::Z * radius)
}

fn angle(a: &DAffine3, b: &DAffine3) -> f64 {
    let [a, b] = [a, b].map(|m| DQuat::from_mat3(&m.matrix3));
    a.angle_between(b)
}

/// The place straight below `from` (world, mm), seen from far outside.
fn seen(hand: &Hand<'_>, from: DVec3) -> Spot {
    hand.pick(from, -from.normalize()).unwrap()
}

#[test]
fn on_a_sphere_the_probe_stands_on_the_radius_and_is_pressed_in_as_wanted() {
    let skin = skin("sphere = { radius = 80, subdivisions = 6 }");
    for probe in [Probe::linear(), Probe::abdominal(), Probe::phased()] {
        let hand = Hand::new(&skin, &probe);
        let pose = above(90.0);
        let from = hand.held(&pose);
        assert!(from.point.distance(DVec3::Z * 80.0) < 0.01, "{from:?}");
        // Facets of a radian / 64, sampled at 24 points: 0.2 degrees.
        assert!(from.normal.angle_between(DVec3::Z) < 0.004, "{from:?}");
        for to in
            [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-3.0, 0.5, -1.0), DVec3::new(0.1, -4.0, 0.3)]
        {
            let spot = seen(&hand, to * 100.0);
            let radial = to.normalize();
            assert!(spot.normal.angle_between(radial) < 0.004, "{spot:?}");
            let slid = hand.slid(&pose, &from, &spot, PRESS);
            // The middle of a flat or convex face is the deepest.
            let expected = radial * (80.0 - PRESS);
            assert!(slid.translation.distance(expected) < 0.02, "{slid:?}");
            let depth = slid.transform_vector3(DVec3::Z);
            assert!(depth.angle_between(-radial) < 0.008, "{depth}");
            // Parallel transport along the great circle is the turn about its pole.
            let turn = DQuat::from_rotation_arc(DVec3::Z, radial);
            let lateral = turn * pose.transform_vector3(DVec3::X);
            let found = slid.transform_vector3(DVec3::X);
            assert!(found.angle_between(lateral) < 0.008, "{found} {lateral}");
        }
    }
}

// Around an octant of the sphere the lateral axis comes back turned by the enclosed solid angle, pi / 2
// (Gauss and Bonnet); a probe that is not spun by the hand does so.
#[test]
fn around_a_triangle_of_right_angles_the_image_turns_by_a_right_angle() {
    let skin = skin("sphere = { radius = 80, subdivisions = 6 }");
    let probe = Probe::linear();
    let hand = Hand::new(&skin, &probe);
    let start = above(80.0);
    let mut pose = start;
    let mut from = hand.held(&pose);
    let corners = [DVec3::Z, DVec3::X, DVec3::Y, DVec3::Z];
    for side in corners.windows(2) {
        for step in 1..=60 {
            let turn = DQuat::from_rotation_arc(side[0], side[1]);
            let part = DQuat::IDENTITY.slerp(turn, f64::from(step) / 60.0);
            let to = seen(&hand, part * side[0] * 200.0);
            pose = hand.slid(&pose, &from, &to, PRESS);
            from = to;
        }
    }
    let turned = angle(&start, &pose);
    // 180 steps whose normals are off by 0.2 degrees at most, mostly to both sides.
    assert!((turned - FRAC_PI_2).abs() < 0.02, "{turned}");
}

#[test]
fn tilt_and_rock_stay_as_the_hand_has_them() {
    let skin = skin("sphere = { radius = 80, subdivisions = 6 }");
    let probe = Probe::abdominal();
    let hand = Hand::new(&skin, &probe);
    let own = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_y(-0.2);
    let mut pose = above(80.0) * DAffine3::from_quat(own);
    let mut from = hand.held(&pose);
    let tilt = |pose: &DAffine3, spot: &Spot| {
        let depth = pose.transform_vector3(DVec3::Z);
        depth.angle_between(-spot.normal)
    };
    let before = tilt(&pose, &from);
    for step in 1..200 {
        let a = 0.01 * f64::from(step);
        let to = seen(&hand, DVec3::new(a.sin(), 0.4 * (3.0 * a).sin(), a.cos()) * 200.0);
        pose = hand.slid(&pose, &from, &to, PRESS);
        assert!((tilt(&pose, &to) - before).abs() < 1e-6, "{step}");
        // The place found from the pose alone is the one that it was put on.
        let found = hand.held(&pose);
        assert!(found.point.distance(to.point) < 0.3, "{found:?} {to:?}");
        from = to;
    }
}

#[test]
fn over_the_edges_of_a_box_the_probe_turns_smoothly() {
    let skin = skin("box = { size = [100, 100, 100] }");
    for probe in [Probe::linear(), Probe::abdominal(), Probe::cardiac()] {
        let hand = Hand::new(&skin, &probe);
        let mut pose = above(50.0);
        let mut spot = hand.held(&pose);
        assert!(spot.normal.angle_between(DVec3::Z) < 1e-6);
        let reach = (probe.face_width() * probe.elevation_height).sqrt();
        let mut turned = 0.0;
        // Four faces of 100 mm, in steps of half a millimetre.
        for step in 0..800 {
            let lateral = pose.transform_vector3(DVec3::X);
            let next = hand.beside(&spot, lateral * 0.5).expect("there is skin");
            let put = hand.slid(&pose, &spot, &next, PRESS);
            let by = angle(&pose, &put);
            let jump = put.translation.distance(pose.translation);
            // A right angle over the footprint's width, at most three times as fast as in the mean.
            assert!(by < 3.0 * 0.5 * FRAC_PI_2 / reach, "{step}: {by}");
            assert!(jump < 3.0, "{step}: {jump}");
            turned += by;
            (pose, spot) = (put, next);
        }
        // Once around, or nearly: some distance is lost and won at the edges.
        assert!((turned / (2.0 * PI) - 1.0).abs() < 0.3, "{turned}");
        assert!(pose.transform_vector3(DVec3::Y).angle_between(-DVec3::Y) < 0.05);
    }
}

/// A slide all around the shipped abdomen.
#[test]
fn on_the_abdomen_the_probe_slides_without_a_jump() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/abdomen.toml");
    let scene = Scene::load(&path, &[]).unwrap().0;
    let skin = Body::of(&scene).unwrap().at(0.0);
    let probe = &scene.probe;
    let hand = Hand::new(&skin, probe);
    let mut pose = scene.world_from_probe;
    let mut spot = hand.held(&pose);
    assert!(spot.point.distance(pose.translation) < 3.0, "{spot:?}");
    for (axis, steps) in [(DVec3::Y, 120), (DVec3::X, 60), (-DVec3::Y, 200)] {
        for step in 0..steps {
            let by = pose.transform_vector3(axis);
            let next = hand.beside(&spot, by).expect("there is skin");
            let put = hand.slid(&pose, &spot, &next, PRESS);
            let turned = angle(&pose, &put).to_degrees();
            assert!(turned < 6.0, "{axis} {step}: {turned} degrees");
            let jump = put.translation.distance(pose.translation);
            assert!(jump < 2.5, "{axis} {step}: {jump} mm");
            let gap = skin.gap(put.translation, -next.normal).expect("skin ahead");
            assert!((-PRESS - 0.01..3.0).contains(&gap), "{axis} {step}: {gap}");
            (pose, spot) = (put, next);
        }
    }
}

#[test]
fn rays_beside_the_body_pick_nothing_and_the_far_side_is_reached_without_a_spin() {
    let skin = skin("sphere = { radius = 30, subdivisions = 5 }");
    let probe = Probe { kind: ProbeKind::Linear { width: 20.0 }, ..Probe::linear() };
    let hand = Hand::new(&skin, &probe);
    assert_eq!(hand.pick(DVec3::new(40.0, 0.0, 100.0), -DVec3::Z), None);
    let pose = above(30.0);
    let from = hand.held(&pose);
    let to = seen(&hand, -DVec3::Z * 100.0);
    let slid = hand.slid(&pose, &from, &to, 1.0);
    assert!(slid.transform_vector3(DVec3::X).angle_between(DVec3::X) < 0.01);
    assert!(slid.translation.distance(-DVec3::Z * 29.0) < 0.05);
}
