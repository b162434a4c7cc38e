//! T32's scenes: instances with keyframes by every strategy, and a union box for the paper's price.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use insonify::scene::{Keyframes, Mesh, Scene, Strategy, shapes};
use insonify::settings::Words;
use insonify::sim::tracer::Tracer;

use super::device::Rig;
use super::rays::{Random, Ray, placement, scene, turned};

/// Number of keyframes, more than there are mask bits.
pub const KEYFRAMES: usize = 9;

/// A sphere that beats: keyframe `k` of one topology, shifted and squeezed.
pub fn beat(k: usize, topology: u32) -> Mesh {
    let mut mesh = shapes::sphere(14.0, topology);
    let phase = TAU * k as f64 / KEYFRAMES as f64;
    let squeeze = DVec3::new(1.0 + 0.3 * phase.sin(), 1.0 - 0.25 * phase.sin(), 1.0);
    let shift = DVec3::new(6.0 * phase.cos(), 4.0 * phase.sin(), 2.0 * (2.0 * phase).sin());
    for p in &mut mesh.positions {
        let at = DVec3::from(p.map(f64::from));
        *p = (at * squeeze + shift * (1.0 + 0.03 * at.z)).as_vec3().into();
    }
    mesh
}

/// Two instances that beat out of step, one that appears and disappears, and a still box between.
pub fn beating(strategy: Strategy) -> Scene {
    let mut scene = scene(vec![
        (beat(0, 2), DAffine3::IDENTITY),
        (shapes::cuboid([12.0, 50.0, 12.0]), turned()),
        (beat(0, 1), placement(DVec3::splat(1.3), DVec3::Y, 0.7, DVec3::new(30.0, 0.0, 20.0))),
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
        scene.meshes.extend((0..KEYFRAMES).map(|k| beat(k, fine(k)).into()));
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

/// Sets keyframe `k`, and another for the second instance. Under `interpolate`, a state between keyframes.
pub fn show(scene: &mut Scene, k: usize) {
    for (instance, shift) in [(0, 0), (2, 4)] {
        let instance = &mut scene.instances[instance];
        let k = (k + shift) % KEYFRAMES;
        let keyframes = &mut instance.keyframes;
        keyframes.blend = match keyframes.strategy {
            // Cubic weights at a third of the way: the outer two are negative.
            Strategy::Interpolate => {
                [(KEYFRAMES - 1, -2.0 / 27.0), (0, 7.0 / 9.0), (1, 1.0 / 3.0), (2, -1.0 / 27.0)]
                    .map(|(j, weight)| ((k + j) % KEYFRAMES, weight))
            }
            _ => [(k, 1.0), (k, 0.0), (k, 0.0), (k, 0.0)],
        };
        instance.mesh = keyframes.meshes[keyframes.nearest()];
    }
    scene.instances[3].shown = k % 3 != 1;
}

pub fn strategies(tracer: Tracer) -> impl Iterator<Item = Strategy> {
    let has = move |s: &Strategy| tracer == Tracer::Bvh || *s != Strategy::Selector;
    Strategy::ALL.iter().copied().filter(has)
}

/// Returns whether a line in double precision meets a box.
fn meets(bounds: [[f32; 3]; 2], line: &Ray) -> bool {
    let [low, high] = bounds.map(|corner| DVec3::from(corner.map(f64::from)));
    let (a, b) =
        ((low - line.origin()) / line.direction(), (high - line.origin()) / line.direction());
    a.min(b).max_element() <= a.max(b).min_element()
}

fn area(bounds: [[f32; 3]; 2]) -> f64 {
    let [x, y, z] = std::array::from_fn(|i| f64::from(bounds[1][i] - bounds[0][i]));
    2.0 * (x * y + y * z + z * x)
}

/// Counts of lines that meet a union box of two boxes, `spread` mm apart.
pub struct UnionBox {
    /// Lines that met it.
    pub met: f64,
    /// Share of them that missed the keyframe: F1.
    pub missed: f64,
    /// Expected share, 1 - SA(child)/SA(union).
    pub expected: f64,
}

/// Traces isotropic uniform lines at a keyframe of two in a union box, with the rig that is made of the
/// scene.
pub fn union_box(spread: f64, rig: impl Fn(&Scene) -> Rig) -> UnionBox {
    let mut scene = scene(vec![(shapes::cuboid([30.0, 12.0, 20.0]), DAffine3::IDENTITY)]);
    let mut moved = scene.meshes[0].clone();
    for p in &mut Arc::make_mut(&mut moved).positions {
        p[0] += spread as f32;
    }
    scene.meshes.push(moved);
    scene.instances[0].keyframes =
        Keyframes { meshes: vec![0, 1], strategy: Strategy::Selector, ..Keyframes::default() };
    let (child, mut outer) = (scene.meshes[0].bounds(), scene.meshes[0].bounds());
    outer[1][0] += spread as f32;
    let mut random = Random::new(5);
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
    let (mut met, mut missed) = (0.0, 0.0);
    for (line, hit) in lines.iter().zip(rig(&scene).trace(&lines)) {
        let counts = hit.counts;
        assert_eq!(counts.false_boxes, 0, "a box fills its bounds");
        let entered = counts.instances_reached - counts.false_unions;
        assert_eq!(hit.found.is_some(), entered == 1);
        // Nodes have coarser boxes: a line that meets only those does not count in the formula.
        if meets(outer, line) {
            assert_eq!(counts.instances_reached, 1, "the union box holds all");
            met += 1.0;
            missed += f64::from(counts.false_unions);
        }
    }
    UnionBox { met, missed: missed / met, expected: 1.0 - area(child) / area(outer) }
}
