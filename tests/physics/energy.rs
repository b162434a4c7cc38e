//! The final places of the energy of paths.

use std::f64::consts::LN_10;

use insonify::scene::Scene;
use insonify::settings::Sampling;
use insonify_tools::reference::Segment;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::Range;
use crate::physics::render::Inputs;
use crate::physics::scenes::{add_layer, add_point, linear, silent};

/// Speed mm/us, impedance MRayl, attenuation dB/(cm MHz), thickness mm of each layer. The last one
/// lets nothing out; the interface before it reflects less than a hundredth.
const LAYERS: [[f64; 4]; 4] = [
    [1.540, 1.5, 0.5, 10.0],
    [1.600, 4.5, 1.0, 3.0],
    [1.500, 12.0, 0.7, 8.0],
    [1.520, 14.0, 60.0, 100.0],
];
const FREQUENCY: f64 = 7.0;

/// Check T25.
pub fn the_energy_of_paths_is_absorbed_or_leaves() -> Check {
    Check {
        row: "T25",
        name: "the_energy_of_paths_is_absorbed_or_leaves",
        claim: "What the paths of a line lose in each layer and carry back to the probe is what intensities \
            do between parallel interfaces, R back and 1 - R through, and sums to 1: for all sampling \
            schemes, in the twins and by either tracer.",
        planted: "Reflected paths that are drawn with probability R and weighed with R once more.",
        run: audit,
    }
}

fn reflectance(i: usize) -> f64 {
    let (z1, z2) = (LAYERS[i][1], LAYERS[i + 1][1]);
    ((z2 - z1) / (z2 + z1)).powi(2)
}

/// Intensity absorption, 1/mm: 10^(-alpha f d_cm / 10).
fn absorption(i: usize) -> f64 {
    LAYERS[i][2] * FREQUENCY / 100.0 * LN_10
}

/// Share of the energy absorbed in each layer, and the share that returns to the probe: fluxes down into the top
/// of each layer and up into its bottom, iterated to convergence.
fn fates() -> [f64; 5] {
    let through = |i: usize| (-absorption(i) * LAYERS[i][3]).exp();
    let (mut down, mut up) = ([1.0, 0.0, 0.0, 0.0], [0.0; 4]);
    for _ in 0..1000 {
        for i in 0..3 {
            let r = reflectance(i);
            let (from_above, from_below) = (down[i] * through(i), up[i + 1] * through(i + 1));
            down[i + 1] = (1.0 - r) * from_above + r * from_below;
            up[i] = r * from_above + (1.0 - r) * from_below;
        }
    }
    let lost = |i: usize| (down[i] + up[i]) * (1.0 - through(i));
    [lost(0), lost(1), lost(2), lost(3), up[0] * through(0)]
}

const FATES: [&str; 5] = [
    "absorbed in layer 0",
    "absorbed in layer 1",
    "absorbed in layer 2",
    "absorbed in layer 3",
    "back at the probe",
];

fn layers(sampling: Sampling) -> Scene {
    let tissue = |i: usize| silent(LAYERS[i][0], LAYERS[i][1], LAYERS[i][2]);
    let mut scene = linear(1, 1.0, tissue(0));
    let mut top = 0.0;
    for i in 1..4 {
        top += LAYERS[i - 1][3];
        add_layer(&mut scene, top, tissue(i));
    }
    // A point out of sight: paths leave their segments, and nothing scatters.
    add_point(&mut scene, [0.0, 500.0, 10.0], 1.0);
    scene.probe.samples = 256;
    scene.simulation.sampling = sampling;
    // A branch's segments carry the root of what was drawn, as speckle adds in power: of so many paths enough take either
    // way for next to nothing to be drawn.
    scene.simulation.paths = if sampling == Sampling::MainPath { 1024 } else { 64 };
    // Nothing ends early except beyond counting, and no branch is followed by chance.
    scene.simulation.branch_floor = f64::NEG_INFINITY;
    scene.simulation.max_interactions = 60;
    scene.simulation.max_reflections = 40;
    scene.simulation.min_weight = 1e-9;
    scene.simulation.volume_floor = -300.0;
    scene
}

/// Fates of one frame's segments: of paths on their way away from the probe, and on their way back.
fn account(segments: &[Segment]) -> [[f64; 5]; 2] {
    let mut ways = [[0.0; 5]; 2];
    for s in segments {
        let back = s.direction.z < 0.0;
        let fates = &mut ways[usize::from(back)];
        let layer = s.tissue as usize;
        let left = s.weight * (-absorption(layer) * s.length).exp();
        fates[layer] += s.weight - left;
        let end = s.origin.z + s.direction.z * s.length;
        if back && end.abs() < 1e-3 {
            fates[4] += left;
        }
    }
    ways
}

const SEEDS: u32 = 100;

/// Adds mean fates over seeds, each with its standard error.
fn compare(name: &str, frames: &[[f64; 5]], out: &mut Outcome) -> [f64; 5] {
    let n = frames.len() as f64;
    let statistics = |of: &dyn Fn(&[f64; 5]) -> f64| {
        let mean = frames.iter().map(of).sum::<f64>() / n;
        let variance = frames.iter().map(|f| (of(f) - mean).powi(2)).sum::<f64>() / (n - 1.0);
        [mean, (variance / n).sqrt()]
    };
    // And 1e-4: segments are f32, a length's rounding is 1e-5 of it.
    let tolerance = |error: f64| 4.0 * error + 1e-4;
    let expected = fates();
    for i in 0..5 {
        let [mean, error] = statistics(&|f| f[i]);
        let what = format!("{name}: {}", FATES[i]);
        out.compare(what, mean, expected[i], tolerance(error))
            .unlike("the share of the next one", expected[(i + 1) % 5]);
    }
    let [mean, error] = statistics(&|f| f.iter().sum());
    out.compare(format!("{name}: all"), mean, 1.0, tolerance(error));
    std::array::from_fn(|i| statistics(&|f| f[i])[0])
}

fn audit(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut plot = Plot {
        title: "Where energy ends up".into(),
        axes: ["absorbed in layer 0 to 3, back at the probe (4)".into(), "share".into()],
        logarithmic: [false, true],
        curves: vec![Curve {
            label: "fluxes between interfaces".into(),
            points: (0..5).map(|i| [i as f64, fates()[i]]).collect(),
            line: true,
        }],
    };
    for sampling in [Sampling::MainPath, Sampling::Plain, Sampling::SharedPrimary] {
        let mut scene = layers(sampling);
        // One of a main path's branches stands for all: this one's reflectance counts twice.
        let planted = match physics {
            Physics::Right => 1.0,
            Physics::Planted => reflectance(0),
        };
        let mut seeds = |by: &str, frame: &mut dyn FnMut(&Scene) -> Vec<Segment>| {
            let ways = bench.memo.once(&(by, sampling), true, || {
                let ways = (1..=SEEDS).map(|seed| {
                    scene.simulation.seed = seed;
                    account(&frame(&scene))
                });
                ways.collect::<Vec<_>>()
            });
            let all = ways
                .iter()
                .map(|[away, back]| std::array::from_fn(|i| away[i] + planted * back[i]));
            all.collect::<Vec<[f64; 5]>>()
        };
        let mut results = vec![(
            "twins".to_owned(),
            seeds("twins", &mut |scene| Inputs::new(scene).traced().segments.concat()),
        )];
        for &tracer in bench.tracers {
            let mut range = Range::new(bench, &layers(sampling), tracer);
            let name = tracer.to_string();
            let frames = seeds(&name, &mut |scene| range.shoot(scene).segments.concat());
            results.push((name, frames));
        }
        for (name, frames) in results {
            let name = format!("{name}, {sampling:?}");
            let means = compare(&name, &frames, &mut out);
            plot.curves.push(Curve {
                label: name,
                points: (0..5).map(|i| [i as f64, means[i]]).collect(),
                line: false,
            });
        }
    }
    out.plots.push(plot);
    out
}
