//! How tissue has moved since the last frame.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use insonify::gpu::test_device;
use insonify::scene::{Keyframes, Mesh, Scene, Strategy, shapes};
use insonify::sim::layout::Label;

use super::scenes::{add_body, linear, tissue};
use super::tracers::tracers;
use super::{frame, place, simulator};

/// How a label says that its tissue has moved, mm.
fn moved(label: &Label) -> DVec3 {
    let [x, y, z, _] = label.moved_incidence.map(f64::from);
    DVec3::new(x, y, z)
}

/// The largest error of the movements of what is seen of a body, and the number of samples that see it.
fn worst(labels: &[Label], instance: u32, expected: impl Fn(DVec3) -> DVec3) -> (f64, usize) {
    let seen = labels.iter().filter(|label| label.instance == instance);
    let errors = seen.map(|label| moved(label).distance(expected(place(label))));
    errors.fold((0.0, 0), |(worst, count): (f64, usize), error| (worst.max(error), count + 1))
}

fn scene() -> Scene {
    let mut scene = linear(16, 20.0, tissue(1.54, 1.6, 0.0));
    scene.probe.depth = 60.0;
    scene.probe.samples = 512;
    let at = DAffine3::from_translation(DVec3::new(0.3, 0.1, 30.0));
    add_body(&mut scene, shapes::sphere(12.0, 3), tissue(1.54, 1.6, 0.0), at);
    scene
}

#[test]
fn a_body_that_moves_takes_its_tissue_along_and_the_rest_stays() {
    for tracer in tracers(&test_device()) {
        let mut scene = scene();
        let mut simulator = simulator(&mut scene, tracer);
        let none = u32::MAX;
        let first = frame(&mut simulator, &scene, 0);
        assert_eq!(
            worst(&first.samples.labels, 0, |_| DVec3::ZERO).0,
            0.0,
            "nothing has moved yet"
        );
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, 1.0, -0.2).normalize(), 0.04);
        let by = DAffine3::from_rotation_translation(turn, DVec3::new(0.4, -0.2, 0.3));
        scene.instances[0].world_from_object = by * scene.instances[0].world_from_object;
        let second = frame(&mut simulator, &scene, 1);
        let imposed = |p: DVec3| p - by.inverse().transform_point3(p);
        let (error, seen) = worst(&second.samples.labels, 0, imposed);
        // Single precision at 40 mm: 4e-6 mm a step.
        assert!(error < 1e-4 && seen > 1000, "{tracer}: {error} mm of {seen}");
        assert!(imposed(DVec3::new(5.0, 0.0, 30.0)).length() > 0.5);
        assert!(worst(&second.samples.labels, none, |_| DVec3::ZERO).0 < 1e-4);
        // It stands still again: so do its labels.
        let third = frame(&mut simulator, &scene, 2);
        assert!(worst(&third.samples.labels, 0, |_| DVec3::ZERO).0 < 1e-4);
        // Tissue passes by a probe that moves.
        let step = DAffine3::from_translation(DVec3::new(0.25, 0.0, -0.5));
        scene.world_from_probe = step * scene.world_from_probe;
        let fourth = frame(&mut simulator, &scene, 3);
        let passes = DVec3::new(-0.25, 0.0, 0.5);
        for instance in [0, none] {
            let (error, seen) = worst(&fourth.samples.labels, instance, |_| passes);
            assert!(error < 1e-4 && seen > 1000, "{tracer}: {error} mm of {seen}");
        }
        // Switched off and on again, they tell of the last frame, whether that had labels or not.
        scene.simulation.labels = false;
        scene.instances[0].world_from_object.translation.x += 1.0;
        simulator.frame(&scene, 4).expect("a frame");
        scene.simulation.labels = true;
        scene.instances[0].world_from_object.translation.x += 0.125;
        let last = frame(&mut simulator, &scene, 5);
        let (error, seen) = worst(&last.samples.labels, 0, |_| DVec3::X * 0.125);
        assert!(error < 1e-4 && seen > 1000, "{tracer}: {error} mm of {seen}");
    }
}

#[test]
fn a_shape_that_a_program_sets_moves_its_tissue_from_the_first_time_on() {
    for tracer in tracers(&test_device()) {
        let mut scene = scene();
        let mut simulator = simulator(&mut scene, tracer);
        frame(&mut simulator, &scene, 0);
        let middle = DVec3::new(0.3, 0.1, 30.0);
        let rest = scene.meshes[0].clone();
        let mut before = 1.0;
        for (index, squeeze) in [(1, 0.9), (2, 0.8)] {
            let mut shape = Mesh::clone(&rest);
            shape.positions.iter_mut().for_each(|p| p[2] *= squeeze as f32);
            scene.reshape(0, shape.into());
            let labels = frame(&mut simulator, &scene, index);
            let (error, seen) = worst(&labels.samples.labels, 0, |p| {
                DVec3::Z * (p.z - middle.z) * (1.0 - before / squeeze)
            });
            println!("{tracer} {squeeze}: {error} mm of {seen}");
            assert!(error < 0.01 && seen > 1000, "{tracer} {squeeze}: {error} mm of {seen}");
            before = squeeze;
        }
    }
}

/// A body whose second keyframe is the first one mapped by `map` about its middle.
fn deforming(map: DMat3, strategy: Strategy) -> Scene {
    let mut scene = scene();
    let rest = Mesh::clone(&scene.meshes[0]);
    let mut squeezed = Mesh { name: "squeezed".into(), ..rest };
    for p in &mut squeezed.positions {
        *p = (map * DVec3::from(p.map(f64::from))).as_vec3().to_array();
    }
    scene.meshes.push(squeezed.into());
    scene.instances[0].keyframes =
        Keyframes { meshes: vec![0, 1], strategy, blend: blend(0.0), ..Keyframes::default() };
    scene
}

fn blend(share: f64) -> [(usize, f64); 4] {
    [(0, 1.0 - share), (1, share), (0, 0.0), (0, 0.0)]
}

#[test]
fn a_body_that_is_squeezed_moves_as_its_keyframes_say() {
    let map = DMat3::from_cols(
        DVec3::new(1.06, 0.0, 0.02),
        DVec3::new(0.0, 1.05, 0.0),
        DVec3::new(0.0, 0.0, 0.85),
    );
    let middle = DVec3::new(0.3, 0.1, 30.0);
    for tracer in tracers(&test_device()) {
        let mut scene = deforming(map, Strategy::Interpolate);
        let mut simulator = simulator(&mut scene, tracer);
        frame(&mut simulator, &scene, 0);
        let mut before = DMat3::IDENTITY;
        for (index, share) in [(1, 0.4), (2, 1.0), (3, 0.7)] {
            scene.instances[0].keyframes.blend = blend(share);
            let labels = frame(&mut simulator, &scene, index);
            let now = DMat3::IDENTITY * (1.0 - share) + map * share;
            let back = before * now.inverse();
            let (error, seen) =
                worst(&labels.samples.labels, 0, |p| p - middle - back * (p - middle));
            // Fields are made from the surface by an iteration that stops at 1e-3 of what it finds.
            println!("{tracer} {share}: {error} mm of {seen}");
            assert!(error < 0.01 && seen > 1000, "{tracer} {share}: {error} mm of {seen}");
            before = now;
        }
        // Another body was squeezed by up to 1.8 mm.
        assert!((map * DVec3::Z * 12.0 - DVec3::Z * 12.0).length() > 1.5);
    }
}
