//! Lattices that follow the resolution cell: speckle is fully developed and equally bright at every depth of every
//! probe, no transition between levels shows, and it rests in the tissue while the probe moves.

use std::f64::consts::{FRAC_PI_4, PI, SQRT_2};

use glam::{DAffine3, DQuat, DVec3};
use insonify::gpu::test_device;
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::{Scene, Simulation};
use insonify::sim::calibration::Calibration;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer, tables};

use crate::common::signal;

/// Complex baseband per scanline.
type Lines = Vec<Vec<[f64; 2]>>;

/// Lossless fully developed speckle without noise.
fn speckle(probe: Probe) -> Scene {
    let mut scene = signal::scene(probe);
    scene.tissues[0].attenuation = 0.0;
    scene.imaging.tgc_attenuation = 0.0;
    scene.imaging.noise = f64::NEG_INFINITY;
    scene.simulation.cell = Simulation::default_cell(scene.probe.frequency);
    scene.simulation.paths = 1;
    scene.simulation.max_reflections = 0;
    // Oblique to the lattice.
    scene.world_from_probe = DAffine3::from_quat(
        DQuat::from_rotation_x(0.3) * DQuat::from_rotation_y(0.45) * DQuat::from_rotation_z(0.2),
    );
    scene
}

struct Bench(Simulator);

impl Bench {
    fn new(scene: &Scene) -> Self {
        let simulator = Simulator::new(&test_device(), &Library::embedded(), scene, Tracer::Bvh);
        Self(simulator.expect("a simulator"))
    }

    fn shoot(&mut self, scene: &Scene) -> Lines {
        self.0.frame(scene, 0).expect("a frame");
        let iq = self.0.iq().expect("baseband");
        let line = |l: &[f32]| l.chunks(2).map(|v| [v[0].into(), v[1].into()]).collect();
        iq.chunks(2 * scene.probe.samples as usize).map(line).collect()
    }
}

/// Sums of envelopes and of intensities, and their number, per band of equal depth.
fn bands(lines: &Lines, count: usize) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; count];
    for line in lines {
        for (k, v) in line.iter().enumerate() {
            let intensity = v[0] * v[0] + v[1] * v[1];
            let sum = &mut sums[k * count / line.len()];
            *sum = [sum[0] + intensity.sqrt(), sum[1] + intensity, sum[2] + 1.0];
        }
    }
    sums
}

/// Per band: mean over deviation of the envelope, and its RMS in dB, over a few seeds.
fn measured(scene: &Scene, seeds: u32, count: usize) -> Vec<[f64; 2]> {
    let mut bench = Bench::new(scene);
    let mut sums = vec![[0.0; 3]; count];
    for seed in 0..seeds {
        let mut scene = scene.clone();
        scene.simulation.seed = 1 + seed;
        for (sum, more) in sums.iter_mut().zip(bands(&bench.shoot(&scene), count)) {
            *sum = std::array::from_fn(|i| sum[i] + more[i]);
        }
    }
    let figures = |[envelope, intensity, n]: [f64; 3]| {
        let (mean, power) = (envelope / n, intensity / n);
        [mean / (power - mean * mean).sqrt(), 10.0 * power.log10()]
    };
    sums.into_iter().map(figures).collect()
}

/// Every probe with fewer scanlines, which lie apart: neighbours would add little.
fn probes() -> impl Iterator<Item = (&'static str, Probe)> {
    let fewer = |(name, probe): &(&'static str, fn() -> Probe)| {
        let probe = probe();
        (*name, Probe { scanlines: 40, ..probe })
    };
    Probe::PRESETS.iter().map(fewer)
}

// A band of an eighth of the depth holds some 1500 resolution cells per frame: the ratio's standard error is
// about 1 / (2 sqrt n), 0.006 over four frames, the level's 4.3 dB / sqrt n, 0.06 dB.
#[test]
fn speckle_is_fully_developed_and_level_at_every_depth_of_every_probe() {
    for (name, probe) in probes() {
        let scene = speckle(probe);
        let all = measured(&scene, 4, 8);
        // Scanlines of a small face overlap at the face.
        let first = usize::from(!matches!(scene.probe.kind, ProbeKind::Linear { .. }));
        for (i, [ratio, level]) in all.into_iter().enumerate().skip(first) {
            let rayleigh = (PI / (4.0 - PI)).sqrt();
            assert!((ratio - rayleigh).abs() < 0.05, "{name}, band {i}: {ratio:.3}");
            assert!((level + 45.0).abs() < 0.25, "{name}, band {i}: {level:.2} dB");
        }
    }
}

/// Largest difference, dB, between the bands' levels and `expected`.
fn seam(levels: &[f64], expected: &[f64]) -> f64 {
    let pairs = levels.iter().zip(expected);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

// 32 bands of 400 cells each, over 12 frames: 0.06 dB; four of them, and the beam's ends.
#[test]
fn no_seam_shows_where_one_lattice_takes_over_from_another() {
    let scene = speckle(Probe { scanlines: 40, ..Probe::abdominal() });
    let rows = tables::rows(&scene);
    let count = 32;
    let levels: Vec<f64> = (0..count)
        .map(|i| f64::from(rows[(2 * i + 1) * rows.len() / (2 * count)].shape[3]))
        .collect();
    let changes = levels.windows(2).filter(|w| w[0].floor() != w[1].floor()).count();
    assert!(changes >= 3, "levels change along the depth: {levels:?}");
    let all = measured(&scene, 12, count);
    let got: Vec<f64> = all.iter().map(|v| v[1]).collect();
    let flat = vec![-45.0; count];
    let worst = seam(&got[1..], &flat[1..]);
    assert!(worst < 0.35, "{worst:.2} dB: {got:.2?}");
    for (i, v) in all.iter().enumerate().skip(1) {
        assert!((v[0] - 1.913).abs() < 0.08, "band {i}: {:.3}", v[0]);
    }
    // Planted: amplitudes that do not grow with the cells lose 3 dB per level.
    let planted: Vec<f64> = (got.iter().zip(&levels))
        .map(|(level, number)| level - 3.01 * number.floor().max(0.0))
        .collect();
    let mean = planted[1..].iter().sum::<f64>() / (count - 1) as f64;
    assert!(seam(&planted[1..], &vec![mean; count - 1]) > 1.0);
}

/// Magnitude of the complex correlation of two frames between two depths in mm.
fn correlation(scene: &Scene, a: &Lines, b: &Lines, depths: [f64; 2]) -> f64 {
    let [from, to] = depths.map(|z| (z / scene.probe.sample_pitch()) as usize);
    let (mut re, mut im, mut aa, mut bb) = (0.0, 0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        for (a, b) in a[from..to].iter().zip(&b[from..to]) {
            re += a[0] * b[0] + a[1] * b[1];
            im += a[0] * b[1] - a[1] * b[0];
            aa += a[0] * a[0] + a[1] * a[1];
            bb += b[0] * b[0] + b[1] * b[1];
        }
    }
    re.hypot(im) / (aa * bb).sqrt()
}

// Two Gaussian beams d apart share exp(-d^2 / 4 sigma^2) of their scatterers' sum. 64 scanlines of 30 mm hold some
// 3000 cells; the loss of a step is known to a few per cent of itself, and beams end at 2.5 sigma.
#[test]
fn a_moving_probe_leaves_of_speckle_what_its_beams_share() {
    let probe = Probe {
        scanlines: 64,
        samples: 1024,
        depth: 50.0,
        elevation_layers: 7,
        kind: ProbeKind::Linear { width: 30.0 },
        ..Probe::paper_table1()
    };
    let scene = speckle(probe);
    let depths = [15.0, 45.0];
    let mut bench = Bench::new(&scene);
    let calibration = Calibration::new(&scene);
    type Width<'a> = &'a dyn Fn(f64) -> f64;
    let mean = |sigma: Width, d: f64| {
        let at = |i: u32| depths[0] + (f64::from(i) + 0.5) / 30.0 * (depths[1] - depths[0]);
        (0..30).map(|i| (-d * d / (4.0 * sigma(at(i)).powi(2))).exp()).sum::<f64>() / 30.0
    };
    let lateral = |z: f64| calibration.sigma_lateral(z);
    let elevation = |z: f64| calibration.sigma_elevation(z);
    let ways: [(&str, DVec3, Width); 2] =
        [("laterally", DVec3::X, &lateral), ("across the slice", DVec3::Y, &elevation)];
    for (way, axis, sigma) in ways {
        let step = 0.1;
        let mut shots = Vec::new();
        for i in 0..8 {
            let mut moved = scene.clone();
            let by = DAffine3::from_translation(f64::from(i) * step * axis);
            moved.world_from_probe = scene.world_from_probe * by;
            shots.push(bench.shoot(&moved));
        }
        let expected = mean(sigma, step);
        for (i, pair) in shots.windows(2).enumerate() {
            let got = correlation(&scene, &pair[0], &pair[1], depths);
            assert!((got - expected).abs() < 0.01, "{way}, step {i}: {got:.4}, {expected:.4}");
        }
        let (got, expected) =
            (correlation(&scene, &shots[0], &shots[7], depths), mean(sigma, 7.0 * step));
        assert!((got - expected).abs() < 0.06, "{way}: {got:.3}, {expected:.3}");
        // Planted: another beam's width.
        assert!((got - mean(&|z| sigma(z) / SQRT_2, 7.0 * step)).abs() > 0.06);
    }
}

// Neighbouring scanlines of a sector, the outermost too: at depth z they are z + R apart times their angle.
#[test]
fn neighbouring_lines_share_speckle_as_their_beams_overlap() {
    let probe = Probe {
        kind: ProbeKind::Convex { radius: 50.0, field_of_view: FRAC_PI_4 },
        scanlines: 192,
        ..Probe::abdominal()
    };
    let scene = speckle(probe);
    let lines = Bench::new(&scene).shoot(&scene);
    let calibration = Calibration::new(&scene);
    for depths in [[60.0, 100.0], [110.0, 150.0]] {
        let at = |i: u32| depths[0] + (f64::from(i) + 0.5) / 40.0 * (depths[1] - depths[0]);
        let share = |z: f64| {
            let pitch = scene.probe.line_pitch(z);
            (-pitch * pitch / (4.0 * calibration.sigma_lateral(z).powi(2))).exp()
        };
        let expected = (0..40).map(|i| share(at(i))).sum::<f64>() / 40.0;
        for group in [0..32, 80..112, 160..191] {
            let (a, b) =
                (lines[group.clone()].to_vec(), lines[group.start + 1..=group.end].to_vec());
            let got = correlation(&scene, &a, &b, depths);
            assert!(
                (got - expected).abs() < 0.05,
                "{depths:?} mm, lines {group:?}: {got:.3}, {expected:.3}"
            );
        }
    }
}
