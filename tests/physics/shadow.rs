//! Brightness behind structures: enhancement under fluid, shadow under bone.

use glam::{DAffine3, DVec3};
use insonify::settings::Loss;

use crate::common::moments::{decibel, mean};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::contrast::region;
use crate::physics::pictures;
use crate::physics::scenes::{add_box, add_sphere, silent};
use crate::physics::speckle::homogeneous;

/// Share of intensity that a wall between two impedances reflects at normal incidence, or at any with equal
/// speeds.
fn reflected(z1: f64, z2: f64) -> f64 {
    ((z2 - z1) / (z2 + z1)).powi(2)
}

/// Check T16.
pub fn fluid_enhances_what_lies_behind_it() -> Check {
    Check {
        row: "T16",
        name: "fluid_enhances_what_lies_behind_it",
        claim: "Behind a fluid of thickness d, tissue is brighter by 2 (alpha_t - alpha_c) f d, 7 dB for 1 cm at \
            7 MHz, less what its two walls turn back, 20 log10((1 - R)^2). Along a chord of a cyst d is the chord.",
        planted: "One-way amplitude: half the loss, in the tissue and in the cyst.",
        run: |bench, physics| {
            let mut out = enhancement(bench, physics);
            if physics == Physics::Right {
                out.pictures.push(pictures::cyst(bench));
            }
            out
        },
    }
}

const TISSUE: f64 = 0.5;
const FLUID: f64 = 0.005;
const FREQUENCY: f64 = 7.0;
const RADIUS: f64 = 5.0;
const CENTRE: f64 = 40.0;
const LINES: u32 = 36;

// 0.5 dB is the table's: behind the middle and beside lie 1 200 and 5 000 grains, 0.14 dB on the difference. Each
// scanline has the same scatterers as in the same scene without the cyst, so that chance drops out: 0.02 dB is the
// rounding of the sums, and a sphere of flat faces 2 um inside a round one. Lines are so far apart that none hears
// what is weakened on the way to its neighbours.
fn enhancement(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let [outside, inside] = [1.630, 1.530];
    let expected = |x: f64| {
        if x.abs() >= RADIUS {
            return 0.0;
        }
        let chord = 2.0 * (RADIUS * RADIUS - x * x).sqrt() / 10.0;
        let walls = decibel((1.0 - reflected(outside, inside)).powi(4));
        2.0 * (TISSUE - FLUID) * FREQUENCY * chord + walls
    };
    let loss = if physics == Physics::Planted { 0.5 } else { 1.0 };
    let behind = [CENTRE + RADIUS + 1.0, CENTRE + RADIUS + 31.0];
    let mut plain = homogeneous(LINES, 0.7, 1);
    plain.imaging.tgc_attenuation = TISSUE;
    plain.tissues[0].attenuation = TISSUE * loss;
    // Along each line alone; apertures mix what lies behind the sphere with what lies beside it.
    plain.simulation.loss = Loss::Ray;
    let mut scene = plain.clone();
    let fluid = silent(1.540, inside, FLUID * loss);
    add_sphere(&mut scene, RADIUS, fluid, DVec3::new(0.0, 0.0, CENTRE));
    let mut curves = vec![Curve::line(
        "2 (alpha_t - alpha_c) f d",
        (-60..=60).map(|i| f64::from(i) / 10.0).map(|x| [x, expected(x)]).collect(),
    )];
    for (name, render) in &bench.renderers[1..] {
        let [with, without] = [&scene, &plain].map(render);
        let power = |lines: [f64; 2]| mean(&region(&with, &scene, lines, behind));
        let beside = (power([-12.0, -6.0]) + power([6.0, 12.0])) / 2.0;
        let middle: Vec<f64> =
            (0..LINES).map(|l| scene.probe.ray(l, 0).0.x).filter(|x| x.abs() < 2.0).collect();
        let factors: Vec<f64> = middle.iter().map(|&x| 10f64.powf(expected(x) / 10.0)).collect();
        let what = format!("{name}: enhancement behind 1 cm of fluid, dB");
        out.compare(what, decibel(power([-2.0, 2.0]) / beside), decibel(mean(&factors)), 0.5);
        let mut dots = Vec::new();
        let mut worst: f64 = 0.0;
        for l in 0..LINES {
            let x = scene.probe.ray(l, 0).0.x;
            let line = [x - 0.01, x + 0.01];
            let [a, b] = [(&with, &scene), (&without, &plain)]
                .map(|(f, s)| mean(&region(f, s, line, behind)));
            dots.push([x, decibel(a / b)]);
            // At the rim the chord grows without bound: a faceted sphere is inside by 2 um.
            if (x.abs() - RADIUS).abs() > 0.1 {
                worst = worst.max((decibel(a / b) - expected(x)).abs());
            }
        }
        let what = format!("{name}: worst line against the same scatterers without the cyst, dB");
        out.compare(what, worst, 0.0, 0.02);
        curves.push(Curve::dots(*name, dots));
    }
    let axes = ["lateral position, mm", "enhancement, dB"];
    out.plots.push(Plot::linear("Behind a fluid sphere of 10 mm", axes, curves));
    out
}

/// Check T17.
pub fn bone_casts_a_shadow() -> Check {
    Check {
        row: "T17",
        name: "bone_casts_a_shadow",
        claim: "Behind a slab of bone of thickness d, without reflections, tissue is darker by 20 log10((1 - R)^2) \
            - 2 alpha f d: 30.2 dB for 3 mm, R = 0.412, 5 dB/(cm MHz) at 7 MHz.",
        planted: "Both walls' transmission counted one way.",
        run: |bench, physics| {
            let mut out = bone_shadow(bench, physics);
            if physics == Physics::Right {
                out.pictures.extend(pictures::bone(bench));
            }
            out
        },
    }
}

// 0.7 dB is the table's: 4 500 grains on either side make 0.1 dB.
fn bone_shadow(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let [soft, hard] = [1.700, 7.800];
    let r = reflected(soft, hard);
    assert!((r - 0.412).abs() < 1e-3);
    let walls = decibel((1.0 - r).powi(if physics == Physics::Planted { 2 } else { 4 }));
    let law = |d: f64| [d, walls - 2.0 * 5.0 * 7.0 * d / 10.0];
    let mut curves =
        vec![Curve::line("20 log10((1 - R)^2) - 2 alpha f d", vec![law(0.0), law(4.0)])];
    for (name, render) in &bench.renderers[1..] {
        let mut dots = Vec::new();
        for thickness in [1.0, 3.0] {
            let mut scene = homogeneous(64, 1.0, 1);
            // The penumbra is another check's.
            scene.simulation.loss = Loss::Ray;
            scene.tissues[0].density = soft / scene.tissues[0].speed;
            let at = DAffine3::from_translation(DVec3::new(25.0, 5.3, 30.0));
            add_box(&mut scene, [50.0, 50.0, thickness], silent(3.515, hard, 5.0), at);
            let frame = render(&scene);
            let depths = [40.0, 90.0];
            let [behind, beside] =
                [[1.0, 31.0], [-31.0, -1.0]].map(|l| mean(&region(&frame, &scene, l, depths)));
            let measured = decibel(behind / beside);
            out.compare(
                format!("{name}: shadow of {thickness} mm of bone, dB"),
                measured,
                law(thickness)[1],
                0.7,
            );
            dots.push([thickness, measured]);
        }
        curves.push(Curve::dots(*name, dots));
    }
    let axes = ["thickness of bone, mm", "level behind it, dB"];
    out.plots.push(Plot::linear("Shadow", axes, curves));
    out
}
