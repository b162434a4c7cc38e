//! Invariances: the sampling of a frame, and its place in the world.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec3};
use insonify::scene::Scene;
use insonify::settings::{Loss, Sampling};

use crate::common::moments::{decibel, mean};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::render::Frame;
use crate::physics::scenes::{add_box, add_sphere, linear, silent, tissue};
use crate::physics::speckle::{homogeneous, intensities, sigma_elevation, sigma_lateral};

/// Level of unattenuated liver, dB re a perfect mirror.
const LIVER: f64 = -45.0;

/// Check T24.
pub fn brightness_depends_on_neither_layers_nor_samples() -> Check {
    Check {
        row: "T24",
        name: "brightness_depends_on_neither_layers_nor_samples",
        claim: "Speckle has its level, 45 dB under a perfect mirror, at every depth, with one, three or seven \
            elevation layers that visit all of their slabs or only a cell's width, and with 20 to 80 samples per mm.",
        planted: "Layers that are averaged as if they saw the same scatterers: independent speckle fades.",
        run: sampling_grid,
    }
}

/// Depths, mm, of the bands in which the level is taken.
const BANDS: [[f64; 2]; 3] = [[30.0, 50.0], [50.0, 70.0], [70.0, 90.0]];

// 0.2 dB is the table's: a band's 7 400 grains make 0.05 dB.
fn sampling_grid(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let mut curves = vec![Curve::line("liver", vec![[30.0, LIVER], [90.0, LIVER]])];
    let settings = [
        (1, 0.0, 2048),
        (3, 0.0, 2048),
        (7, 0.0, 2048),
        (1, 8.0, 2048),
        (3, 8.0, 2048),
        (7, 8.0, 2048),
        (7, 8.0, 4096),
        (7, 8.0, 8192),
    ];
    for (layers, scatterers, samples) in settings {
        let mut scene = homogeneous(64, 1.0, 1);
        scene.probe.elevation_layers = layers;
        scene.probe.samples = samples;
        scene.simulation.scatterers_per_resolution_cell = scatterers;
        if physics == Physics::Planted {
            scene.simulation.speckle_gain = -decibel(f64::from(layers));
        }
        let frame = render(&scene);
        let level = |band| decibel(mean(&intensities(&frame, &scene, band, 1).concat()));
        let dots: Vec<[f64; 2]> = BANDS.map(|b| [(b[0] + b[1]) / 2.0, level(b)]).to_vec();
        let density = if scatterers > 0.0 { "thinned lattice" } else { "whole lattice" };
        let label = format!("{layers} layers, {density}, {samples} samples");
        for [z, measured] in &dots {
            out.compare(format!("{name}: {label}, at {z} mm; dB"), *measured, LIVER, 0.2)
                .unlike("one of the two components of an echo lost", LIVER - decibel(2.0));
        }
        curves.push(Curve::dots(label, dots));
    }
    out.plots.push(Plot::linear("Level of speckle", ["depth, mm", "dB re mirror"], curves));
    out
}

/// Check T24.
pub fn sampling_schemes_agree() -> Check {
    Check {
        row: "T24",
        name: "sampling_schemes_agree",
        claim: "Behind a smooth wall at 45 degrees that turns a part R of the intensity aside, speckle straight on has \
            amplitude 1 - R and the mirrored one R, whichever paths are followed: their powers add.",
        planted: "A wall that reflects a tenth more of the amplitude than is counted.",
        run: schemes,
    }
}

const SCHEMES: [(Sampling, &str); 3] = [
    (Sampling::MainPath, "main path"),
    (Sampling::Plain, "plain (S0)"),
    (Sampling::SharedPrimary, "shared primary (S1)"),
];

/// Number of paths for which R PATHS is whole, so that the right number of stratified paths is reflected.
const PATHS: u32 = 25;

/// Speckle turned aside by a wall of pressure reflection `r` that all scanlines meet above 45 mm.
fn turned_aside(r: f64) -> Scene {
    let mut scene = homogeneous(24, 1.0, 1);
    // The same scatterers however a scheme shares the power: weaker parts would get fewer.
    scene.simulation.scatterers_per_resolution_cell = 0.0;
    // Few of them: each is rounded as often as there are paths.
    scene.simulation.cell = 0.3;
    scene.simulation.paths = PATHS;
    scene.simulation.max_reflections = 1;
    let impedance = 1.630 * (1.0 + r) / (1.0 - r);
    let at = DAffine3::from_translation(DVec3::new(0.0, 0.0, 30.0))
        * DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_4)
        * DAffine3::from_translation(DVec3::new(3.1, 5.3, 0.0));
    add_box(&mut scene, [900.0, 900.0, 400.0], tissue(1.540, impedance, 0.0), at);
    scene
}

// 0.2 dB is the table's: 24 scanlines of 50 mm hold 7 000 grains, 0.05 dB. Between the schemes scatterers and paths
// are the same, and N equal paths round their N-th parts alike: off by 2.6e-4 N of the speckle, 0.7 % for 25.
fn schemes(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let r: f64 = 0.6;
    let share = r * r;
    let expected = LIVER + decibel((1.0 - share).powi(2) + share.powi(2));
    for (name, render) in &bench.renderers[1..] {
        let frames = SCHEMES.map(|(sampling, _)| {
            let mut scene = turned_aside(if physics == Physics::Planted { 1.1 * r } else { r });
            scene.simulation.sampling = sampling;
            // Independent paths know no aperture.
            scene.simulation.loss = Loss::Ray;
            let frame = render(&scene);
            (scene, frame)
        });
        for ((scene, frame), (_, scheme)) in frames.iter().zip(SCHEMES) {
            let level = decibel(mean(&intensities(frame, scene, [48.0, 98.0], 1).concat()));
            out.compare(
                format!("{name}: level behind the wall, {scheme}; dB"),
                level,
                expected,
                0.2,
            )
            .unlike("amplitudes that add up", LIVER);
        }
        for ((_, frame), (_, scheme)) in frames.iter().zip(SCHEMES).skip(1) {
            let what =
                format!("{name}: {scheme} against main path, RMS of the difference over RMS");
            out.compare(what, difference(frame, &frames[0].1), 0.0, 0.01);
        }
    }
    out
}

/// Check T24.
pub fn tissue_mirrored_by_a_rough_wall_has_the_level_of_many_paths() -> Check {
    Check {
        row: "T24",
        name: "tissue_mirrored_by_a_rough_wall_has_the_level_of_many_paths",
        claim: "A wall of roughness s spreads what it reflects by 4 / (s + 2) rad^2 per axis: at x mm the mean of many \
            Gaussian beams is sqrt(1 + 4 x^2 / ((s + 2) sigma^2)) times as wide, and its speckle that much weaker in \
            power, laterally and in elevation, however few paths are followed.",
        planted: "A wall that spreads laterally only.",
        run: mirrored,
    }
}

// 0.3 dB: chance makes 0.05 dB of 24 scanlines and 50 mm, and three times that because the part near the wall, a
// fifth of the stretch, makes most of the power. Fewer paths show the same, bit for bit except for the rounding.
fn mirrored(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let r: f64 = 0.6;
    let depths = [45.0, 98.0];
    let mut curves = Vec::new();
    for roughness in [1000.0, 100.0, 10.0] {
        let mut scene = turned_aside(r);
        // Tissue straight on would outshine it.
        scene.tissues[1].echogenicity = f64::NEG_INFINITY;
        scene.simulation.volume_floor = -200.0;
        for side in &mut scene.instances[0].surface {
            side.roughness = roughness;
        }
        let law = |z: f64| {
            let power = |l: u32| {
                // The wall: z = 30 - x.
                let behind = z - 30.0 + scene.probe.ray(l, 0).0.x;
                let wider =
                    |sigma: f64| (1.0 + 4.0 / (roughness + 2.0) * (behind / sigma).powi(2)).sqrt();
                let elevation = match physics {
                    Physics::Right => wider(sigma_elevation(&scene, z)),
                    Physics::Planted => 1.0,
                };
                r.powi(4) / (wider(sigma_lateral(&scene, z)) * elevation)
            };
            let lines = scene.probe.scanlines;
            mean(&(0..lines).map(power).collect::<Vec<_>>())
        };
        let count = 106;
        let at =
            |i: u32| depths[0] + (depths[1] - depths[0]) * (f64::from(i) + 0.5) / f64::from(count);
        let line: Vec<[f64; 2]> =
            (0..count).map(|i| [at(i), LIVER + decibel(law(at(i)))]).collect();
        let expected = LIVER + decibel(mean(&(0..count).map(|i| law(at(i))).collect::<Vec<_>>()));
        curves.push(Curve::line(format!("law, s = {roughness}"), line));
        for paths in [1, 8, 32] {
            scene.simulation.paths = paths;
            let frame = render(&scene);
            let level = |band| decibel(mean(&intensities(&frame, &scene, band, 1).concat()));
            let what =
                format!("{name}: level by a wall of roughness {roughness}, {paths} paths; dB");
            out.compare(what, level(depths), expected, 0.3);
            if paths == 8 {
                let bands = (0..13).map(|i| depths[0] + 4.0 * f64::from(i));
                let dots = bands.map(|z| [z + 2.0, level([z, z + 4.0])]).collect();
                curves.push(Curve::dots(format!("measured, s = {roughness}"), dots));
            }
        }
    }
    let axes = ["depth, mm", "dB re mirror"];
    out.plots.push(Plot::linear("Speckle mirrored by a rough wall", axes, curves));
    out
}

/// RMS of the complex difference of two frames over the RMS of the second.
fn difference(a: &Frame, b: &Frame) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for (x, y) in a.iq.iter().flatten().zip(b.iq.iter().flatten()) {
        off += (x[0] - y[0]).powi(2) + (x[1] - y[1]).powi(2);
        all += y[0] * y[0] + y[1] * y[1];
    }
    (off / all).sqrt()
}

/// Check T24.
pub fn a_frame_moves_with_its_scene() -> Check {
    Check {
        row: "T24",
        name: "a_frame_moves_with_its_scene",
        claim: "Anatomy and probe moved together by a rigid transform show the same radio-frequency lines, but for the \
            rounding of their places.",
        planted: "A probe that is moved a micrometre further.",
        run: moved,
    }
}

/// A ball in tissue, all of it anatomy, moved by `m` with the probe.
fn organ(m: DAffine3) -> Scene {
    let mut scene = linear(8, 6.0, silent(1.540, 1.630, 0.0));
    scene.probe.depth = 40.0;
    scene.probe.samples = 1024;
    scene.world_from_probe = m;
    let around = m * DAffine3::from_translation(DVec3::new(3.1, 5.3, -7.0));
    add_box(&mut scene, [80.0, 80.0, 80.0], tissue(1.540, 1.630, 0.5), around);
    add_sphere(&mut scene, 5.0, tissue(1.580, 1.720, 0.3), DVec3::new(0.4, 0.3, 20.0));
    // A draw in which no scatterer lies on the ball to the rounding of 200 mm: such a one may count to either side or
    // to none, and one scatterer is more than all other rounding.
    scene.simulation.seed = 3;
    let ball = &mut scene.instances[1];
    ball.world_from_object = m * ball.world_from_object;
    scene
}

// The table's 1e-4 is out of reach of single precision: two placements of three products and a shift each are eight
// roundings of at most 2^-24 |P|, 1.6 of that together, and the carrier turns by 4 pi f / c = 57 rad/mm: 1.5e-4 for
// |P| = 40 mm, in the twins too, as they read the same placements. Allowed is twice as much.
fn moved(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let quarter = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
    for (name, render) in &bench.renderers {
        let still = render(&organ(DAffine3::IDENTITY));
        for (what, rotation, shift) in [
            ("a quarter turn", quarter, DVec3::ZERO),
            ("a turn and 20 mm", turn, DVec3::new(13.7, -8.1, 11.3)),
            ("a turn and 200 mm", turn, DVec3::new(137.0, -81.0, 113.0)),
        ] {
            let m = DAffine3::from_rotation_translation(rotation, shift);
            let mut scene = organ(m);
            if physics == Physics::Planted {
                let micrometre = DAffine3::from_translation(1e-3 * DVec3::Z);
                scene.world_from_probe = m * micrometre;
            }
            let reach = shift.length() + scene.probe.depth;
            let tolerance = 2.0 * 1.6 * 4.0 * PI * 7.0 / 1.540 * reach * 2f64.powi(-24);
            let what = format!("{name}: after {what}, RMS of the difference over RMS");
            out.compare(what, difference(&render(&scene), &still), 0.0, tolerance);
        }
    }
    out
}
