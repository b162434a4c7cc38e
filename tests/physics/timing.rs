//! Places of echoes.

use insonify::scene::Scene;

use crate::physics::check::{Bench, Check, Outcome, Physics};
use crate::physics::profile::centre;
use crate::physics::render::Renderer;
use crate::physics::scenes::{add_layer, linear, silent};

/// Check T3.
pub fn a_plate_shows_at_its_time_of_flight() -> Check {
    Check {
        row: "T3",
        name: "a_plate_shows_at_its_time_of_flight",
        claim: "An echo lies at sample c_ref T / dz, T the sum of d_i / c_i: a plate in water, and one \
            that 10 mm of fat push down by 10 (1540 / 1440 - 1) = 0.694 mm.",
        planted: "Water 2 m/s faster than it is said to be; fat as fast as the tissue it replaces.",
        run: time_of_flight,
    }
}

/// Sample at which a plate at `depth` mm appears.
fn shown_at((_, render): &Renderer, scene: &Scene, depth: f64) -> f64 {
    let envelope = render(scene).envelope(0);
    let k = (depth / scene.probe.sample_pitch()) as usize;
    centre(&envelope, k - 60..k + 60, 8)
}

/// Tolerance of a tenth of a sample: the split over two samples has the exact centre; the fixed point rounds it.
const TOLERANCE: f64 = 0.1;

fn time_of_flight(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    for renderer in &bench.renderers {
        for depth in [20.0, 33.333, 71.7] {
            plate_in_water(renderer, depth, physics, &mut out);
        }
        plate_behind_fat(renderer, physics, &mut out);
    }
    out
}

fn plate_in_water(renderer: &Renderer, depth: f64, physics: Physics, out: &mut Outcome) {
    let mut scene = linear(1, 1.0, silent(1.480, 1.480, 0.0));
    add_layer(&mut scene, depth, silent(1.580, 1.650, 0.0));
    if physics == Physics::Planted {
        scene.tissues[0].speed = 1.482;
    }
    let expected = 1.540 * (depth / 1.480) / scene.probe.sample_pitch();
    let measured = shown_at(renderer, &scene, depth * 1.540 / 1.480);
    let what = format!("{}: plate at {depth} mm of water, sample", renderer.0);
    out.compare(what, measured, expected, TOLERANCE);
}

fn plate_behind_fat(renderer: &Renderer, physics: Physics, out: &mut Outcome) {
    let with_fat = physics == Physics::Right;
    let tissue = silent(1.540, 1.600, 0.0);
    let first = if with_fat { silent(1.440, 1.340, 0.0) } else { tissue.clone() };
    let mut scene = linear(1, 1.0, first);
    add_layer(&mut scene, 10.0, tissue);
    add_layer(&mut scene, 40.0, silent(1.540, 1.700, 0.0));
    let expected = (40.0 + 10.0 * (1540.0 / 1440.0 - 1.0)) / scene.probe.sample_pitch();
    let what = format!("{}: plate at 40 mm behind 10 mm of fat, sample", renderer.0);
    out.compare(what, shown_at(renderer, &scene, 40.3), expected, TOLERANCE);
}
