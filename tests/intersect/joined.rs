//! Instances that share one structure: the same hits as with one each, whichever are hidden, skipped,
//! moved together or separated.

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::{Scene, shapes};
use insonify::sim::tracer::Tracer;
use rayon::prelude::*;

use super::beating::beat;
use super::compare::{expected, slips};
use super::device::Rig;
use super::rays::{rays, scene, turned};
use super::tracers::tracers;
use super::wrong;

/// The binding of the triangles, followed by their owners.
const TRIANGLES: usize = 3;

/// A scene of nested organs in one frame, and one beside them that has its own.
fn nested() -> Scene {
    let mut placed: Vec<_> =
        [20.0, 17.0, 12.0, 5.0].map(|radius| (shapes::sphere(radius, 2), turned())).into();
    let aside = turned() * DAffine3::from_translation(DVec3::Z);
    placed.insert(2, (shapes::cuboid([8.0, 40.0, 8.0]), aside));
    scene(placed)
}

/// Panics where the results of `rig` in `scene` differ from brute force.
fn assert_found(scene: &Scene, rig: &Rig, tracer: Tracer, what: &str) {
    let still = scene.still();
    let rays = rays(&still, 4000, 5);
    let expected: Vec<_> = rays.par_iter().map(|ray| expected(&still, ray)).collect();
    assert!(expected.iter().flatten().count() > 1000);
    let [aimed, elsewhere] = wrong(&still, &rays, &expected, &rig.found(&rays));
    assert!(
        elsewhere == 0 && aimed <= slips(tracer, rays.len() / 2),
        "{what}, {tracer}: {aimed} wrong at seams, {elsewhere} elsewhere"
    );
    rig.assert_silent();
}

#[test]
fn instances_that_share_a_structure_are_found_as_if_each_had_its_own() {
    for tracer in tracers(&test_device()) {
        let mut scene = nested();
        let mut rig = Rig::new(&scene, tracer);
        assert_found(&scene, &rig, tracer, "all");
        // The first stands for all in the top level, hidden or not.
        for hidden in [&[0][..], &[1, 4], &[0, 1, 3, 4], &[]] {
            for (i, instance) in scene.instances.iter_mut().enumerate() {
                instance.shown = !hidden.contains(&i);
            }
            assert!(rig.world.serves(&scene));
            assert!(rig.update(&scene));
            assert_found(&scene, &rig, tracer, &format!("without {hidden:?}"));
        }
        let by = DAffine3::from_rotation_z(0.2);
        for instance in &mut scene.instances {
            instance.world_from_object = by * instance.world_from_object;
        }
        assert!(rig.world.serves(&scene), "nothing has come apart");
        assert!(rig.update(&scene));
        assert_found(&scene, &rig, tracer, "moved together");
        for step in 0..3 {
            let leaving = &mut scene.instances[3].world_from_object;
            *leaving = DAffine3::from_translation(DVec3::X) * *leaving;
            let serves = rig.world.serves(&scene);
            assert_eq!(serves, step > 0, "it has its own structure from then on");
            assert!(rig.update(&scene));
            assert_found(&scene, &rig, tracer, "taken apart");
        }
    }
}

/// Keyframes that are exchanged together.
#[test]
fn keyframes_of_one_group_share_structures() {
    for tracer in tracers(&test_device()) {
        let mut scene = nested();
        for (i, scale) in [(0, 1.6), (1, 1.2), (3, 0.7)] {
            let first = scene.meshes.len();
            scene.meshes.extend((0..3).map(|k| {
                let mut mesh = beat(2 * k, 2);
                for p in &mut mesh.positions {
                    *p = p.map(|x| x * scale);
                }
                mesh.into()
            }));
            let instance = &mut scene.instances[i];
            instance.keyframes.meshes = (first..first + 3).collect();
            instance.keyframes.group = Some(7);
            instance.mesh = first;
        }
        let mut rig = Rig::new(&scene, tracer);
        for k in [0, 1, 2, 1, 0] {
            for i in [0, 1, 3] {
                let instance = &mut scene.instances[i];
                instance.mesh = instance.keyframes.meshes[k];
            }
            scene.instances[1].shown = k != 2;
            assert!(rig.world.serves(&scene));
            rig.update(&scene);
            assert_found(&scene, &rig, tracer, &format!("keyframe {k}"));
        }
    }
}

/// A ray enters a shared structure once; and the comparison notices triangles with a wrong owner.
#[test]
fn a_shared_structure_is_entered_once_and_a_wrong_owner_is_noticed() {
    let scene = nested();
    let mut rig = Rig::new(&scene, Tracer::Bvh);
    let rays = rays(&scene, 4000, 5);
    let most = |rig: &Rig| {
        let traced = rig.trace(&rays);
        traced.iter().map(|hit| hit.counts.instances_reached).max()
    };
    assert_eq!(most(&rig), Some(2), "what is shared, and the box");
    let first = rig.world.rows()[0].owners as usize;
    let mut words: Vec<u32> = rig.device.read_back_as(rig.world.triangles()).unwrap();
    // The two outermost are exchanged.
    let swapped = |owner: u32| owner ^ u32::from(owner < 2);
    for word in &mut words[first..] {
        *word = swapped(*word & 0xffff) | swapped(*word >> 16) << 16;
    }
    let planted = rig.storage("triangles", bytemuck::cast_slice(&words));
    rig.replaced.push((TRIANGLES, planted));
    let expected: Vec<_> = rays.par_iter().map(|ray| expected(&scene, ray)).collect();
    let found = rig.found(&rays);
    let [_, elsewhere] = wrong(&scene, &rays, &expected, &found);
    assert!(elsewhere > 200, "{elsewhere}");
}
