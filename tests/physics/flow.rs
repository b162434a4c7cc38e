//! Blood that flows: what its velocity does to the echoes of successive pulses.

use std::f64::consts::PI;
use std::rc::Rc;

use glam::{DAffine3, DVec3};
use insonify::scene::flow::{CentreLine, Course, Flow, FlowShape, Vessel};
use insonify::scene::{Scene, shapes};

use crate::physics::check::{Bench, Check, Outcome, Physics};
use crate::physics::render::Frame;
use crate::physics::scenes::{add_body, add_box, linear, silent, tissue};
use crate::physics::speckle::{sigma_axial, sigma_elevation, sigma_lateral};

/// Assumed and true speed of sound, mm/s.
const SOUND: f64 = 1.540e6;
/// Time from one pulse to the next, s.
const INTERVAL: f64 = 2e-4;
/// Depths between which is measured, mm.
const DEPTHS: [f64; 2] = [34.0, 46.0];
/// Lines at either end that have too few neighbours.
const BESIDE: usize = 16;

/// Check T41.
pub fn blood_decorrelates_and_turns_as_its_velocity_says() -> Check {
    Check {
        row: "T41",
        name: "blood_decorrelates_and_turns_as_its_velocity_says",
        claim: "Scatterers that move by v T between two pulses turn the echo by exp(-i k v_z T), k = 4 pi f / c, and \
            correlate by exp(-T^2 / 4 sum v_i^2 / sigma_i^2) with deviations sigma of a Gaussian point-spread function. So \
            the phase of the correlation of successive pulses says v cos(theta), at 20, 45 and 70 degrees, up to the Nyquist \
            velocity c PRF / (4 f), beyond which it folds over. Velocities within 1 % of that, correlations within 0.02.",
        planted: "Blood that flows by a tenth faster.",
        run: uniform,
    }
}

/// Check T42.
pub fn a_vessel_has_the_profile_that_the_beam_smooths() -> Check {
    Check {
        row: "T42",
        name: "a_vessel_has_the_profile_that_the_beam_smooths",
        claim: "Blood in a tube of radius R at 60 degrees flows by v (1 - r^2 / R^2). A resolution cell with deviations \
            sigma sees the mean of that over its power: v cos(theta) (1 - (r^2 + r2) / R^2), r2 = sigma_y^2 / 2 + cos^2(theta) \
            sigma_x^2 / 2 + sin^2(theta) sigma_z^2 / 2. Within 5 % of v cos(theta), root mean square over the middle 70 %; on the axis \
            within 3 %.",
        planted: "A profile with the exponent 4.",
        run: profile,
    }
}

/// Check T43.
pub fn blood_is_as_loud_at_every_time() -> Check {
    Check {
        row: "T43",
        name: "blood_is_as_loud_at_every_time",
        claim: "Scatterers of blood are renewed in two generations whose weights' squares add up to 1, and a flow that keeps its \
            volume keeps their number: speckle has the power of blood at rest, within 0.35 dB, and the signal-to-noise ratio \
            of a Rayleigh distribution, 1.913 within 0.06, when one generation is alone, when both are equally loud, and between, \
            however much the wall's shear has drawn them out.",
        planted: "Weights that add up to 1 themselves: 3 dB less where both are equally loud.",
        run: loudness,
    }
}

/// The echoes of four pulses, as frames of the scene at successive times, with so many sets of scatterers.
fn packets(
    render: &dyn Fn(&Scene) -> Rc<Frame>,
    scene: &mut Scene,
    sets: u32,
) -> Vec<Vec<Rc<Frame>>> {
    let mut packet = |seed: u32| -> Vec<Rc<Frame>> {
        scene.simulation.seed = seed;
        let at = |n: u32| {
            scene.set_time(f64::from(n) * INTERVAL);
            render(scene)
        };
        (0..4).map(at).collect()
    };
    (0..sets).map(&mut packet).collect()
}

/// The sum of s(n + lag) times the conjugate of s(n), over pulses, of the samples that `within` lets count.
fn correlation(
    packets: &[Vec<Rc<Frame>>],
    lag: usize,
    within: impl Fn(usize, usize) -> bool,
) -> [f64; 2] {
    let mut sum = [0.0; 2];
    let pairs = packets.iter().flat_map(|pulses| pulses.iter().zip(pulses.iter().skip(lag)));
    for (now, later) in pairs {
        for (l, (now, later)) in now.iq.iter().zip(&later.iq).enumerate() {
            for (k, (a, b)) in now.iter().zip(later).enumerate() {
                if within(l, k) {
                    sum[0] += b[0] * a[0] + b[1] * a[1];
                    sum[1] += b[1] * a[0] - b[0] * a[1];
                }
            }
        }
    }
    sum
}

/// Velocity away from the probe by the phase of a correlation, mm/s, and the one at which it folds over.
fn velocity(scene: &Scene, [re, im]: [f64; 2]) -> f64 {
    -nyquist(scene) * im.atan2(re) / PI
}

fn nyquist(scene: &Scene) -> f64 {
    SOUND / (4e6 * scene.probe.frequency * INTERVAL)
}

/// Scanlines a tenth of a millimetre apart, 60 mm deep, of silent tissue.
const LINES: usize = 72;

fn bench() -> Scene {
    let mut scene = linear(LINES as u32, 0.1 * LINES as f64, silent(1.54, 1.63, 0.0));
    let pitch = scene.probe.sample_pitch();
    scene.probe.depth = 60.0;
    scene.probe.samples = (60.0 / pitch).round() as u32;
    scene.imaging.image_height = 40;
    scene
}

/// Blood in a box around the depths between which is measured, flowing at `angle` to the scanlines.
fn block(angle: f64, speed: f64) -> Scene {
    let mut scene = bench();
    let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, 30.0));
    add_box(&mut scene, [300.0, 300.0, 20.0], tissue(1.54, 1.63, 0.0), at);
    let shape = FlowShape::Uniform(DVec3::new(angle.sin(), 0.0, angle.cos()));
    scene.flows = vec![Flow::new("blood".into(), 0, shape, speed, Course::Steady)];
    scene
}

/// Chance makes 0.1 % of the Nyquist velocity over these 2000 resolution cells, and a hundredth of a correlation.
fn uniform(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let wrong = if physics == Physics::Planted { 1.1 } else { 1.0 };
    for (degrees, speed) in [(20.0_f64, 300.0), (45.0, 400.0), (70.0, 500.0), (20.0, 480.0)] {
        let angle = degrees.to_radians();
        let mut scene = block(angle, wrong * speed);
        let packets = packets(render, &mut scene, 4);
        let pitch = scene.probe.sample_pitch();
        let [a, b] = DEPTHS.map(|z| (z / pitch) as usize);
        let inside =
            |l: usize, k: usize| (BESIDE..LINES - BESIDE).contains(&l) && (a..b).contains(&k);
        let of = |lag| correlation(&packets, lag, inside);
        let folds = nyquist(&scene);
        let true_one = speed * angle.cos();
        let expected = (true_one + folds).rem_euclid(2.0 * folds) - folds;
        out.compare(
            format!("{name}: {degrees} degrees, {speed} mm/s: velocity over Nyquist's"),
            velocity(&scene, of(1)) / folds,
            expected / folds,
            0.01,
        );
        let along = true_one / sigma_axial(&scene);
        // The beam widens with depth: the mean over these depths.
        let overlap = |time: f64| {
            let at = |k: usize| {
                let across = speed * angle.sin() / sigma_lateral(&scene, k as f64 * pitch);
                (-0.25 * time * time * (across * across + along * along)).exp()
            };
            (a..b).map(at).sum::<f64>() / (b - a) as f64
        };
        let power = of(0)[0];
        // The fastest one has hardly anything in common with itself then.
        for lag in [2, 3].into_iter().filter(|_| true_one < folds) {
            let time = lag as f64 * INTERVAL;
            let [re, im] = of(lag);
            // A lag has fewer pairs than there are pulses.
            let measured = re.hypot(im) / power * 4.0 / (4 - lag) as f64;
            out.compare(
                format!("{name}: {degrees} degrees, {speed} mm/s: correlation over {lag} pulses"),
                measured,
                overlap(time),
                0.02,
            );
        }
    }
    out
}

/// Radius of the vessel, mm, and the depth of its axis in the middle of the image.
const RADIUS: f64 = 4.0;
/// That of one with many resolution cells.
const WIDE: f64 = 12.0;
const AXIS: f64 = 40.0;

/// A vessel of this radius, mm, at `angle` to the scanlines, in which blood flows with a profile of this exponent.
fn vessel(radius: f64, angle: f64, speed: f64, exponent: f64) -> Scene {
    let mut scene = bench();
    let mesh = shapes::cylinder(radius, 120.0, 256);
    let at = DAffine3::from_translation(DVec3::Z * AXIS) * DAffine3::from_rotation_y(angle);
    add_body(&mut scene, mesh, tissue(1.54, 1.63, 0.0), at);
    let ends = [-60.0, 60.0].map(|z| DVec3::Z * z).to_vec();
    let line = CentreLine::new(ends, vec![radius; 2]).expect("a line");
    let shape = FlowShape::Tube(Vessel::tube(line, exponent));
    scene.flows = vec![Flow::new("blood".into(), 0, shape, speed, Course::Steady)];
    scene
}

/// Distance of a sample from the axis of a vessel at `angle`, mm, with a sign.
fn off_axis(scene: &Scene, angle: f64, l: usize, k: usize) -> f64 {
    let x = scene.probe.ray(l as u32, 0).0.x;
    let z = (k as f64 + 0.5) * scene.probe.sample_pitch() - AXIS;
    z * angle.sin() - x * angle.cos()
}

/// Chance makes 0.1 dB of these 2000 resolution cells, once for blood at rest and once for each time, and 0.02 of their signal-to-noise ratio.
fn loudness(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let angle = 60.0_f64.to_radians();
    let mut scene = vessel(WIDE, angle, 400.0, 2.0);
    let lifetime = scene.flows[0].lifetime(&scene.instances[0].world_from_object, |_| true);
    let lines = BESIDE..LINES - BESIDE;
    let mut measure = |flows: Vec<Flow>, lives: f64| {
        scene.flows = flows;
        scene.set_time(lives * lifetime);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..6 {
            scene.simulation.seed = seed;
            let frame = render(&scene);
            for l in lines.clone() {
                for (k, [re, im]) in frame.iq[l].iter().enumerate() {
                    if off_axis(&scene, angle, l, k).abs() < 0.8 * WIDE {
                        let power = re * re + im * im;
                        (sum, squares, count) = (sum + power.sqrt(), squares + power, count + 1.0);
                    }
                }
            }
        }
        let (mean, power) = (sum / count, squares / count);
        (10.0 * f64::log10(power), mean / (power - mean * mean).sqrt())
    };
    let flows = vessel(WIDE, angle, 400.0, 2.0).flows;
    let (still, _) = measure(Vec::new(), 0.0);
    for lives in [0.0, 0.1, 0.25, 0.4, 7.75] {
        let (level, ratio) = measure(flows.clone(), lives);
        // Their weights are the cosine and the sine of pi lives.
        let halves = (PI * lives).cos().abs() + (PI * lives).sin().abs();
        let wrong = if physics == Physics::Planted { -20.0 * halves.log10() } else { 0.0 };
        let figure = out.compare(
            format!("{name}: after {lives} lives: level, dB"),
            level - still + wrong,
            0.0,
            0.35,
        );
        if lives == 0.0 {
            figure.unlike("no generation at all", f64::NEG_INFINITY);
        }
        out.compare(format!("{name}: after {lives} lives: signal over noise"), ratio, 1.913, 0.06)
            .unlike("half the samples twice as loud", 1.62);
    }
    out
}

fn profile(bench: &Bench, physics: Physics) -> Outcome {
    let mut out = Outcome::default();
    let (name, render) = &bench.renderers[1];
    let (angle, speed) = (60.0_f64.to_radians(), 400.0);
    let exponent = if physics == Physics::Planted { 4.0 } else { 2.0 };
    let mut scene = vessel(RADIUS, angle, speed, exponent);
    let packets = packets(render, &mut scene, 5);
    let of =
        |inside: &dyn Fn(usize, usize) -> bool| velocity(&scene, correlation(&packets, 1, inside));
    let spread = {
        let [x, y, z] =
            [sigma_lateral(&scene, AXIS), sigma_elevation(&scene, AXIS), sigma_axial(&scene)];
        (y * y + (x * angle.cos()).powi(2) + (z * angle.sin()).powi(2)) / 2.0
    };
    let law = |r: f64| speed * angle.cos() * (1.0 - (r * r + spread) / (RADIUS * RADIUS));
    let distance = |l: usize, k: usize| off_axis(&scene, angle, l, k);
    let lines = BESIDE..LINES - BESIDE;
    let rings = 14;
    let reach = 0.7 * RADIUS;
    let width = 2.0 * reach / f64::from(rings);
    let mut squares = 0.0;
    for ring in 0..rings {
        let begin = -reach + width * f64::from(ring);
        let inside = |l: usize, k: usize| {
            lines.contains(&l) && (begin..begin + width).contains(&distance(l, k))
        };
        let measured = of(&inside);
        squares += (measured - law(begin + width / 2.0)).powi(2);
    }
    let top = speed * angle.cos();
    let off = (squares / f64::from(rings)).sqrt() / top;
    out.compare(format!("{name}: off the profile, root mean square"), off, 0.0, 0.05);
    let inside = |l: usize, k: usize| lines.contains(&l) && distance(l, k).abs() < 0.2;
    out.compare(format!("{name}: on the axis"), of(&inside) / top, law(0.0) / top, 0.03)
        .unlike("the parabola itself", 1.0);
    out
}
