//! Placements: transforms, the order of instances, and movement.

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::shapes;
use rayon::prelude::*;

use super::device::Rig;
use super::rays::{Ray, aimed_at_seams, baked, placement, rays, scene};
use super::shape;
use super::tracers::tracers;
use super::walk::{clear_hits, walk};

fn away_from_seams(rays: Vec<Ray>) -> Vec<Ray> {
    rays.into_iter().enumerate().filter(|(i, _)| !aimed_at_seams(*i)).map(|(_, ray)| ray).collect()
}

/// T31: a placed mesh is hit at the same places as the same mesh with its placement applied to its vertices.
#[test]
fn placements_are_transforms_of_the_mesh() {
    let mesh = shapes::ellipsoid([10.0, 15.0, 12.0], 3);
    let placements = [
        placement(DVec3::ONE, DVec3::new(1.0, -2.0, 0.5), 0.9, DVec3::new(20.0, -10.0, 70.0)),
        placement(
            DVec3::new(0.3, 1.0, 2.5),
            DVec3::new(1.0, 1.0, 1.0),
            2.5,
            DVec3::new(-30.0, 5.0, 50.0),
        ),
        placement(DVec3::new(1.0, 1.0, -1.2), DVec3::Y, -0.4, DVec3::new(5.0, 5.0, 90.0)),
    ];
    for world_from_object in placements {
        let placed = scene(vec![(mesh.clone(), world_from_object)]);
        let flat = scene(vec![(baked(&mesh, &world_from_object), DAffine3::IDENTITY)]);
        let centre = world_from_object.translation;
        let rays = away_from_seams(rays(&placed, 20_000, 31));
        for tracer in tracers(&test_device()) {
            let [a, b] = [&placed, &flat].map(|scene| Rig::new(scene, tracer).trace(&rays));
            let mut compared = 0;
            for ((ray, a), b) in rays.iter().zip(&a).zip(&b) {
                let (Some(_), Some(_)) = (a.found, b.found) else {
                    continue;
                };
                // Along a ray that grazes, rounding moves the point by its displacement over the cosine.
                if a.geometric.dot(ray.direction()).abs() < 0.5
                    || b.geometric.dot(ray.direction()).abs() < 0.5
                {
                    continue;
                }
                compared += 1;
                assert!(a.position.distance(b.position) < 1e-4, "{tracer}: {ray:?}: {a:?} {b:?}");
                assert!(
                    a.geometric.dot(a.position - centre) > 0.0,
                    "{tracer}: inward normal {a:?}"
                );
                // Interpolated between vertices whose rounding of 4e-6 mm lies 0.3 mm apart or more.
                assert!(a.shading.distance(b.shading) < 1e-4, "{tracer}: {a:?} {b:?}");
                assert!(a.shading.dot(a.geometric) > 0.5);
            }
            assert!(compared > 1_000, "only {compared} rays met the mesh head-on");
        }
    }
}

/// T32: the order of instances decides nothing: overlapping ones, and two that coincide.
#[test]
fn the_order_of_instances_changes_no_hit() {
    const MARGIN: f64 = 1e-3;
    let sphere = shapes::sphere(12.0, 2);
    let parts = [
        (sphere.clone(), placement(DVec3::ONE, DVec3::X, 0.0, DVec3::new(0.0, 0.0, 50.0))),
        (sphere.clone(), placement(DVec3::ONE, DVec3::X, 0.0, DVec3::new(0.0, 0.0, 50.0))),
        (sphere, placement(DVec3::new(1.0, 0.7, 1.3), DVec3::Z, 0.5, DVec3::new(9.0, 2.0, 55.0))),
        (
            shapes::cuboid([18.0, 6.0, 30.0]),
            placement(DVec3::ONE, DVec3::Y, 0.6, DVec3::new(-4.0, 1.0, 52.0)),
        ),
    ];
    let orders = [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]];
    let base = scene(parts.to_vec());
    // Seams are tested above.
    let rays = away_from_seams(rays(&base, 8_000, 32));
    let exact: Vec<_> =
        rays.par_iter().map(|ray| clear_hits(&base, ray, 4.0 * MARGIN, twins)).collect();
    for tracer in tracers(&test_device()) {
        let mut clear = 0;
        let walked: Vec<_> = orders
            .iter()
            .map(|order| {
                let scene = scene(order.iter().map(|&i| parts[i].clone()).collect());
                let rig = Rig::new(&scene, tracer);
                let first = walk(&rig, &rays, MARGIN);
                // A surface that coincides with the first hit appears when that is skipped.
                let skipping: Vec<Ray> = rays
                    .iter()
                    .zip(&first)
                    .map(|(&ray, hits)| Ray { skip: hits.first().map(|h| h.1 as u32), ..ray })
                    .collect();
                let behind = rig.found(&skipping);
                (order, first, behind)
            })
            .collect();
        for (i, exact) in exact.iter().enumerate() {
            let Some(exact) = exact.as_ref().filter(|hits| !hits.is_empty()) else {
                continue;
            };
            clear += 1;
            let mut expected: Vec<(f64, usize)> =
                exact.iter().map(|h| (h.t, h.instance.max(1))).collect();
            expected.dedup_by(|a, b| a.1 == b.1 && a.0 - b.0 < MARGIN);
            for (order, first, behind) in &walked {
                let hits = &first[i];
                assert_eq!(
                    hits.len(),
                    expected.len(),
                    "{tracer} {order:?}: {:?}: {hits:?} {exact:?}",
                    rays[i]
                );
                for (hit, (t, instance)) in hits.iter().zip(&expected) {
                    assert!((hit.0 - t).abs() < MARGIN && order[hit.1].max(1) == *instance);
                }
                let twin = expected[0].1 == 1;
                let second = behind[i].map(|f| (f.t, order[f.instance]));
                if twin {
                    let (t, part) = second.expect("the twin is still there");
                    assert!(
                        (t - expected[0].0).abs() < MARGIN && part < 2 && part != order[hits[0].1]
                    );
                }
            }
        }
        assert!(clear > 1_000, "{clear}");
    }
}

fn twins(a: usize, b: usize) -> bool {
    a.max(b) == 1 && a != b
}

/// Moved instances are found at their new places, and unmoved ones are not uploaded again.
#[test]
fn instances_move() {
    let before = shape(2);
    let mut after = before.clone();
    after.instances[1].world_from_object.translation += DVec3::new(25.0, 10.0, -15.0);
    let rays = rays(&after, 5_000, 2);
    for tracer in tracers(&test_device()) {
        let mut rig = Rig::new(&before, tracer);
        assert!(!rig.update(&before), "{tracer}: nothing moved");
        assert!(rig.update(&after));
        assert_eq!(rig.found(&rays), Rig::new(&after, tracer).found(&rays), "{tracer}");
        assert!(!rig.update(&after));
        rig.assert_silent();
    }
}
