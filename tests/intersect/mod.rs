//! Both tracers on the device against brute force in double precision.
//!
//! The device is a software driver where no GPU is at hand; every check runs on both tracers.

mod joined;
mod keyframes;
mod placements;
mod refit;
mod splits;
mod suite;
mod walk;

use std::sync::Arc;

use compare::{Found, Verdict, by_aim, expected, judge, slips};
use device::{Rig, Traced};
use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::{Scene, shapes};
use insonify::sim::tracer::Tracer;
use insonify_tools::reference::intersect::Hit;
use rayon::prelude::*;
use rays::{Random, Ray, aimed_at_seams, corners, mirrored, placement, rays, scene, turned};
use walk::{clear_hits, walk};

use crate::common::crossings::{beating, compare, device, rays};
use crate::common::tracers;
use crate::common::tracers::tracers;

fn shape(index: usize) -> Scene {
    let near = placement(DVec3::ONE, DVec3::X, 0.0, DVec3::new(0.0, 0.0, 60.0));
    match index {
        0 => scene(vec![(shapes::sphere(20.0, 2), near)]),
        1 => scene(vec![
            (shapes::cuboid([30.0, 20.0, 10.0]), DAffine3::IDENTITY),
            (shapes::cuboid([8.0; 3]), near),
        ]),
        2 => scene(vec![
            (shapes::cylinder(5.0, 60.0, 16), turned()),
            (shapes::sphere(15.0, 1), mirrored()),
        ]),
        // Metres and micrometres side by side, and parts within parts.
        _ => scene(vec![
            (
                shapes::ellipsoid([0.02, 0.03, 0.025], 1),
                placement(DVec3::splat(1e3), DVec3::Z, 0.3, DVec3::new(0.0, 5.0, 60.0)),
            ),
            (
                shapes::sphere(9e3, 1),
                placement(DVec3::splat(1e-3), DVec3::X, 2.0, DVec3::new(2.0, 5.0, 62.0)),
            ),
            (shapes::cuboid([4.0, 4.0, 40.0]), turned()),
        ]),
    }
}

/// Numbers of rays that the device answers wrongly: aimed at vertices and edges, and others.
fn wrong(
    scene: &Scene,
    rays: &[Ray],
    expected: &[Option<Hit>],
    found: &[Option<Found>],
) -> [usize; 2] {
    let bad = compare::wrong(scene, rays, expected, found);
    for &i in bad.iter().take(5) {
        println!("{:?}: expected {:?}, found {:?}", rays[i], expected[i], found[i]);
    }
    by_aim(&bad)
}

/// T33: a million rays, none of which may differ by more than single precision explains.
#[test]
fn closest_hits_are_those_of_brute_force() {
    for index in 0..4 {
        let scene = shape(index);
        let rays = rays(&scene, 125_000, 33 + index as u64);
        let expected: Vec<_> = rays.par_iter().map(|ray| expected(&scene, ray)).collect();
        for tracer in tracers(&test_device()) {
            let rig = Rig::new(&scene, tracer);
            let [aimed, elsewhere] = wrong(&scene, &rays, &expected, &rig.found(&rays));
            assert!(
                elsewhere == 0 && aimed <= slips(tracer, rays.len() / 2),
                "shape {index}, {tracer}: {aimed} wrong at vertices and edges, {elsewhere} elsewhere"
            );
            rig.assert_silent();
        }
    }
}

/// T33: from inside a closed mesh nothing escapes, wherever it is aimed.
#[test]
fn a_closed_mesh_never_leaks() {
    for index in 0..4 {
        let scene = shape(index);
        let mut random = Random::new(7);
        let rays: Vec<Ray> = (0..40_000)
            .map(|i| {
                let instance = random.below(scene.instances.len());
                let placed = &scene.instances[instance];
                let centre =
                    placed.world_from_object.translation + random.direction() * 0.5 * random.unit();
                let mesh = &scene.meshes[placed.mesh];
                let [a, b, c] = corners(&scene, instance, random.below(mesh.triangles.len()));
                match i % 4 {
                    0 => Ray::new(centre, a - centre),
                    1 => Ray::new(centre, a.lerp(b, random.unit()) - centre),
                    2 => Ray::new(centre, (a + b + c) / 3.0 - centre),
                    _ => Ray::new(centre, random.direction()),
                }
            })
            .collect();
        for tracer in tracers(&test_device()) {
            let rig = Rig::new(&scene, tracer);
            let found = rig.found(&rays);
            let escaped = (0..rays.len()).filter(|&i| found[i].is_none());
            let (aimed, elsewhere): (Vec<_>, Vec<_>) = escaped.partition(|&i| aimed_at_seams(i));
            assert!(
                elsewhere.is_empty() && aimed.len() <= slips(tracer, rays.len() / 2),
                "shape {index}, {tracer}: {} escape at vertices and edges, {} elsewhere",
                aimed.len(),
                elsewhere.len()
            );
            rig.assert_silent();
        }
    }
}

/// T33: entries and exits alternate along rays that begin and end outside.
#[test]
fn a_ray_leaves_whatever_it_enters() {
    const MARGIN: f64 = 2e-3;
    for index in [0, 2] {
        let mut scene = shape(index);
        scene.instances.truncate(1);
        let mut rays = rays(&scene, 30_000, 11);
        for ray in &mut rays {
            // From outside, whatever the ray was aimed at.
            ray.origin = (ray.origin() - ray.direction() * 200.0).as_vec3().into();
        }
        let exact = |ray: &Ray| clear_hits(&scene, ray, 4.0 * MARGIN, |_, _| false);
        let exact: Vec<_> = rays.par_iter().map(exact).collect();
        for tracer in tracers(&test_device()) {
            let rig = Rig::new(&scene, tracer);
            let (mut clear, mut odd) = (0, Vec::new());
            for (i, (ray, hits)) in rays.iter().zip(walk(&rig, &rays, MARGIN)).enumerate() {
                let Some(exact) = &exact[i] else { continue };
                clear += 1;
                let alternate = hits.iter().enumerate().all(|(i, hit)| hit.2 == (i % 2 == 0));
                if !alternate || !hits.len().is_multiple_of(2) {
                    println!("{ray:?} meets {hits:?}, exactly {exact:?}");
                    odd.push(i);
                }
            }
            assert!(clear > 10_000, "only {clear} rays are clear of outlines");
            let [aimed, elsewhere] = by_aim(&odd);
            assert!(
                elsewhere == 0 && aimed <= slips(tracer, clear / 2),
                "shape {index}, {tracer}: of {clear} rays {aimed} that are aimed at vertices and edges do not leave, \
                 and {elsewhere} others"
            );
            rig.assert_silent();
        }
    }
}

/// No kernel input hangs or hits: directions of zero, infinities, NaN.
#[test]
fn input_that_is_no_ray_misses() {
    let scene = shape(1);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let good = Ray::new(DVec3::new(0.1, 0.2, -50.0), DVec3::Z);
    let mut list = vec![Ray { direction: [0.0; 3], ..good }];
    for value in bad {
        for axis in 0..3 {
            let (mut origin, mut direction) = (good, good);
            origin.origin[axis] = value;
            direction.direction[axis] = value;
            list.extend([origin, direction]);
        }
        list.push(Ray { t_min: value.abs(), ..good });
        list.push(Ray { direction: [value; 3], ..good });
    }
    list.push(Ray { t_max: f32::NAN, ..good });
    for tracer in tracers(&test_device()) {
        let rig = Rig::new(&scene, tracer);
        for (ray, hit) in list.iter().zip(rig.found(&list)) {
            assert_eq!(hit, None, "{tracer}: {ray:?}");
        }
        assert!(rig.found(&[good])[0].is_some(), "{tracer} meets what is there");
        rig.assert_silent();
    }
}

/// The comparison above notices a wrong bound and a missing triangle.
#[test]
fn planted_errors_are_noticed() {
    let scene = shape(0);
    let rays = rays(&scene, 20_000, 3);
    let expected: Vec<_> = rays.iter().map(|ray| expected(&scene, ray)).collect();
    let found_wrong = |rig: &Rig| wrong(&scene, &rays, &expected, &rig.found(&rays))[1];
    assert_eq!(found_wrong(&Rig::new(&scene, Tracer::Bvh)), 0);
    let mut rig = Rig::new(&scene, Tracer::Bvh);
    rig.swap_a_bound();
    assert!(found_wrong(&rig) > 0, "a flipped bound goes unnoticed");
    let mut rig = Rig::new(&scene, Tracer::Bvh);
    rig.drop_a_triangle();
    assert!(found_wrong(&rig) > 0, "a missing triangle goes unnoticed");

    let mut less = scene.clone();
    Arc::make_mut(&mut less.meshes[0]).triangles[17] = [0; 3];
    for tracer in tracers(&test_device()) {
        assert!(found_wrong(&Rig::new(&less, tracer)) > 0, "{tracer}: a hole goes unnoticed");
    }

    // The comparator itself, on exact answers spoilt by hand.
    let ray = Ray::new(DVec3::new(1.0, 2.0, 0.0), DVec3::Z);
    let hit = compare::expected(&scene, &ray).unwrap();
    let found = Found { t: hit.t, instance: hit.instance, triangle: hit.triangle };
    assert_eq!(judge(&scene, &ray, Some(hit), Some(found)), Verdict::Same);
    let spoilt = [
        None,
        Some(Found { t: hit.t * 1.000_1, ..found }),
        Some(Found { triangle: (hit.triangle + 100) % 320, ..found }),
    ];
    for found in spoilt {
        assert_eq!(judge(&scene, &ray, Some(hit), found), Verdict::Wrong, "{found:?}");
    }
}

/// Steps per ray do not creep up; measured 11.2 and 4.6 on these 20,480 triangles.
#[test]
fn traversal_steps_stay_small() {
    let scene = scene(vec![(shapes::sphere(20.0, 5), DAffine3::from_translation(DVec3::Z * 60.0))]);
    let rays: Vec<Ray> = (0..4_000)
        .map(|i| {
            let (l, k) = (i % 100, i / 100);
            let angle = (f64::from(l) / 99.0 - 0.5) * 0.5;
            Ray::new(
                DVec3::new(0.0, f64::from(k) * 0.5 - 10.0, 0.0),
                DVec3::new(angle.sin(), 0.0, angle.cos()),
            )
        })
        .collect();
    let rig = Rig::new(&scene, Tracer::Bvh);
    let hits: Vec<Traced> = rig.trace(&rays);
    let mean = |f: fn(&Traced) -> u32| {
        hits.iter().map(|h| f64::from(f(h))).sum::<f64>() / hits.len() as f64
    };
    let (nodes, triangles) = (mean(|h| h.counts.node_visits), mean(|h| h.counts.triangle_tests));
    assert!(nodes < 14.0 && triangles < 6.0, "{nodes:.2} nodes, {triangles:.2} triangles per ray");
}
