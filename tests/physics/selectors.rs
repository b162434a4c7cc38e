//! Changing shapes: hits of rays, and the cost of a union box.

use insonify::scene::Scene;
use insonify::sim::tracer::Tracer;
use insonify_tools::reference::intersect::Hit;
use rayon::prelude::*;

use crate::common::crossings::beating::{KEYFRAMES, beating, show, strategies, union_box};
use crate::common::crossings::compare::{by_aim, expected, slips, wrong};
use crate::common::crossings::device::Rig;
use crate::common::crossings::rays::{Ray, rays};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot, TRACERS};

/// Check T32.
pub fn every_strategy_shows_the_keyframe() -> Check {
    Check {
        row: "T32",
        name: "every_strategy_shows_the_keyframe",
        claim: "On every keyframe of instances that beat out of step, rays meet what testing all triangles \
            of that keyframe in double precision finds, whether structures are selected, masked, \
            exchanged, rebuilt, refitted or interpolated; what a union box costs in false \
            intersections is 1 - SA(child)/SA(union) of isotropic lines (Cauchy, Crofton), within 1 %.",
        planted: "The keyframe before; the child's volume instead of its surface.",
        run,
    }
}

const RAYS: usize = 600;

fn run(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut references = References::default();
    for tracer in TRACERS {
        for strategy in strategies(tracer) {
            let mut scene = beating(strategy);
            let mut rig = Rig::on(&bench.device, &scene, tracer);
            let mut bad = [0; 2];
            for k in 0..KEYFRAMES {
                show(&mut scene, k);
                match physics {
                    Physics::Right => drop(rig.update(&scene)),
                    // Hidden instances have no triangles to compare with.
                    Physics::Planted => scene.instances[3].shown = true,
                }
                let still = scene.still();
                let Reference { rays, exact, .. } = references.of(&still, k);
                let found = by_aim(&wrong(&still, rays, exact, &rig.found(rays)));
                bad.iter_mut().zip(found).for_each(|(sum, n)| *sum += n);
            }
            let half = KEYFRAMES * RAYS / 2;
            let mut figure = |what, count: usize, allowed: usize| {
                let what = format!(
                    "{tracer}, {strategy}: of {half} rays {what}, other hits than by brute force"
                );
                out.compare(what, count as f64, 0.0, allowed as f64);
            };
            figure("at vertices and edges", bad[0], slips(tracer, half));
            figure("elsewhere", bad[1], 0);
        }
    }
    union_boxes(bench, physics, &mut out);
    out
}

/// Vertices and triangles of each instance.
type Shapes = Vec<(Vec<[f32; 3]>, Vec<[u32; 3]>)>;

/// Rays at a keyframe, and what they meet by brute force.
struct Reference {
    k: usize,
    shapes: Shapes,
    rays: Vec<Ray>,
    exact: Vec<Option<Hit>>,
}

/// References, each made once for a keyframe's shapes: most strategies show the same.
#[derive(Default)]
struct References(Vec<Reference>);

impl References {
    fn of(&mut self, still: &Scene, k: usize) -> &Reference {
        let meshes = still.instances.iter().map(|i| &still.meshes[i.mesh]);
        let shapes: Shapes = meshes.map(|m| (m.positions.clone(), m.triangles.clone())).collect();
        let known = self.0.iter().position(|known| (known.k, &known.shapes) == (k, &shapes));
        let at = known.unwrap_or_else(|| {
            let rays = rays(still, RAYS, k as u64);
            let exact = rays.par_iter().map(|r| expected(still, r)).collect();
            self.0.push(Reference { k, shapes, rays, exact });
            self.0.len() - 1
        });
        &self.0[at]
    }
}

fn union_boxes(bench: &Bench, physics: Physics, out: &mut Outcome) {
    let (mut line, mut dots) = (Vec::new(), Vec::new());
    for spread in [0.0, 10.0, 40.0, 160.0] {
        let found = union_box(spread, |scene| Rig::on(&bench.device, scene, Tracer::Bvh));
        let expected = match physics {
            Physics::Right => found.expected,
            // Both boxes are equally wide and deep: their volumes are as their lengths.
            Physics::Planted => 1.0 - 30.0 / (30.0 + spread),
        };
        out.compare(
            format!("bvh: F1 of boxes {spread} mm apart, {} lines", found.met),
            found.missed,
            expected,
            0.01,
        )
        .unlike("every second line meets the other child alone", 0.5);
        line.push([spread, expected]);
        dots.push([spread, found.missed]);
    }
    out.plots.push(Plot::linear(
        "False intersections of a union box",
        ["distance between keyframes, mm", "share of the lines that meet the union"],
        vec![Curve::line("1 - SA(child)/SA(union)", line), Curve::dots("bvh", dots)],
    ));
}
