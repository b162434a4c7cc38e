//! Echoes over a detour: between the faces of a slab, and by way of a mirror.

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use insonify::settings::Sampling;
use insonify::sim::Tracer;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::{Range, centroid, echo};
use crate::physics::pictures::shown;
use crate::physics::scenes::{add_box, add_layer, add_point, linear, silent};

/// Pressure reflection coefficients of the slab's faces. The second detour passes the front face
/// with probability .25: the chain is drawn often enough to be counted.
const FACES: [f64; 2] = [0.5, 0.8];
/// Depth of the front, mm; speed in front of it, mm/us.
const FRONT: [f64; 2] = [20.0, 1.540];
/// Thickness, mm, and speed.
const SLAB: [f64; 2] = [7.3, 1.600];
/// Times 4096 paths. The rarest echo is drawn by one path in eight of the independent schemes:
/// relative standard error sqrt(7 / 40960) = 1.3 %, and 1.1 % on main-path sampling, which splits
/// 64 % of its paths off and sends a quarter of them on.
const SEEDS: u32 = 10;
const PATHS: u32 = 4096;

/// Check T18.
pub fn a_slab_reverberates_at_multiples_of_its_thickness() -> Check {
    Check {
        row: "T18",
        name: "a_slab_reverberates_at_multiples_of_its_thickness",
        claim: "Behind a slab of faces r1, r2 and thickness s, echoes lie at d2 + m s with amplitudes \
            (1 - r1^2) r2 (-r1 r2)^m: the series of a plane wave between two faces, by either tracer \
            and all three sampling schemes.",
        planted: "A back face that reflects 8 % more.",
        run: reverberation,
    }
}

fn slab(sampling: Sampling, back: f64) -> Scene {
    let z1 = 1.5 * (1.0 + FACES[0]) / (1.0 - FACES[0]);
    let z2 = z1 * (1.0 + back) / (1.0 - back);
    let mut scene = linear(1, 1.0, silent(FRONT[1], 1.5, 0.0));
    add_layer(&mut scene, FRONT[0], silent(SLAB[1], z1, 0.0));
    add_layer(&mut scene, FRONT[0] + SLAB[0], silent(1.5, z2, 0.0));
    scene.simulation.paths = PATHS;
    scene.simulation.sampling = sampling;
    scene.simulation.max_reflections = 8;
    // No compensation and more gain: the share of one path in 4096 stays large beside a unit of the
    // fixed point.
    scene.imaging.tgc_attenuation = 0.0;
    scene.simulation.surface_gain = 12.0;
    scene
}

/// One-way time of echo `m`, us.
fn time(m: i32) -> f64 {
    FRONT[0] / FRONT[1] + f64::from(m + 1) * SLAB[0] / SLAB[1]
}

/// Place of an echo of this one-way time, samples.
fn place(scene: &Scene, time: f64) -> f64 {
    scene.probe.speed * time / scene.probe.sample_pitch()
}

fn series(m: i32) -> f64 {
    let [r1, r2] = FACES;
    (1.0 - r1 * r1) * r2 * (-r1 * r2).powi(m)
}

/// Scanline of `scene` averaged over seeds, at gain 0 dB.
pub fn mean_line(bench: &Bench, scene: &Scene, tracer: Tracer) -> Vec<[f64; 2]> {
    let mut range = Range::new(bench, scene, tracer);
    let mut scene = scene.clone();
    let gain = 10f64.powf(scene.simulation.surface_gain / 20.0);
    let mut sum = vec![[0.0; 2]; scene.probe.samples as usize];
    for seed in 1..=SEEDS {
        scene.simulation.seed = seed;
        let line = &range.shoot(&scene).surface[0];
        for (sum, v) in sum.iter_mut().zip(line) {
            *sum = [0, 1].map(|i| sum[i] + v[i] / gain / f64::from(SEEDS));
        }
    }
    sum
}

fn reverberation(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let back = match physics {
        Physics::Right => FACES[1],
        Physics::Planted => 1.08 * FACES[1],
    };
    let mut plot = Plot {
        title: "Reverberations of a slab".into(),
        axes: ["m".into(), "amplitude, perfect mirror = 1".into()],
        logarithmic: [false, true],
        curves: vec![Curve {
            label: "(1 - r1^2) r2 (r1 r2)^m".into(),
            points: (0..=3).map(|m| [f64::from(m), series(m).abs()]).collect(),
            line: true,
        }],
    };
    for &tracer in bench.tracers {
        for sampling in [Sampling::MainPath, Sampling::Plain, Sampling::SharedPrimary] {
            let scene = slab(sampling, back);
            let line = mean_line(bench, &scene, tracer);
            let name = format!("{tracer}, {sampling:?}");
            let amplitude = |m| echo(&scene, &line, time(m), 6)[0];
            for m in 0..=2 {
                let kappa = place(&scene, time(m));
                let k = kappa as usize;
                let what = format!("{name}: place of echo {m}, samples");
                // Half a sample: between two samples the linear split has its exact centre.
                let found = centroid(&line, k - 20..k + 20);
                let other = (FRONT[0] + f64::from(m + 1) * SLAB[0]) / FRONT[1];
                out.compare(what, found, kappa, 0.5)
                    .unlike("speed in front of the slab also in it", place(&scene, other));
            }
            // The first echo is not drawn by chance: a thousandth is what N = 4096 stratified
            // choices and the fixed point's rounding make of it.
            out.compare(format!("{name}: first echo"), amplitude(0), series(0), 1e-3);
            for m in 1..=2 {
                let what = format!("{name}: echo {m} over echo 0");
                let expected = series(m) / series(0);
                // 5 %: about four standard errors of the rarest echo.
                out.compare(what, amplitude(m) / amplitude(0), expected, 0.05 * expected.abs());
            }
            plot.curves.push(Curve {
                label: name,
                points: (0..=3).map(|m| [f64::from(m), amplitude(m).abs()]).collect(),
                line: false,
            });
        }
    }
    out.plots.push(plot);
    out
}

/// Depth of the plate's front, mm, its thickness, mm, its speed, mm/us, and its attenuation, dB/(cm MHz).
const PLATE: [f64; 4] = [21.0, 6.0, 2.4, 0.1];

/// Check T37.
pub fn the_echoes_of_a_plate_are_on_every_line() -> Check {
    Check {
        row: "T37",
        name: "the_echoes_of_a_plate_are_on_every_line",
        claim: "The echoes between the faces of a smooth plate, each r^2 and the attenuation of the way to and fro below \
            the one before, are within 2 dB on at least 90 % of the lines of an image, the third 74 dB below a mirror, \
            with 8 paths and with 32.",
        planted: "One path to a line: the echoes are drawn, and most lines have none.",
        run: train,
    }
}

fn plate(paths: u32) -> Scene {
    let [front, thickness, speed, attenuation] = PLATE;
    let mut scene = linear(32, 12.8, silent(FRONT[1], 1.48, 0.0));
    let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, front));
    add_box(&mut scene, [300.0, 300.0, thickness], silent(speed, 2.88, attenuation), at);
    scene.probe.depth = 50.0;
    scene.simulation.paths = paths;
    scene.simulation.max_reflections = 8;
    scene.imaging.tgc_attenuation = 0.0;
    scene
}

fn train(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let [front, thickness, speed, attenuation] = PLATE;
    let r: f64 = (2.88 - 1.48) / (2.88 + 1.48);
    let mut plot = Plot {
        title: "Echoes of a plate".into(),
        axes: ["m".into(), "median over lines, dB over the back's".into()],
        logarithmic: [false, false],
        curves: vec![],
    };
    for paths in [8, 32] {
        let scene = plate(if physics == Physics::Right { paths } else { 1 });
        let pitch = scene.probe.sample_pitch();
        // Two-way, cm and MHz.
        let absorbed = attenuation * scene.probe.frequency * 2.0 * thickness / 10.0;
        let step = 40.0 * r.log10() - absorbed;
        for (name, render) in &bench.renderers {
            let image = render(&scene);
            let levels = |l: usize| {
                let envelope = image.envelope(l);
                [0, 1, 2, 3].map(|m| {
                    let depth = front + f64::from(m + 1) * thickness * FRONT[1] / speed;
                    let (at, reach) = ((depth / pitch) as usize, (1.0 / pitch) as usize);
                    let peak = envelope[at - reach..at + reach].iter().copied();
                    20.0 * peak.fold(1e-12, f64::max).log10()
                })
            };
            let lines: Vec<[f64; 4]> = (0..scene.probe.scanlines as usize).map(levels).collect();
            let mut points = Vec::new();
            for m in 1..=3 {
                let mut found: Vec<f64> = lines.iter().map(|line| line[m] - line[0]).collect();
                found.sort_by(f64::total_cmp);
                let expected = m as f64 * step;
                // The first needs no reflection after the one at the back.
                if m > 1 {
                    let amiss = found.iter().filter(|x| (**x - expected).abs() > 2.0).count();
                    let part = amiss as f64 / found.len() as f64;
                    let what = format!("{name}, {paths} paths: part of the lines without echo {m}");
                    out.compare(what, part, 0.0, 0.1);
                }
                points.push([m as f64, found[found.len() / 2]]);
            }
            plot.curves.push(Curve::dots(format!("{name}, {paths} paths"), points));
        }
        if paths == 8 {
            let points = (1..=3).map(|m| [f64::from(m), f64::from(m) * step]).collect();
            plot.curves.push(Curve::line("plane waves".to_owned(), points));
        }
    }
    out.plots.push(plot);
    out
}

/// Depth of the mirror on the middle scanline, and of the target in front of it, mm.
const MIRROR: f64 = 40.0;
const TARGET: f64 = 15.0;

/// Check T19.
pub fn a_mirror_shows_a_target_beside_the_line_below_itself() -> Check {
    Check {
        row: "T19",
        name: "a_mirror_shows_a_target_beside_the_line_below_itself",
        claim: "A plane at 45 degrees, D deep on a line, shows a point x beside it at D + x on that \
            line, as bright as a point there; without the plane there is nothing.",
        planted: "The mirror a degree off, and in the second case left in place where it should be gone.",
        run: mirror_image,
    }
}

/// `lines` over `width` mm, the target, and the mirror at `degrees` if any.
fn mirrored(lines: u32, width: f64, degrees: Option<f64>) -> Scene {
    let mut scene = linear(lines, width, silent(1.540, 1.5, 0.0));
    // Constant over the depths: the focus is tested elsewhere.
    scene.probe.f_number_transmit = 20.0;
    scene.simulation.max_reflections = 3;
    add_point(&mut scene, [TARGET, 0.0, MIRROR], 0.1);
    if let Some(degrees) = degrees {
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.0, MIRROR));
        // The front's normal, -z, turns towards the target; its middle, where triangles meet, is moved off the
        // scanline.
        let at = place
            * DAffine3::from_rotation_y(-degrees.to_radians())
            * DAffine3::from_translation(DVec3::new(1.3, 2.1, 0.0));
        add_box(&mut scene, [40.0, 40.0, 15.0], silent(1.540, 1.5e9, 0.0), at);
    }
    scene
}

fn mirror_image(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (degrees, absent) = match physics {
        Physics::Right => (45.0, None),
        Physics::Planted => (46.0, Some(45.0)),
    };
    let mut direct = mirrored(1, 1.0, None);
    direct.wires.clear();
    add_point(&mut direct, [0.0, 0.0, MIRROR + TARGET], 0.1);
    let mut plot = Plot {
        title: "Line towards the mirror".into(),
        axes: ["depth, mm".into(), "envelope, dB".into()],
        logarithmic: [false, false],
        curves: vec![],
    };
    for (name, render) in &bench.renderers {
        let pitch = direct.probe.sample_pitch();
        let around = ((MIRROR + TARGET) / pitch) as usize;
        let window = around - 40..around + 40;
        let peak = |line: &[f64]| line[window.clone()].iter().copied().fold(0.0, f64::max);
        let truth = render(&direct).envelope(0);
        let with = render(&mirrored(1, 1.0, Some(degrees))).envelope(0);
        let without = render(&mirrored(1, 1.0, absent)).envelope(0);
        let place = crate::physics::profile::centre(&with, window.clone(), 8);
        let expected = (MIRROR + TARGET) / pitch;
        out.compare(format!("{name}: place, samples"), place, expected, 1.0)
            .unlike("the straight way to the target", MIRROR.hypot(TARGET) / pitch);
        let level = 20.0 * (peak(&with) / peak(&truth)).log10();
        // Half a decibel: rounding of the fixed point and of the place between two samples.
        out.compare(format!("{name}: level, dB"), level, 0.0, 0.5);
        // 20 dB under the ghost.
        let rest = peak(&without) / peak(&with);
        out.compare(format!("{name}: what is left without"), rest, 0.0, 0.1);
        let decibel = |(k, v): (usize, &f64)| [k as f64 * pitch, 20.0 * v.max(1e-6).log10()];
        let curve =
            |line: &[f64]| line.iter().enumerate().map(decibel).skip(600).take(800).collect();
        plot.curves.push(Curve {
            label: format!("{name}, by the mirror"),
            points: curve(&with),
            line: false,
        });
        if *name == "twins" {
            plot.curves.insert(
                0,
                Curve { label: "a point there".into(), points: curve(&truth), line: true },
            );
        }
    }
    out.plots.push(plot);
    if physics == Physics::Right {
        let mut scene = mirrored(96, 48.0, Some(45.0));
        scene.imaging.image_height = 400;
        let title = "A mirror at 45 degrees: the target right of it, its image below";
        out.pictures.push(shown(bench, title, &scene));
    }
    out
}
