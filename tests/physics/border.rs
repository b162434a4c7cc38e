//! The side of a body along the beam: as wide as the beam is.

use std::f64::consts::FRAC_2_SQRT_PI;

use glam::{DAffine3, DVec3};
use insonify::probe::ProbeKind;
use insonify::scene::{Keyframes, Scene, shapes};

use crate::common::moments::{mean, signal_to_noise};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::scenes::{add_body, add_box, silent};
use crate::physics::speckle::{homogeneous, intensities, sigma_lateral};

/// Check T14.
pub fn a_border_along_the_beam_is_as_wide_as_the_beam() -> Check {
    Check {
        row: "T14",
        name: "a_border_along_the_beam_is_as_wide_as_the_beam",
        claim: "Across the side of an anechoic body, along the beam, mean intensity falls as the part of a Gaussian \
            beam that lies outside: 1/2 erfc(x / sigma), from 90 to 10 % over 1.81 sigma, 0.77 of the full width at \
            half of the intensity's lateral autocovariance, 2.355 sigma: lines side by side, in a fan, in a sector, and \
            where tissue has been deformed. 20 %, of which chance makes 5 %.",
        planted: "Lines that take the tissue from their axes alone: a border one scanline sharp.",
        run: borders,
    }
}

/// From 90 to 10 % of erfc(x) / 2.
const FALL: f64 = 1.812;

/// A probe, the depths between which lines are averaged, mm, inside the body, and the number of images.
struct Case {
    what: &'static str,
    kind: ProbeKind,
    lines: u32,
    f_number: f64,
    depths: [f64; 2],
    /// True if the tissue beside the body is that of a mesh that has been deformed.
    deformed: bool,
    seeds: u32,
}

const LINEAR: Case = Case {
    what: "lines 0.1 mm apart, F/2",
    kind: ProbeKind::Linear { width: 8.0 },
    lines: 80,
    f_number: 2.0,
    depths: [32.0, 88.0],
    deformed: false,
    seeds: 6,
};

const CASES: [Case; 6] = [
    LINEAR,
    Case { what: "lines 0.25 mm apart, F/2", lines: 32, ..LINEAR },
    Case { what: "lines 0.25 mm apart, F/4", lines: 32, f_number: 4.0, ..LINEAR },
    Case { what: "deformed tissue, F/2", deformed: true, ..LINEAR },
    Case {
        what: "convex, F/2",
        kind: ProbeKind::Convex { radius: 50.0, field_of_view: 0.1 },
        lines: 64,
        depths: [50.0, 70.0],
        seeds: 12,
        ..LINEAR
    },
    Case {
        what: "phased, F/2",
        kind: ProbeKind::Phased { field_of_view: 0.2 },
        lines: 80,
        depths: [50.0, 70.0],
        seeds: 12,
        ..LINEAR
    },
];

/// Speckle beside a silent body that begins at x = 0 and has the same impedance and speed: no surface echoes, nothing
/// refracts.
fn beside_a_body(case: &Case, seed: u32) -> Scene {
    let mut scene = homogeneous(case.lines, 0.1, seed);
    scene.probe.kind = case.kind;
    scene.probe.f_number_receive = case.f_number;
    let quiet = silent(1.540, 1.630, 0.0);
    if !case.deformed {
        let at = DAffine3::from_translation(DVec3::new(25.0, 5.3, 25.0));
        add_box(&mut scene, [50.0, 50.0, 70.0], quiet, at);
        return scene;
    }
    // The body is what lies around the tissue, whose side at x = 0 stays there.
    let tissue = std::mem::replace(&mut scene.tissues[0], quiet);
    let at = DAffine3::from_translation(DVec3::new(-25.0, 5.3, 60.0));
    let rest = shapes::cuboid([50.0, 50.0, 70.0]);
    let mut bent = rest.clone();
    for [x, y, z] in &mut bent.positions {
        (*x, *y, *z) = (25.0 + 1.15 * (*x - 25.0), 0.95 * *y + 0.1 * *z, 0.9 * *z);
    }
    add_body(&mut scene, rest, tissue, at);
    scene.meshes.push(bent.into());
    scene.instances[0].mesh = 1;
    scene.instances[0].keyframes = Keyframes {
        meshes: vec![0, 1],
        blend: [(1, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
        ..Keyframes::default()
    };
    scene
}

/// erfc(x) / 2: by Simpson's rule of its derivative.
fn outside(x: f64) -> f64 {
    const STEPS: u32 = 200;
    let end = x.clamp(-4.0, 4.0);
    let step = end / f64::from(STEPS);
    let term = |i: u32| {
        let factor =
            [1.0, 4.0, 2.0][if i == 0 || i == STEPS { 0 } else { 1 + (i as usize + 1) % 2 }];
        factor * (-(f64::from(i) * step).powi(2)).exp()
    };
    let erf = FRAC_2_SQRT_PI * (0..=STEPS).map(term).sum::<f64>() * step / 3.0;
    (1.0 - erf) / 2.0
}

/// Deviation of the beam whose fall, wherever it lies, is nearest to the points (place, share of the power).
fn fitted(points: &[[f64; 2]]) -> f64 {
    let misfit = |sigma: f64, at: f64| {
        points.iter().map(|[x, power]| (power - outside((x - at) / sigma)).powi(2)).sum::<f64>()
    };
    let best = |sigma: f64| {
        (-20..=20).map(|i| misfit(sigma, 0.02 * f64::from(i))).fold(f64::INFINITY, f64::min)
    };
    let sigmas = (1..=120).map(|i| 0.01 * f64::from(i));
    sigmas.min_by(|a, b| best(*a).total_cmp(&best(*b))).expect("some")
}

fn borders(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let mut curves = Vec::new();
    for case in &CASES {
        let middle = f64::midpoint(case.depths[0], case.depths[1]);
        let scene = beside_a_body(case, 0);
        let pitch = scene.probe.line_pitch(middle);
        let across = |l: u32| (f64::from(l) + 0.5 - f64::from(case.lines) / 2.0) * pitch;
        let mut lines: Vec<[f64; 2]> = (0..case.lines).map(|l| [across(l), 0.0]).collect();
        let mut tissue = Vec::new();
        for seed in 0..case.seeds {
            let frame = render(&beside_a_body(case, seed));
            for (line, powers) in lines.iter_mut().zip(intensities(&frame, &scene, case.depths, 1))
            {
                line[1] += mean(&powers) / f64::from(case.seeds);
                if (-4.0..-1.5).contains(&line[0]) {
                    tissue.extend(powers);
                }
            }
        }
        let whole = mean(&tissue);
        let points: Vec<[f64; 2]> = lines.iter().map(|[x, power]| [*x, power / whole]).collect();
        let mut near: Vec<[f64; 2]> =
            points.iter().copied().filter(|[x, _]| x.abs() < 2.0).collect();
        if physics == Physics::Planted {
            near.iter_mut().for_each(|point| point[1] = f64::from(point[0] < 0.0));
        }
        let sigma = sigma_lateral(&scene, middle);
        let what = format!("{name}: from 90 to 10 %, {}; mm", case.what);
        out.compare(what, FALL * fitted(&near), FALL * sigma, 0.2 * FALL * sigma);
        let what = format!("{name}: mean / deviation beside it, {}", case.what);
        let envelopes: Vec<f64> = tissue.iter().map(|i| i.sqrt()).collect();
        out.compare(what, signal_to_noise(&envelopes), 1.913, 0.05)
            .unlike("that of intensities", 1.0);
        curves.push(Curve::line(
            format!("1/2 erfc(x / sigma), {}", case.what),
            (-40..=40).map(|i| 0.05 * f64::from(i)).map(|x| [x, outside(x / sigma)]).collect(),
        ));
        curves.push(Curve::dots(case.what.to_owned(), near));
    }
    let axes = ["lateral position, mm", "mean intensity"];
    out.plots.push(Plot::linear("The side of an anechoic body", axes, curves));
    out
}

#[test]
fn the_fall_is_that_of_tables() {
    // Abramowitz and Stegun, table 7.1: erf(0.9) = 0.7969082, erf(0.5) = 0.5204999.
    for (x, erf) in [(0.9, 0.796_908_2), (0.5, 0.520_499_9), (-0.5, -0.520_499_9), (0.0, 0.0)] {
        assert!((outside(x) - (1.0 - erf) / 2.0).abs() < 1e-6, "{x}: {}", outside(x));
    }
    assert!((outside(FALL / 2.0) - 0.1).abs() < 1e-4);
}
