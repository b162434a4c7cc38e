//! Spectra of packets of pulses: closed forms of what flows, and an error planted into each that must be noticed.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use insonify::doppler::gate::record;
use insonify::doppler::spectrum::{Analyser, Spectrogram};
use insonify::gpu::test_device;
use insonify::scene::flow::{CentreLine, Course, Flow, FlowShape, Vessel};
use insonify::scene::{Scene, shapes};
use insonify::settings::{Spectral, Wave};
use insonify::sim::shaders::Library;
use insonify::sim::{Packet, Simulator, Tracer};

use crate::physics::scenes::{add_body, add_box, linear, silent, tissue};
use crate::physics::speckle::{sigma_axial, sigma_lateral};

/// Scanlines a tenth of a millimetre apart.
const LINES: u32 = 64;
const PRF: f64 = 5000.0;

fn bench(line_pitch: f64) -> Scene {
    let mut scene = linear(LINES, line_pitch * f64::from(LINES), silent(1.54, 1.63, 0.0));
    let pitch = scene.probe.sample_pitch();
    scene.probe.depth = 60.0;
    scene.probe.samples = (60.0 / pitch).round() as u32;
    scene.imaging.image_height = 40;
    scene
}

fn simulator(scene: &Scene) -> Simulator {
    let device = test_device();
    Simulator::new(&device, &Library::embedded(), scene, Tracer::Bvh).expect("a simulator")
}

/// Hz of a velocity along the scanline, mm/s.
fn shift(scene: &Scene, v: f64) -> f64 {
    2.0 * v * scene.probe.frequency / scene.probe.speed
}

/// Blood that flows by `speed` at `angle` to the scanlines, around the depths at which it is heard.
fn block(angle: f64, speed: f64) -> Scene {
    let mut scene = bench(0.1);
    let at = DAffine3::from_translation(DVec3::new(3.1, 5.3, 30.0));
    add_box(&mut scene, [300.0, 300.0, 20.0], tissue(1.54, 1.63, 0.0), at);
    let shape = FlowShape::Uniform(DVec3::new(angle.sin(), 0.0, angle.cos()));
    scene.flows = vec![Flow::new("blood".into(), 0, shape, speed, Course::Steady)];
    scene
}

/// Mean and deviation of the spectrum of a box's samples, Hz; the mean over whole pulses, by the phase of the
/// autocorrelation, and the deviation by its fall, of which the spectrum is the transform: R(T) = R(0) exp(-2 pi^2 s^2 T^2).
fn moments(scene: &Scene) -> [f64; 2] {
    let mut simulator = simulator(scene);
    let pitch = scene.probe.sample_pitch();
    let [begin, end] = [34.0, 46.0].map(|z| (z / pitch) as u32);
    let times: Vec<f64> = (0..16).map(|n| f64::from(n) / PRF).collect();
    let packet = Packet { times, lines: 16..LINES - 16, samples: begin..end, renewed: false };
    let mut scene = scene.clone();
    let mut sums = [[0.0; 2]; 2];
    for seed in 0..2 {
        scene.simulation.seed = seed;
        let echoes = simulator.packet(&scene, 0, &packet).expect("a packet");
        let pulses: Vec<&[[f32; 2]]> = echoes.chunks(echoes.len() / packet.times.len()).collect();
        // The mean by one pulse to the next, the deviation over five, by when it has fallen enough to be known.
        for (lag, sum) in [1, 5].into_iter().zip(&mut sums) {
            for (now, later) in pulses.iter().zip(&pulses[lag..]) {
                for (a, b) in now.iter().zip(*later) {
                    let [a, b] = [a, b].map(|z| z.map(f64::from));
                    sum[0] += (b[0] * a[0] + b[1] * a[1]) / (pulses.len() - lag) as f64;
                    sum[1] += (b[1] * a[0] - b[0] * a[1]) / (pulses.len() - lag) as f64;
                }
            }
        }
    }
    let [one, five] = sums.map(|[re, im]| re.hypot(im));
    // R(1) / R(5) = exp(2 pi^2 s^2 (25 - 1) T^2).
    let deviation = ((one / five).ln() / (48.0 * PI * PI)).max(0.0).sqrt() * PRF;
    [PRF * sums[0][1].atan2(sums[0][0]) / (2.0 * PI), deviation]
}

/// The spectrum of scatterers that cross the beam: its mean by the cosine law, its deviation
/// (1 / (2 sqrt 2 pi)) sqrt(sum v_i^2 / sigma_i^2) of a Gaussian point-spread function: transit time and intrinsic broadening
/// are one. At 20 to 70 degrees, the mean within 3 %, the deviation within 5 %.
#[test]
fn spectra_have_the_mean_and_the_width_of_what_crosses_the_beam() {
    for (degrees, speed) in [(20.0_f64, 150.0), (45.0, 200.0), (60.0, 300.0), (70.0, 400.0)] {
        let angle = degrees.to_radians();
        let scene = block(angle, -speed);
        let [mean, deviation] = moments(&scene);
        let expected = shift(&scene, speed * angle.cos());
        let widened = |wrong: f64| {
            let [across, along] = [wrong * speed * angle.sin(), speed * angle.cos()];
            let at = |k: u32| {
                let z = 34.0 + 12.0 * (f64::from(k) + 0.5) / 40.0;
                (across / sigma_lateral(&scene, z)).powi(2) + (along / sigma_axial(&scene)).powi(2)
            };
            ((0..40).map(at).sum::<f64>() / 40.0).sqrt() / (2.0 * 2.0_f64.sqrt() * PI)
        };
        println!("{degrees}: {mean} {expected}, {deviation} {}", widened(1.0));
        assert!((mean / expected - 1.0).abs() < 0.03, "{degrees}: {mean} {expected}");
        let off = |expected: f64| (deviation / expected - 1.0).abs();
        assert!(off(widened(1.0)) < 0.05, "{degrees}: {deviation} {}", widened(1.0));
        // A beam as wide in intensity as it is in amplitude would widen the spectrum by less, seen where blood crosses it.
        assert!(degrees < 70.0 || off(widened(0.5_f64.sqrt())) > 0.05, "{degrees}");
    }
}

/// A continuous wave hears all of its line, wherever the gate would be, and velocities for which pulses to that depth come too
/// seldom: 3 m/s along the line, 40 mm deep, where pulses tell apart 1. By the cosine law within 3 %.
#[test]
fn a_continuous_wave_has_no_depth_and_no_fastest_velocity() {
    let (angle, speed) = (60.0_f64.to_radians(), 6000.0);
    let mut scene = block(angle, -speed);
    let spectral = Spectral {
        wave: Wave::Continuous,
        prf: 100_000.0,
        depth: 40.0,
        wall_filter: 0.0,
        window: 0.005,
        columns: 1000.0,
        ..Spectral::default()
    };
    let probe = scene.probe.clone();
    let mut simulator = simulator(&scene);
    let mut heard = |spectral: &Spectral| {
        scene.spectral.clone_from(spectral);
        record(&mut simulator, &mut scene, 0.0, 600, 0).expect("echoes").0
    };
    let echoes = heard(&spectral);
    let mean = |spectral: &Spectral, echoes: &Vec<_>| {
        let mut analyser = Analyser::new(spectral);
        analyser.add(echoes);
        let made = analyser.take().shown(&probe, spectral);
        let columns = made.columns().flat_map(|column| column.iter().zip(&made.velocities));
        let [all, weighted] = columns.fold([0.0; 2], |[all, weighted], (&power, v)| {
            [all + f64::from(power), weighted + f64::from(power) * v]
        });
        weighted / all
    };
    let (found, expected) = (mean(&spectral, &echoes), speed * angle.cos());
    assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
    let elsewhere = Spectral { depth: 5.0, ..spectral.clone() };
    assert!(heard(&elsewhere) == echoes, "the gate's depth counts");
    // The planted error: pulses as close as that depth allows fold over.
    let most = probe.speed * 1e6 / (2.0 * 41.0);
    let pulsed = Spectral { wave: Wave::Pulsed, prf: most, ..spectral.clone() };
    assert!(pulsed.fault(&probe).is_none() && spectral.fault(&probe).is_none());
    let too_many = Spectral { wave: Wave::Pulsed, ..spectral };
    assert_eq!(too_many.fault(&probe).map(|fault| fault.0), Some("prf"));
    let folded = mean(&pulsed, &heard(&pulsed));
    assert!((folded / expected - 1.0).abs() > 0.5, "{folded}");
}

/// The mean spectrum of the gate over a whole vessel: a parabola has every velocity as often as every other, up to that of its
/// axis; an exponent K has (1 - f / f_max)^(2 / K - 1). Means over fifths of the range within a fifth, beyond the end nothing.
#[test]
#[ignore = "long: ./tools/test.sh --long"]
fn the_spectrum_of_a_whole_lumen_is_flat_for_a_parabola() {
    let (radius, angle, speed) = (1.0, 30.0_f64.to_radians(), 300.0);
    let made = |exponent: f64| -> Spectrogram {
        let mut scene = bench(0.5);
        // A beam that hears all of the vessel alike, in layers much thinner than the vessel.
        scene.imaging.psf_scale = [1.0, 14.0, 14.0];
        scene.probe.elevation_layers = 11;
        scene.probe.slice_thickness = 2.2;
        let mesh = shapes::cylinder(radius, 24.0, 96);
        let at = DAffine3::from_translation(DVec3::Z * 40.0) * DAffine3::from_rotation_y(angle);
        add_body(&mut scene, mesh, tissue(1.54, 1.63, 0.0), at);
        let ends = [12.0, -12.0].map(|z| DVec3::Z * z).to_vec();
        let line = CentreLine::new(ends, vec![radius; 2]).expect("a line");
        let shape = FlowShape::Tube(Vessel::tube(line, exponent));
        scene.flows = vec![Flow::new("blood".into(), 0, shape, speed, Course::Steady)];
        scene.spectral = Spectral {
            prf: 3000.0,
            depth: 40.0,
            gate: 7.0,
            wall_filter: 0.0,
            window: 0.016,
            columns: 150.0,
            ..Spectral::default()
        };
        let mut simulator = simulator(&scene);
        let mut analysers = Vec::new();
        for seed in 0..3 {
            scene.simulation.seed = seed;
            let mut analyser = Analyser::new(&scene.spectral);
            let (echoes, _) = record(&mut simulator, &mut scene, 0.0, 2400, 0).expect("echoes");
            analyser.add(&echoes);
            analysers.push(analyser.take().shown(&scene.probe, &scene.spectral));
        }
        let mut all = analysers.remove(0);
        analysers.iter().for_each(|more| all.power.extend(&more.power));
        all
    };
    let densities = |exponent: f64| -> Vec<f64> {
        let spectra = made(exponent);
        let top = speed * angle.cos();
        let mut bands = [0.0; 6];
        for column in spectra.columns() {
            for (&power, &v) in column.iter().zip(&spectra.velocities) {
                let at = v / top;
                // Five between a tenth and nine tenths, and what lies beyond the end.
                if (0.1..0.9).contains(&at) {
                    bands[((at - 0.1) / 0.16) as usize] += f64::from(power);
                } else if (1.3..1.46).contains(&at) {
                    bands[5] += f64::from(power);
                }
            }
        }
        let mean = bands[..5].iter().sum::<f64>() / 5.0;
        bands.iter().map(|band| band / mean).collect()
    };
    let flat = densities(2.0);
    println!("{flat:?}");
    assert!(flat[..5].iter().all(|band| (band - 1.0).abs() < 0.2) && flat[5] < 0.02, "{flat:?}");
    let blunt = densities(4.0);
    let law = |low: f64, high: f64| 2.0 * ((1.0 - low).sqrt() - (1.0 - high).sqrt());
    let expected: Vec<f64> =
        (0..5).map(|i| law(0.1 + 0.16 * f64::from(i), 0.26 + 0.16 * f64::from(i))).collect();
    let mean = expected.iter().sum::<f64>() / 5.0;
    println!("{blunt:?} {expected:?}");
    for (band, law) in blunt.iter().zip(&expected) {
        assert!((band - law / mean).abs() < 0.2, "{blunt:?}, {expected:?}");
    }
    // The planted error: one exponent's spectrum is not the other's.
    assert!(blunt[4] > 1.15, "{blunt:?}");
}
