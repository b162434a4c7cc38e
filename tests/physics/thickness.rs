//! Interfaces that are not sharp: delay, coherence and energy of their echoes.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3};
use insonify::scene::Scene;
use insonify::settings::{Coherence, Sampling};
use insonify::sim::Tracer;

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::{Range, echo};
use crate::physics::scenes::{add_box, linear, silent};

/// Frequency, MHz; and speed to which the machine and, unless stated, the medium are set, mm/us.
const FREQUENCY: f64 = 7.0;
const SPEED: f64 = 1.540;
/// Sample pitch, mm, and place of the interface, samples. At this fraction the squares of the cubic's four shares sum
/// to their mean over all fractions, 0.7757: a mirror there shows the mean energy.
const PITCH: f64 = 12.5 / 256.0;
const PLACE: f64 = 80.222_782;
const SAMPLES: u32 = 128;

/// A perfect reflector of thickness `tau` mm head on, met by `lines` scanlines `pitch` mm apart in a medium of
/// `speed`.
fn wall(lines: u32, pitch: f64, speed: f64, tau: f64) -> Scene {
    let mut scene = linear(lines, pitch * f64::from(lines), silent(speed, 1.5, 0.0));
    let depth = PLACE * PITCH * speed / SPEED;
    let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, depth));
    let far = 2.2 * pitch * f64::from(lines) + 100.0;
    add_box(&mut scene, [far, far, far], silent(speed, 1.5e9, 0.0), at);
    for side in &mut scene.instances[0].surface {
        side.thickness = tau;
    }
    scene.probe.samples = SAMPLES;
    scene.probe.depth = f64::from(SAMPLES) * PITCH;
    scene.simulation.paths = 1;
    scene.imaging.tgc_attenuation = 0.0;
    scene.imaging.image_height = 16;
    scene
}

fn thicker(physics: Physics, tau: f64) -> f64 {
    match physics {
        Physics::Right => tau,
        Physics::Planted => 1.1 * tau,
    }
}

/// Check T23, in time.
pub fn thickness_delays_echoes_by_a_half_normal() -> Check {
    Check {
        row: "T23",
        name: "thickness_delays_echoes_by_a_half_normal",
        claim: "Echoes of an interface of thickness tau come from q = |N(0, tau)| behind it: the energy \
            of their incoherent part has mean tau sqrt(2 / pi) and variance tau^2 (1 - 2 / pi).",
        planted: "A thickness a tenth too large.",
        run: delays,
    }
}

/// Incoherent power per sample of many scanlines, over seeds: the rest without the scanlines' mean.
fn incoherent(range: &mut Range, scene: &Scene) -> Vec<f64> {
    let lines = range.shoot(scene).surface;
    let count = lines.len() as f64;
    (0..scene.probe.samples as usize)
        .map(|k| {
            let [re, im, power] = lines.iter().fold([0.0; 3], |[a, b, p], line| {
                let [x, y] = line[k];
                [a + x / count, b + y / count, p + (x * x + y * y) / count]
            });
            (power - re * re - im * im) * count / (count - 1.0)
        })
        .collect()
}

/// Mean and variance of a density over samples.
fn moments(power: &[f64]) -> [f64; 2] {
    let sum: f64 = power.iter().sum();
    let moment = |f: &dyn Fn(f64) -> f64| {
        let terms = power.iter().enumerate().map(|(k, p)| p * f(k as f64));
        terms.sum::<f64>() / sum
    };
    let mean = moment(&|k| k);
    [mean, moment(&|k| (k - mean).powi(2))]
}

const SEEDS: u32 = 24;

fn delays(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    // Sound slower than the machine assumes: a delay belongs to the medium in front.
    let speed = 1.480;
    for tau in [0.1, 0.3] {
        let samples = tau * SPEED / speed / PITCH;
        let expected = [
            PLACE + samples * (2.0 / PI).sqrt(),
            // Four samples share each echo: sum s_i^2 (i - f)^2 over the mean of sum s_i^2.
            samples * samples * (1.0 - 2.0 / PI) + 0.117_099,
        ];
        let mut plot = profile(tau, samples);
        for &tracer in bench.tracers {
            // Scanlines 8 mm apart: no two share a cell of the phase, nor a beam.
            let mut scene = wall(128, 8.0, speed, thicker(physics, tau));
            // Each path echoes: there are as many depths as paths.
            scene.simulation.sampling = Sampling::Plain;
            scene.simulation.paths = 512;
            let mut range = Range::new(bench, &scene, tracer);
            let powers: Vec<Vec<f64>> = (1..=SEEDS)
                .map(|seed| {
                    scene.simulation.seed = seed;
                    incoherent(&mut range, &scene)
                })
                .collect();
            let without = |left_out: Option<usize>| {
                let kept = powers.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
                kept.fold(vec![0.0; SAMPLES as usize], |mut sum: Vec<f64>, (_, p)| {
                    sum.iter_mut().zip(p).for_each(|(s, p)| *s += p);
                    sum
                })
            };
            let total = without(None);
            let measured = moments(&total);
            let left: Vec<[f64; 2]> =
                (0..powers.len()).map(|i| moments(&without(Some(i)))).collect();
            for (i, what) in ["mean place", "variance"].into_iter().enumerate() {
                // Standard error by the jackknife over seeds.
                let n = f64::from(SEEDS);
                let spread: f64 = left.iter().map(|m| (m[i] - measured[i]).powi(2)).sum();
                let error = (spread * (n - 1.0) / n).sqrt();
                let what = format!("{tracer}, tau = {tau} mm: {what}, samples");
                out.compare(what, measured[i], expected[i], 4.0 * error);
            }
            let sum: f64 = total.iter().sum();
            let points = total.iter().enumerate().map(|(k, p)| [k as f64 - PLACE, p / sum]);
            plot.curves.push(Curve {
                label: tracer.to_string(),
                points: points.skip(75).take(40).collect(),
                line: false,
            });
        }
        out.plots.push(plot);
    }
    out
}

/// The half-normal density of scale `samples`.
fn profile(tau: f64, samples: f64) -> Plot {
    let density = |x: f64| (2.0 / PI).sqrt() / samples * (-0.5 * (x / samples).powi(2)).exp();
    Plot {
        title: format!("Where a surface of {tau} mm echoes"),
        axes: ["behind the surface, samples".into(), "share of energy".into()],
        logarithmic: [false, false],
        curves: vec![Curve {
            label: "half-normal".into(),
            points: (0..160).map(|i| 0.2 * f64::from(i)).map(|x| [x, density(x)]).collect(),
            line: true,
        }],
    }
}

/// Check T23, in phase and energy.
pub fn thick_surfaces_lose_coherence_and_keep_energy() -> Check {
    Check {
        row: "T23",
        name: "thick_surfaces_lose_coherence_and_keep_energy",
        claim: "The part in phase is |E exp(4 pi i f q / c)| over the half-normal q: .80, .34, .14 at 7 MHz \
            for .02, .05, .1 mm, whether paths are summed or the part is split off. Split echoes have \
            the energy of a mirror's for every number of paths.",
        planted: "A thickness a tenth too large; paths summed where they should be split.",
        run: coherence,
    }
}

/// Coherent part |E exp(i k q)|, k = 4 pi f / c, by midpoints of 1e5 steps up to 9 tau.
fn coherent_part(tau: f64) -> f64 {
    let k = 4.0 * PI * FREQUENCY / SPEED;
    let steps = 100_000;
    let step = 9.0 * tau / f64::from(steps);
    let [re, im] = (0..steps).fold([0.0; 2], |[re, im], i| {
        let q = (f64::from(i) + 0.5) * step;
        let density = (2.0 / PI).sqrt() / tau * (-0.5 * (q / tau).powi(2)).exp() * step;
        let (sin, cos) = (k * q % TAU).sin_cos();
        [re + density * cos, im + density * sin]
    });
    re.hypot(im)
}

/// Thickness, mm, and number of seeds over which its coherence is averaged: the rest of the incoherent part has to
/// be small beside the coherent one.
const THICKNESSES: [(f64, u32); 3] = [(0.02, 2), (0.05, 8), (0.1, 24)];

fn coherence(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let mut plot = Plot {
        title: "Part of an echo in phase, 7 MHz".into(),
        axes: ["thickness, mm".into(), "coherence".into()],
        logarithmic: [false, false],
        curves: vec![Curve {
            label: "|E exp(4 pi i f q / c)|".into(),
            points: (1..=60)
                .map(|i| 0.002 * f64::from(i))
                .map(|tau| [tau, coherent_part(tau)])
                .collect(),
            line: true,
        }],
    };
    for &tracer in bench.tracers {
        for (name, measure) in [("summed", summed as fn(&Bench, _, _, _) -> f64), ("split", split)]
        {
            let measured = THICKNESSES
                .map(|(tau, seeds)| [tau, measure(bench, tracer, thicker(physics, tau), seeds)]);
            for [tau, part] in measured {
                let expected = coherent_part(tau);
                let what = format!("{tracer}, {name}, tau = {tau} mm: coherence");
                // 5 %: at least four standard errors of either.
                out.compare(what, part, expected, 0.05 * expected)
                    .unlike("one way through the thickness", coherent_part(tau / 2.0));
            }
            plot.curves.push(Curve {
                label: format!("{tracer}, {name}"),
                points: measured.to_vec(),
                line: false,
            });
        }
    }
    out.plots.push(plot);
    energies(bench, physics, &mut out);
    out
}

/// Magnitude of the sum of all paths' echoes, each in its own phase: 10 000 paths per seed, standard
/// error 0.0014 for the thickest surface.
fn summed(bench: &Bench, tracer: Tracer, tau: f64, seeds: u32) -> f64 {
    let mut scene = wall(1, 8.0, SPEED, tau);
    scene.simulation.paths = 10_000;
    scene.simulation.coherence = Coherence::Coherent;
    let mut range = Range::new(bench, &scene, tracer);
    let sum = (1..=seeds).fold([0.0; 2], |sum, seed| {
        scene.simulation.seed = seed;
        let part = echo(&scene, &range.shoot(&scene).surface[0], PLACE * PITCH / SPEED, 40);
        [sum[0] + part[0], sum[1] + part[1]]
    });
    sum[0].hypot(sum[1]) / f64::from(seeds)
}

/// Mean over 4096 scanlines per seed of the four samples about the surface: the rest of the incoherent part there,
/// of random phase, is 0.0023 for the thickest surface.
fn split(bench: &Bench, tracer: Tracer, tau: f64, seeds: u32) -> f64 {
    // A millimetre apart: other cells of the phase, and the beam hardly reaches the next scanline.
    let mut scene = wall(4096, 1.0, SPEED, tau);
    let mut range = Range::new(bench, &scene, tracer);
    let mut sum = 0.0;
    for seed in 1..=seeds {
        scene.simulation.seed = seed;
        for line in &range.shoot(&scene).surface {
            sum += echo(&scene, line, PLACE * PITCH / SPEED, 1)[0];
        }
    }
    sum / f64::from(4096 * seeds)
}

/// Energy after the axial kernel over a mirror's, 1024 scanlines: standard error 0.14 dB.
fn energies(bench: &Bench, physics: Physics, out: &mut Outcome) {
    let mut plot = Plot {
        title: "Energy of a surface of 0.1 mm".into(),
        axes: ["paths".into(), "energy over a mirror's, dB".into()],
        logarithmic: [true, false],
        curves: vec![Curve {
            label: "independent of their number".into(),
            points: vec![[8.0, 0.0], [256.0, 0.0]],
            line: true,
        }],
    };
    for &tracer in bench.tracers {
        let energy = |scene: &Scene| {
            let iq = Range::new(bench, scene, tracer).iq(scene);
            let power = iq.iter().flatten().map(|v| v[0].powi(2) + v[1].powi(2));
            power.sum::<f64>() / iq.len() as f64
        };
        let mirror = energy(&wall(16, 1.0, SPEED, 0.0));
        let mut points = vec![];
        for paths in [8, 32, 256] {
            let mut scene = wall(1024, 1.0, SPEED, 0.1);
            scene.simulation.paths = paths;
            if physics == Physics::Planted {
                scene.simulation.coherence = Coherence::Coherent;
            }
            let decibel = 10.0 * (energy(&scene) / mirror).log10();
            let what = format!("{tracer}: energy of {paths} paths over a mirror's, dB");
            out.compare(what, decibel, 0.0, 0.5);
            points.push([f64::from(paths), decibel]);
        }
        plot.curves.push(Curve { label: tracer.to_string(), points, line: false });
    }
    out.plots.push(plot);
}
