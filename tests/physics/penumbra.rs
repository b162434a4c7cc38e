//! The edge of a shadow: as wide as the aperture that converges on what lies behind it.

use glam::{DAffine3, DVec3};
use insonify::probe::ProbeKind;
use insonify::scene::Scene;
use insonify::settings::Loss;

use crate::common::moments::mean;
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::scenes::{add_box, silent};
use crate::physics::speckle::{homogeneous, sigma_lateral};

/// Check T36.
pub fn the_edge_of_a_shadow_is_as_wide_as_the_aperture_makes_it() -> Check {
    Check {
        row: "T36",
        name: "the_edge_of_a_shadow_is_as_wide_as_the_aperture_makes_it",
        claim: "Behind the edge of what lets nothing through, at a depth z', the mean intensity at the depth z is the \
            product of the squares of the parts of the transmitting and of the receiving aperture from which straight \
            rays pass the edge, over the two-way beam: at F/2, 17 mm behind 17 mm, from 10 to 90 % over 4 mm. 15 %, of \
            which chance makes 5 %, and 16 rays and the lines that they fall on 5 %.",
        planted: "What a line meets alone: an edge as wide as the two-way beam.",
        run: edges,
    }
}

const SEEDS: u32 = 4;
/// Half the length along the beam over which lines are averaged, mm.
const HALF: f64 = 1.5;

/// A probe, the depth of the edge, and the depths behind it where the shadow's side is measured, mm.
struct Case {
    what: &'static str,
    kind: ProbeKind,
    /// Of transmission, in a focus at the last depth, and of reception.
    f_numbers: [f64; 2],
    edge: f64,
    depths: [f64; 3],
}

const CASES: [Case; 4] = [
    Case {
        what: "F/2 behind 17 mm",
        kind: ProbeKind::Linear { width: 38.4 },
        f_numbers: [2.0, 2.0],
        edge: 17.0,
        depths: [25.0, 30.0, 40.0],
    },
    Case {
        what: "F/2 behind 8 mm",
        kind: ProbeKind::Linear { width: 38.4 },
        f_numbers: [2.0, 2.0],
        edge: 8.0,
        depths: [14.0, 22.0, 36.0],
    },
    Case {
        what: "F/4 and F/3 behind 17 mm",
        kind: ProbeKind::Linear { width: 38.4 },
        f_numbers: [4.0, 3.0],
        edge: 17.0,
        depths: [28.0, 36.0, 48.0],
    },
    Case {
        what: "convex, F/2 behind 25 mm",
        kind: ProbeKind::Convex { radius: 50.0, field_of_view: 1.0 },
        f_numbers: [2.0, 2.0],
        edge: 25.0,
        depths: [38.0, 48.0, 60.0],
    },
];

/// Speckle behind a thin plate, left of x = 0, through which nothing comes.
fn behind_a_plate(case: &Case, seed: u32) -> Scene {
    let mut scene = homogeneous(256, 0.15, seed);
    scene.probe.kind = case.kind;
    scene.probe.depth = case.depths[2] + 6.0;
    scene.probe.samples = 1536;
    [scene.probe.f_number_transmit, scene.probe.f_number_receive] = case.f_numbers;
    scene.probe.focus = case.depths[2];
    let at = DAffine3::from_translation(DVec3::new(-40.0, 0.3, case.edge));
    add_box(&mut scene, [80.0, 60.0, 0.2], silent(1.540, 1e-4, 0.0), at);
    scene
}

/// Place of a scanline's point at a depth, in the image plane, and where an element `beside` mm from its start is.
fn geometry(kind: ProbeKind, across: f64, depth: f64, beside: f64) -> [[f64; 2]; 2] {
    match kind {
        ProbeKind::Convex { radius, .. } => {
            let at = |angle: f64, r: f64| [r * angle.sin(), r * angle.cos() - radius];
            let angle = across / (radius + depth);
            [at(angle, radius + depth), at(angle + beside / radius, radius)]
        }
        _ => [[across, depth], [across + beside, 0.0]],
    }
}

/// Part of an aperture of this width from which straight rays reach a point `across` mm from the middle at a depth.
fn lit(case: &Case, across: f64, depth: f64, width: f64) -> f64 {
    const RAYS: u32 = 2000;
    let passes = |i: &u32| {
        let beside = width * ((f64::from(*i) + 0.5) / f64::from(RAYS) - 0.5);
        let [target, element] = geometry(case.kind, across, depth, beside);
        let part = (case.edge - element[1]) / (target[1] - element[1]);
        element[0] + part * (target[0] - element[0]) >= 0.0
    };
    (0..RAYS).filter(passes).count() as f64 / f64::from(RAYS)
}

/// Mean intensity across the edge, as in the claim.
fn law(case: &Case, scene: &Scene, depth: f64) -> Vec<[f64; 2]> {
    let [transmit, receive] = case.f_numbers.map(|f_number| depth / f_number);
    let step = 0.05;
    let points = -240..=240;
    let bare: Vec<f64> = points
        .clone()
        .map(|i| {
            let x = step * f64::from(i);
            (lit(case, x, depth, transmit) * lit(case, x, depth, receive)).powi(2)
        })
        .collect();
    let sigma = sigma_lateral(scene, depth) / step;
    let reach = (3.0 * sigma).ceil() as i64;
    let weight = |i: i64| (-(i as f64 / sigma).powi(2)).exp();
    let norm: f64 = (-reach..=reach).map(weight).sum();
    let last = bare.len() as i64 - 1;
    points
        .map(|i| {
            let at = |j: i64| bare[(i64::from(i) + 240 + j).clamp(0, last) as usize];
            let sum: f64 = (-reach..=reach).map(|j| weight(j) * at(j)).sum();
            [step * f64::from(i), sum / norm]
        })
        .collect()
}

/// From where the curve first reaches 10 % to where it reaches 90 %.
fn rise(curve: &[[f64; 2]]) -> f64 {
    let first = |level: f64| {
        let i = (1..curve.len()).find(|&i| curve[i][1] >= level).expect("it rises");
        let [[x0, y0], [x1, y1]] = [curve[i - 1], curve[i]];
        x0 + (x1 - x0) * (level - y0) / (y1 - y0)
    };
    first(0.9) - first(0.1)
}

/// The factor on the width of a law with which it is nearest to the points.
fn stretched(points: &[[f64; 2]], law: &[[f64; 2]]) -> f64 {
    let at = |x: f64| {
        let place = ((x - law[0][0]) / 0.05).clamp(0.0, law.len() as f64 - 1.001);
        let (i, part) = (place as usize, place.fract());
        law[i][1] * (1.0 - part) + law[i + 1][1] * part
    };
    let misfit =
        |factor: f64| points.iter().map(|[x, y]| (y - at(x / factor)).powi(2)).sum::<f64>();
    let factors = (10..=200).map(|i| 0.01 * f64::from(i));
    factors.min_by(|a, b| misfit(*a).total_cmp(&misfit(*b))).expect("some")
}

fn edges(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let mut curves = Vec::new();
    for case in &CASES {
        let scenes = (0..SEEDS).map(|seed| {
            let mut scene = behind_a_plate(case, seed);
            if physics == Physics::Planted {
                scene.simulation.loss = Loss::Ray;
            }
            scene
        });
        let frames: Vec<_> = scenes.map(|scene| (render(&scene), scene)).collect();
        for depth in case.depths {
            let samples = |scene: &Scene| {
                [depth - HALF, depth + HALF].map(|z| (z / scene.probe.sample_pitch()) as usize)
            };
            let power = |l: usize| {
                let all = frames.iter().flat_map(|(frame, scene)| {
                    let [from, to] = samples(scene);
                    frame.iq[l][from..to].iter().map(|v| v[0] * v[0] + v[1] * v[1])
                });
                mean(&all.collect::<Vec<f64>>())
            };
            let probe = &frames[0].1.probe;
            let lines = probe.scanlines as usize;
            let across = |l: usize| (l as f64 + 0.5 - lines as f64 / 2.0) * probe.line_pitch(depth);
            let law = law(case, &frames[0].1, depth);
            let width = rise(&law);
            // Where all of the aperture sees the target.
            let free = |l: &usize| (width..4.0 * width + 4.0).contains(&across(*l));
            let whole = mean(&(0..lines).filter(free).map(power).collect::<Vec<f64>>());
            let near = (0..lines).filter(|l| across(*l).abs() < 1.5 * width + 0.5);
            let points: Vec<[f64; 2]> = near.map(|l| [across(l), power(l) / whole]).collect();
            let what = format!("{name}: {}, from 10 to 90 % at {depth} mm, mm", case.what);
            out.compare(what, width * stretched(&points, &law), width, 0.15 * width);
            if case.edge == 17.0 && case.f_numbers == [2.0, 2.0] {
                curves.push(Curve::line(format!("expected at {depth} mm"), law));
                curves.push(Curve::dots(format!("{depth} mm"), points));
            }
        }
    }
    let axes = ["lateral position, mm", "mean intensity"];
    out.plots.push(Plot::linear("The side of a shadow", axes, curves));
    out
}

#[test]
fn the_law_is_that_of_half_planes() {
    // F/2: at 30 mm behind 17 mm an aperture of 15 mm covers 6.5 mm there; 0.1 = f^4 at 0.0623 of that
    // beside the middle, 0.9 at 0.4740 of it.
    let case = &CASES[0];
    let scene = behind_a_plate(case, 0);
    let covered = 30.0 / 2.0 * (1.0 - 17.0 / 30.0);
    let bare = covered * (0.9_f64.powf(0.25) - 0.1_f64.powf(0.25));
    assert!((bare - 2.68).abs() < 0.01, "{bare}");
    let width = rise(&law(case, &scene, 30.0));
    assert!(width > bare && width < 1.1 * bare, "{width}");
}
