//! The lobe of rough surfaces: sampled normals and echoes against quadratures of its density.

use std::f64::consts::FRAC_1_SQRT_2;

use insonify::scene::Scene;
use insonify::settings::Sampling;
use insonify_tools::reference::acoustics::power_cosine;
use insonify_tools::reference::random::{PURPOSE_NORMAL, path_random, unit};

use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::paths::{Range, echo};
use crate::physics::scenes::{add_layer, add_point, linear, silent};

const PATHS: u32 = 16384;
/// Roughness exponents and, with each, the exponent of the echo's lobe.
const LOBES: [[f64; 2]; 4] = [[1.0, 1.0], [10.0, 1.0], [100.0, 3.0], [1000.0, 20.0]];
const DEPTH: f64 = 20.0;
/// Attempts at a normal whose reflection leaves the surface, after which there is no echo.
const ATTEMPTS: i32 = 8;

/// Check T22.
pub fn rough_surfaces_have_the_power_cosine_lobe() -> Check {
    Check {
        row: "T22",
        name: "rough_surfaces_have_the_power_cosine_lobe",
        claim: "Micro-normals have density (s + 1) / (2 pi) cos^s: E cos = (s + 1) / (s + 2), and \
            E max(0, cos 2t)^n by quadrature. At a surface, normals that would mirror a ray into it are \
            drawn again, eight times at most: the same lobe cut at 45 degrees.",
        planted: "A roughness exponent a tenth too high.",
        run: lobe,
    }
}

/// Integral over the lobe from cosine `least` to 1 of `f` of the cosine: midpoints of 1e5 steps.
fn integral(s: f64, least: f64, f: impl Fn(f64) -> f64) -> f64 {
    let steps = 100_000;
    let step = (1.0 - least) / f64::from(steps);
    let at = |i| least + (f64::from(i) + 0.5) * step;
    (0..steps).map(at).map(|c| (s + 1.0) * c.powf(s) * f(c) * step).sum()
}

/// Echo of a plane met head on.
fn facing(cos: f64, n: f64) -> f64 {
    (2.0 * cos * cos - 1.0).max(0.0).powf(n)
}

/// Mean of `samples`, and its standard error.
fn mean(samples: &[f64]) -> [f64; 2] {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [mean, (variance / n).sqrt()]
}

/// A perfect reflector head on, of roughness `s` and echo exponent `n`; independent paths.
fn wall(s: f64, n: f64) -> Scene {
    let mut scene = linear(1, 1.0, silent(1.540, 1.5, 0.0));
    // The same speed behind: the reflection coefficient does not depend on the angle.
    add_layer(&mut scene, DEPTH, silent(1.540, 1.5e9, 0.0));
    for side in &mut scene.instances[0].surface {
        side.roughness = s;
        side.specularity = n;
    }
    // A point out of sight: paths leave their segments, and nothing scatters.
    add_point(&mut scene, [0.0, 500.0, 10.0], 1.0);
    scene.probe.samples = 1024;
    scene.simulation.sampling = Sampling::Plain;
    scene.simulation.paths = PATHS;
    scene.simulation.max_reflections = 1;
    scene.simulation.max_interactions = 2;
    scene.imaging.tgc_attenuation = 0.0;
    scene
}

fn lobe(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let truth = |s: f64| match physics {
        Physics::Right => s,
        Physics::Planted => 1.1 * s,
    };
    for [s, n] in LOBES {
        sampler(truth(s), [s, n], &mut out);
    }
    for [s, n] in LOBES {
        let mut plot = Plot {
            title: format!("Sampled normals, s = {s}"),
            axes: ["tilt, degrees".into(), "density per degree".into()],
            logarithmic: [false, false],
            curves: vec![density(s)],
        };
        for &tracer in bench.tracers {
            let scene = wall(truth(s), n);
            let shot = Range::new(bench, &scene, tracer).shoot(&scene);
            let up = shot.segments[0].iter().filter(|g| g.direction.z < 0.0);
            let directions: Vec<_> = up.map(|g| g.direction).collect();
            let name = format!("{tracer}, s = {s}");
            // Mirrored at a normal of tilt t the path leaves at 2 t.
            let cosines: Vec<f64> = directions.iter().map(|d| ((1.0 - d.z) / 2.0).sqrt()).collect();
            let kept = |s| integral(s, FRAC_1_SQRT_2, |_| 1.0);
            let tilt = |s| integral(s, FRAC_1_SQRT_2, |c| c) / kept(s);
            let [measured, error] = mean(&cosines);
            let what = format!("{name}: E cos of reflected paths");
            out.compare(what, measured, tilt(s), 4.0 * error)
                .unlike("twice the exponent", tilt(2.0 * s));
            for (axis, of) in [("x", 0), ("y", 1)] {
                let along: Vec<f64> = directions.iter().map(|d| d[of]).collect();
                let [measured, error] = mean(&along);
                let what = format!("{name}: mean direction along {axis}");
                let half = along.iter().map(|v| v.abs()).sum::<f64>() / along.len() as f64;
                out.compare(what, measured, 0.0, 4.0 * error)
                    .unlike("azimuths of half a turn", half);
            }
            // All attempts fail for a share (1 - kept)^8: no echo from these.
            let moment = |s: f64, k: f64| {
                let lit = 1.0 - (1.0 - kept(s)).powi(ATTEMPTS);
                lit * integral(s, FRAC_1_SQRT_2, |c| facing(c, k * n)) / kept(s)
            };
            let expected = moment(s, 1.0);
            let error = ((moment(s, 2.0) - expected.powi(2)) / f64::from(PATHS)).sqrt();
            let [measured, _] = echo(&scene, &shot.surface[0], DEPTH / 1.540, 2);
            // The rounding to the fixed point of shares of 1 / N: half a unit of 64.
            let tolerance = 4.0 * error + 0.5 / 64.0 * expected;
            let what = format!("{name}: mean echo, n = {n}");
            out.compare(what, measured, expected, tolerance)
                .unlike("twice the exponent", moment(2.0 * s, 1.0));
            plot.curves.push(histogram(&tracer.to_string(), &cosines));
        }
        out.plots.push(plot);
    }
    out
}

/// The twins' sampler alone, without a surface: the whole lobe.
fn sampler(sampled: f64, [s, n]: [f64; 2], out: &mut Outcome) {
    let normal = glam::DVec3::new(0.6, 0.0, -0.8);
    let cosines: Vec<f64> = (0..PATHS)
        .map(|path| path_random(path, 1, PURPOSE_NORMAL, 1))
        .map(|bits| power_cosine(normal, sampled, [unit(bits[0]), unit(bits[1])]))
        .map(|m| m.dot(normal))
        .collect();
    let [measured, error] = mean(&cosines);
    let expected = (s + 1.0) / (s + 2.0);
    out.compare(format!("twins, s = {s}: E cos"), measured, expected, 4.0 * error);
    let echoes: Vec<f64> = cosines.iter().map(|&c| facing(c, n)).collect();
    let [measured, error] = mean(&echoes);
    let expected = integral(s, 0.0, |c| facing(c, n));
    let what = format!("twins, s = {s}: E max(0, cos 2t)^{n}");
    out.compare(what, measured, expected, 4.0 * error);
}

/// Widest tilt shown, degrees, and bins.
const BINS: u32 = 45;

fn density(s: f64) -> Curve {
    let kept = integral(s, FRAC_1_SQRT_2, |_| 1.0);
    let at = |i: u32| {
        let degrees = 0.25 * f64::from(i);
        let (sin, cos) = degrees.to_radians().sin_cos();
        [degrees, (s + 1.0) * cos.powf(s) * sin / kept * 1f64.to_radians()]
    };
    Curve {
        label: "(s + 1) cos^s t sin t, cut at 45 degrees".into(),
        points: (0..=4 * BINS).map(at).collect(),
        line: true,
    }
}

fn histogram(label: &str, cosines: &[f64]) -> Curve {
    let mut counts = vec![0u32; BINS as usize + 1];
    for c in cosines {
        counts[c.min(1.0).acos().to_degrees() as usize] += 1;
    }
    let bins = counts.iter().take(BINS as usize).enumerate();
    Curve {
        label: label.into(),
        points: bins.map(|(i, &n)| [i as f64 + 0.5, f64::from(n) / cosines.len() as f64]).collect(),
        line: false,
    }
}
