//! T32: every strategy finds what brute force finds on every keyframe, and the paper's selector pays
//! with as many false intersections as geometry says.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use insonify::scene::{Keyframes, Mesh, Scene, Strategy, shapes};
use insonify::sim::tracer::Tracer;
use rayon::prelude::*;

use super::compare::{expected, slips};
use super::device::Rig;
use super::rays::{Random, Ray, placement, rays, scene, turned};
use super::{TRACERS, wrong};

/// More than there are mask bits.
const KEYFRAMES: usize = 9;

/// A sphere that beats: keyframe `k` of one topology, shifted and squeezed.
fn beat(k: usize, topology: u32) -> Mesh {
    let mut mesh = shapes::sphere(14.0, topology);
    let phase = TAU * k as f64 / KEYFRAMES as f64;
    let squeeze = DVec3::new(1.0 + 0.3 * phase.sin(), 1.0 - 0.25 * phase.sin(), 1.0);
    let shift = DVec3::new(
        6.0 * phase.cos(),
        4.0 * phase.sin(),
        2.0 * (2.0 * phase).sin(),
    );
    for p in &mut mesh.positions {
        let at = DVec3::from(p.map(f64::from));
        *p = (at * squeeze + shift * (1.0 + 0.03 * at.z))
            .as_vec3()
            .into();
    }
    mesh
}

/// Two instances that beat out of step, one that appears and disappears, and a still box between.
fn beating(strategy: Strategy) -> Scene {
    let mut scene = scene(vec![
        (beat(0, 2), DAffine3::IDENTITY),
        (shapes::cuboid([12.0, 50.0, 12.0]), turned()),
        (
            beat(0, 1),
            placement(
                DVec3::splat(1.3),
                DVec3::Y,
                0.7,
                DVec3::new(30.0, 0.0, 20.0),
            ),
        ),
        (
            shapes::cylinder(6.0, 30.0, 12),
            placement(DVec3::ONE, DVec3::X, 0.4, DVec3::new(-25.0, 5.0, 30.0)),
        ),
    ]);
    for instance in [0, 2] {
        // Other strategies may change their triangles from one keyframe to the next.
        let fine = |k: usize| match instance == 0 && k % 2 == 1 && !strategy.needs_shared_topology()
        {
            true => 3,
            false => 2,
        };
        let first = scene.meshes.len();
        scene
            .meshes
            .extend((0..KEYFRAMES).map(|k| beat(k, fine(k))));
        scene.instances[instance].keyframes = Keyframes {
            meshes: (first..first + KEYFRAMES).collect(),
            strategy,
            ..Keyframes::default()
        };
    }
    if !strategy.needs_shared_topology() {
        scene.instances[3].keyframes.strategy = strategy;
    }
    show(&mut scene, 0);
    scene
}

/// Sets keyframe `k`, and another for the second instance. Between keyframes under `interpolate`.
fn show(scene: &mut Scene, k: usize) {
    for (instance, shift) in [(0, 0), (2, 4)] {
        let instance = &mut scene.instances[instance];
        let k = (k + shift) % KEYFRAMES;
        let keyframes = &mut instance.keyframes;
        keyframes.blend = match keyframes.strategy {
            // Cubic weights at a third of the way: the outer two are negative.
            Strategy::Interpolate => [
                (KEYFRAMES - 1, -2.0 / 27.0),
                (0, 7.0 / 9.0),
                (1, 1.0 / 3.0),
                (2, -1.0 / 27.0),
            ]
            .map(|(j, weight)| ((k + j) % KEYFRAMES, weight)),
            _ => [(k, 1.0), (k, 0.0), (k, 0.0), (k, 0.0)],
        };
        instance.mesh = keyframes.meshes[keyframes.nearest()];
    }
    scene.instances[3].shown = k % 3 != 1;
}

fn strategies(tracer: Tracer) -> impl Iterator<Item = Strategy> {
    let has = move |s: &Strategy| tracer == Tracer::Bvh || *s != Strategy::Union;
    Strategy::ALL.into_iter().filter(has)
}

#[test]
fn every_strategy_finds_the_keyframe_that_is_shown() {
    for tracer in TRACERS {
        for strategy in strategies(tracer) {
            let mut scene = beating(strategy);
            let mut rig = Rig::new(&scene, tracer);
            // Back and forth, so that what stays behind from another keyframe would show.
            for k in [0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 5, 1] {
                show(&mut scene, k);
                scene.instances[2].world_from_object.translation.y = k as f64;
                rig.update(&scene);
                let still = scene.still();
                let rays = rays(&still, 1500, k as u64);
                let expected: Vec<_> = rays.par_iter().map(|r| expected(&still, r)).collect();
                assert!(expected.iter().flatten().count() > 500);
                let [aimed, elsewhere] = wrong(&still, &rays, &expected, &rig.found(&rays));
                assert!(
                    elsewhere == 0 && aimed <= slips(tracer, rays.len() / 2),
                    "{strategy}, {tracer}, keyframe {k}: {aimed} wrong at seams, {elsewhere} elsewhere"
                );
            }
            rig.assert_silent();
        }
    }
}

/// The comparison must see a keyframe that is not the one shown.
#[test]
fn a_stale_keyframe_is_noticed() {
    let mut scene = beating(Strategy::Selector);
    let rig = Rig::new(&scene, Tracer::Bvh);
    show(&mut scene, 3);
    let still = scene.still();
    let rays = rays(&still, 1500, 1);
    let expected: Vec<_> = rays.iter().map(|r| expected(&still, r)).collect();
    let [_, elsewhere] = wrong(&still, &rays, &expected, &rig.found(&rays));
    assert!(elsewhere > 100, "{elsewhere}");
}

/// What each strategy has to record when the keyframe changes, and that none does when nothing does.
#[test]
fn only_what_a_strategy_needs_is_recorded() {
    for strategy in Strategy::ALL {
        let mut scene = beating(strategy);
        let mut rig = Rig::new(&scene, Tracer::Bvh);
        assert!(!rig.update(&scene), "{strategy}: nothing has changed");
        show(&mut scene, 3);
        assert!(rig.update(&scene), "{strategy}: the keyframe has changed");
        assert!(!rig.update(&scene), "{strategy}: it has been shown");
    }
}

/// Whether a line in double precision meets a box.
fn meets(bounds: [[f32; 3]; 2], line: &Ray) -> bool {
    let [low, high] = bounds.map(|corner| DVec3::from(corner.map(f64::from)));
    let (a, b) = (
        (low - line.origin()) / line.direction(),
        (high - line.origin()) / line.direction(),
    );
    a.min(b).max_element() <= a.max(b).min_element()
}

fn area(bounds: [[f32; 3]; 2]) -> f64 {
    let [x, y, z] = std::array::from_fn(|i| f64::from(bounds[1][i] - bounds[0][i]));
    2.0 * (x * y + y * z + z * x)
}

/// Cauchy-Crofton: of isotropic uniform lines that meet a convex body, those that meet one within it
/// are as its surface to the outer one's. So is the paper's price, F1, of a union box.
#[test]
fn false_intersections_of_a_union_box_follow_surface_areas() {
    for spread in [0.0, 10.0, 40.0, 160.0] {
        let mut scene = scene(vec![(
            shapes::cuboid([30.0, 12.0, 20.0]),
            DAffine3::IDENTITY,
        )]);
        let mut moved = scene.meshes[0].clone();
        for p in &mut moved.positions {
            p[0] += spread as f32;
        }
        scene.meshes.push(moved);
        scene.instances[0].keyframes = Keyframes {
            meshes: vec![0, 1],
            strategy: Strategy::Union,
            ..Keyframes::default()
        };
        let (child, mut outer) = (scene.meshes[0].bounds(), scene.meshes[0].bounds());
        outer[1][0] += spread as f32;
        let expected = 1.0 - area(child) / area(outer);
        let mut random = Random::new(5);
        let rig = Rig::new(&scene, Tracer::Bvh);
        // Uniform lines: through a random point of a disc across a random direction.
        let radius = 30.0 + 0.5 * spread;
        let lines: Vec<Ray> = (0..100_000)
            .map(|_| {
                let d = random.direction();
                let u = d.any_orthonormal_vector();
                let (r, angle) = (radius * random.unit().sqrt(), TAU * random.unit());
                let p = DVec3::new(0.5 * spread, 0.0, 0.0)
                    + r * (angle.cos() * u + angle.sin() * d.cross(u));
                Ray::new(p - 2.0 * radius * d, d)
            })
            .collect();
        // Nodes have coarser boxes: what meets only those is no line of the formula.
        let (mut met, mut missed, mut beside) = (0.0, 0.0, 0);
        for (line, hit) in lines.iter().zip(rig.trace(&lines)) {
            let counts = hit.counts;
            assert_eq!(counts.false_boxes, 0, "a box fills its bounds");
            let entered = counts.instances_reached - counts.false_unions;
            assert_eq!(hit.found.is_some(), entered == 1);
            if !meets(outer, line) {
                beside += counts.instances_reached;
                continue;
            }
            assert_eq!(
                counts.instances_reached, 1,
                "the union box holds the keyframes"
            );
            met += 1.0;
            missed += f64::from(counts.false_unions);
        }
        let (found, deviation) = (missed / met, (expected * (1.0 - expected) / met).sqrt());
        println!(
            "spread {spread} mm: F1 {found:.4}, 1 - SA(child)/SA(union) {expected:.4}, \
             {met} lines met the union, {beside} its node's box alone"
        );
        // 1 % is asked for; without spread there is none but by rounding at the box's edge.
        assert!(
            (found - expected).abs() < 0.01_f64.min(4.0 * deviation + 1e-3),
            "{found} {expected}"
        );
    }
}
