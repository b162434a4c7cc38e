//! Hits of rays on triangles, by both tracers. The suite of all kinds of rays is `tests/intersect`.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use insonify::scene::{Scene, shapes};
use insonify::sim::tracer::Tracer;
use rayon::prelude::*;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot, TRACERS};
use compare::{by_aim, expected, slips, wrong};
use device::{Rig, Traced};
use rays::{Ray, aimed_at_seams, baked, mirrored, placement, rays, scene, turned};

use crate::common::crossings::{compare, device, rays};

/// Check T31.
pub fn placements_are_transforms_of_the_mesh() -> Check {
    Check {
        row: "T31",
        name: "placements_are_transforms_of_the_mesh",
        claim: "A ray taken into the frame of a mesh that is turned, stretched or mirrored meets it \
            where a ray of the world meets the same mesh with its placement worked into the vertices: \
            1e-4 mm, shading normals 1e-4. Rays that meet the surface at more than 60 degrees are left \
            out: along them rounding moves the point by its displacement over the cosine.",
        planted: "A placement a thousandth of a millimetre aside.",
        run: placements,
    }
}

/// A turned, a stretched and a mirrored placement.
fn three_placements() -> [(&'static str, DAffine3); 3] {
    let turned =
        placement(DVec3::ONE, DVec3::new(1.0, -2.0, 0.5), 0.9, DVec3::new(20.0, -10.0, 70.0));
    let stretched =
        placement(DVec3::new(0.3, 1.0, 2.5), DVec3::ONE, 2.5, DVec3::new(-30.0, 5.0, 50.0));
    let mirrored =
        placement(DVec3::new(1.0, 1.0, -1.2), DVec3::Y, -0.4, DVec3::new(5.0, 5.0, 90.0));
    [("turned", turned), ("stretched", stretched), ("mirrored", mirrored)]
}

fn placements(bench: &Bench, physics: Physics) -> Outcome {
    let aside = match physics {
        Physics::Right => 0.0,
        Physics::Planted => 1e-3,
    };
    let mesh = shapes::ellipsoid([10.0, 15.0, 12.0], 3);
    let mut out = Outcome::default();
    for (what, world_from_object) in three_placements() {
        let flat = scene(vec![(baked(&mesh, &world_from_object), DAffine3::IDENTITY)]);
        let moved = DAffine3::from_translation(DVec3::X * aside) * world_from_object;
        let placed = scene(vec![(mesh.clone(), moved)]);
        let elsewhere = |(i, ray)| (!aimed_at_seams(i)).then_some(ray);
        let rays: Vec<Ray> =
            rays(&flat, 20_000, 31).into_iter().enumerate().filter_map(elsewhere).collect();
        for tracer in TRACERS {
            let [a, b] =
                [&placed, &flat].map(|scene| Rig::on(&bench.device, scene, tracer).trace(&rays));
            let cosine = |hit: &Traced, ray: &Ray| hit.geometric.dot(ray.direction()).abs();
            let both = rays.iter().zip(a.iter().zip(&b)).filter(|(ray, (a, b))| {
                let met = a.found.is_some() && b.found.is_some();
                met && cosine(a, ray).min(cosine(b, ray)) >= 0.5
            });
            let (mut compared, mut inward, mut apart, mut turned) = (0, 0, 0f64, 0f64);
            for (_, (a, b)) in both {
                compared += 1;
                let outward = a.position - world_from_object.translation;
                inward += u32::from(a.geometric.dot(outward) <= 0.0);
                inward += u32::from(a.shading.dot(a.geometric) <= 0.5);
                apart = apart.max(a.position.distance(b.position));
                turned = turned.max(a.shading.distance(b.shading));
            }
            assert!(compared > 1000, "{compared} rays met the mesh head-on");
            let name = |quantity| format!("{tracer}: {what}: {quantity}");
            out.compare(name("largest distance of the points, mm"), apart, 0.0, 1e-4);
            out.compare(name("largest difference of shading normals"), turned, 0.0, 1e-4);
            out.compare(name("normals that point inward"), f64::from(inward), 0.0, 0.0)
                .unlike("triangles wound the other way", f64::from(compared));
        }
    }
    out
}

/// Check T33.
pub fn closest_hits_are_those_of_brute_force_in_double_precision() -> Check {
    Check {
        row: "T33",
        name: "closest_hits_are_those_of_brute_force_in_double_precision",
        claim: "Every ray meets the triangle, at the distance (1e-5 relative, and what single precision \
            of coordinates explains), that testing all triangles in double precision finds: arbitrary \
            rays, rays along axes, grazing ones, and rays at vertices and edges that triangles share. \
            Of those aimed at seams to the last bit, a device's own triangle test may lose some: Mesa's \
            software driver up to 2 in 100 at a box.",
        planted: "A mesh that lacks a triangle.",
        run: closest_hits,
    }
}

/// A scene of overlapping instances, turned and mirrored.
fn parts() -> Scene {
    scene(vec![
        (shapes::sphere(15.0, 2), mirrored()),
        (shapes::cylinder(5.0, 60.0, 16), turned()),
        (shapes::cuboid([30.0, 20.0, 10.0]), DAffine3::IDENTITY),
    ])
}

fn closest_hits(bench: &Bench, physics: Physics) -> Outcome {
    let scene = parts();
    let mut traced = scene.clone();
    if physics == Physics::Planted {
        Arc::make_mut(&mut traced.meshes[0]).triangles[17] = [0; 3];
    }
    let rays = rays(&scene, 60_000, 33);
    let exact = bench.memo.once(&"closest hits", true, || -> Vec<_> {
        rays.par_iter().map(|ray| expected(&scene, ray)).collect()
    });
    let mut out = Outcome::default();
    for tracer in TRACERS {
        let found = Rig::on(&bench.device, &traced, tracer).found(&rays);
        let [aimed, elsewhere] = by_aim(&wrong(&scene, &rays, &exact, &found));
        let half = rays.len() / 2;
        let mut figure = |what, count: usize, allowed: usize| {
            let what = format!("{tracer}: of {half} rays {what}, other hits than by brute force");
            out.compare(what, count as f64, 0.0, allowed as f64)
                .unlike("every second ray slips through", half as f64 / 2.0);
        };
        figure("at vertices and edges", aimed, slips(tracer, half));
        figure("elsewhere", elsewhere, 0);
    }
    out.plots.push(steps(bench));
    out
}

/// Cost of a ray over the size of the mesh.
fn steps(bench: &Bench) -> Plot {
    let (mut brute, mut nodes, mut triangles) = (vec![], vec![], vec![]);
    for subdivisions in 0..6 {
        let place = DAffine3::from_translation(DVec3::Z * 60.0);
        let scene = scene(vec![(shapes::sphere(20.0, subdivisions), place)]);
        let size = scene.meshes[0].triangles.len() as f64;
        let hits = Rig::on(&bench.device, &scene, Tracer::Bvh).trace(&rays(&scene, 4000, 3));
        let mean = |f: fn(&Traced) -> u32| {
            hits.iter().map(|h| f64::from(f(h))).sum::<f64>() / hits.len() as f64
        };
        brute.push([size, size]);
        nodes.push([size, mean(|h| h.counts.node_visits)]);
        triangles.push([size, mean(|h| h.counts.triangle_tests)]);
    }
    Plot {
        logarithmic: [true; 2],
        ..Plot::linear(
            "Work per ray at a sphere",
            ["triangles of the mesh", "per ray"],
            vec![
                Curve::line("brute force: triangles tested", brute),
                Curve::dots("bvh: triangles tested", triangles),
                Curve::dots("bvh: nodes visited", nodes),
            ],
        )
    }
}
