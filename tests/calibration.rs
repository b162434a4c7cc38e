//! Levels by brute force: lattices of random scatterers, summed in f64 with the numbers that the kernels
//! read, must have the brightness that the tables promise.

use std::f64::consts::SQRT_2;

use glam::DAffine3;
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::{Instance, Keyframes, Scene, Surface, Tissue, Wire};
use insonify::settings::ScatterMode;
use insonify::sim::calibration::{Calibration, amplitude, lateral_taps};
use insonify::sim::{layout, tables};

use crate::common::signal::{Random, scene, tissue};

/// Response of sample `k` to a unit echo at index `kappa`: the nearest sample, then the axial kernel.
fn axial(frame: &layout::Frame, k: f64, kappa: f64) -> f64 {
    let sigma = f64::from(frame.axial_sigma);
    let radius = (4.0 * sigma).ceil().min(32.0);
    let tap = |j: f64| {
        if j.abs() <= radius { (-j * j / (2.0 * sigma * sigma)).exp() } else { 0.0 }
    };
    tap((kappa + 0.5).floor() - k)
}

/// RMS envelope of `realisations` random lattices at sample `k`, unattenuated: what the lines hear of them in their strips,
/// smoothed over lines.
fn lattice_rms(scene: &Scene, k: usize, realisations: u32) -> f64 {
    let (frame, row) = (tables::frame(scene, 0), tables::rows(scene)[k]);
    let tissue = tables::tissues(scene)[0];
    let (h, dz) = (f64::from(frame.cell), f64::from(frame.sample_pitch));
    let (se, reach) = (f64::from(row.sigma_elevation), f64::from(frame.elevation_reach));
    let (strip, core) = (f64::from(row.shape[0]), f64::from(row.strip_core));
    let taps = lateral_taps(f64::from(row.strip_lines));
    let gain = f64::from(row.volume_gain) / f64::from(row.compensation);
    let z = k as f64 * dz;
    let pitch = scene.probe.line_pitch(z);
    let heard = |x: f64| -> f64 {
        let last = taps.len() as i32 - 1;
        let of = |j: i32| {
            let across = (x - f64::from(j) * pitch).abs() / strip;
            let share = match core < 0.0 {
                true if across < 1.0 => {
                    (-(f64::from(layout::STRIP_CUT) * across).powi(2) / 2.0).exp()
                }
                true => 0.0,
                false => ((1.0 - across) / (1.0 - core)).clamp(0.0, 1.0),
            };
            taps[j.unsigned_abs() as usize] * share
        };
        (-last..=last).map(of).sum()
    };
    let cut = strip + (taps.len() - 1) as f64 * pitch;
    let deep = 5.0 * scene.probe.sigma_axial();
    let half = frame.slice_thickness as f64 / 2.0;
    let cells = |low: f64, high: f64| (low / h).floor() as i64..=(high / h).floor() as i64;
    let mut power = 0.0;
    for n in 0..realisations {
        let mut random = Random(u64::from(n) << 32);
        let shift: [f64; 3] = std::array::from_fn(|_| h * random.uniform());
        let (mut re, mut im) = (0.0, 0.0);
        for ix in cells(-cut - h, cut) {
            for iy in cells(-half - h, half) {
                for iz in cells(z - deep - h, z + deep) {
                    let mut at = |i: i64, s: f64| (i as f64 + random.uniform()) * h + s;
                    let (x, y, p) = (at(ix, shift[0]), at(iy, shift[1]), at(iz, shift[2]));
                    let density = f64::from(tissue.density);
                    let present = random.uniform() < density;
                    let sign = if random.uniform() < 0.5 { 1.0 } else { -1.0 };
                    let a = sign * f64::from(tissue.amplitude) / density.sqrt();
                    let layer = ((y / (2.0 * half) + 0.5) * f64::from(frame.layers)).floor();
                    let e = layer.clamp(0.0, f64::from(frame.layers) - 1.0) as u32;
                    let nearest = (scene.probe.elevation(e).abs() - reach).max(0.0);
                    let beyond = nearest > f64::from(frame.elevation_cut) * se;
                    let rho_e = y - scene.probe.elevation(e);
                    if !present || beyond || rho_e.abs() > reach {
                        continue;
                    }
                    let beam = heard(x) * (-y * y / (2.0 * se * se)).exp();
                    let q = a * beam * gain * axial(&frame, k as f64, p / dz);
                    let (sin, cos) = (scene.probe.phase_per_mm() * p).sin_cos();
                    re += q * cos;
                    im -= q * sin;
                }
            }
        }
        power += re * re + im * im;
    }
    (power / f64::from(realisations)).sqrt()
}

fn decibel(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// Mean power of n exponential draws has relative standard error 1/sqrt(n); four of them, in dB.
fn tolerance(realisations: u32) -> f64 {
    4.0 * 10.0 / std::f64::consts::LN_10 / f64::from(realisations).sqrt()
}

// Steps of half an octave: no fewer than asked for, and at most the square root of 2 times as many.
#[test]
fn a_resolution_cell_holds_as_many_scatterers_as_are_wanted_at_every_depth() {
    let mut scene = scene(Probe::abdominal());
    scene.simulation.cell = 0.1;
    let tissue = scene.tissues[0].clone();
    let count = |scene: &Scene, z| Calibration::new(scene).scatterers_at(&tissue, z);
    for i in 1..16 {
        let z = 10.0 * f64::from(i);
        scene.simulation.scatterers_per_resolution_cell = 8.0;
        let thinned = count(&scene, z);
        assert!((8.0..=8.0 * SQRT_2).contains(&thinned), "{z} mm: {thinned}");
        scene.simulation.scatterers_per_resolution_cell = 0.0;
        assert!(count(&scene, z) > 8.0 * SQRT_2, "all there are");
    }
}

#[test]
fn liver_speckle_is_45_db_under_a_mirror_at_every_depth() {
    let n = 1500;
    for k in [300, 1024, 1900] {
        let scene = scene(Probe::paper_table1());
        let level = decibel(lattice_rms(&scene, k, n));
        assert!((level + 45.0).abs() < tolerance(n), "k {k}: {level}");
    }
}

#[test]
fn echogenicity_sets_brightness_whatever_density_and_mean() {
    let n = 1500;
    for (rho, mean) in [(0.3, 0.0), (0.5, 1.0), (1.0, 2.0)] {
        let mut scene = scene(Probe::linear());
        scene.tissues[0] =
            Tissue { density_of_scatterers: rho, mean_over_sigma: mean, ..tissue(-6.0) };
        let level = decibel(lattice_rms(&scene, 1000, n));
        assert!((level + 51.0).abs() < tolerance(n), "{rho} {mean}: {level}");
    }
}

#[test]
fn a_missing_elevation_factor_is_caught() {
    // Planted error: the gain of a slice of 5 mm used by one of 1 mm.
    let mut scene = scene(Probe::paper_table1());
    let full = Calibration::new(&scene).speckle_gain(50.0);
    scene.probe.slice_thickness = 1.0;
    let thin = Calibration::new(&scene).speckle_gain(50.0);
    assert!(decibel(thin / full) > 2.0 * tolerance(1500), "{thin} {full}");
}

#[test]
fn the_full_slab_needs_no_correction() {
    // The slab covers +-4 sigma_e at the lens focus: nothing of the beam is missing.
    // Layers that lie beyond 2.5 sigmas altogether have erfc(2.5) = 0.04 % of the power.
    let scene = scene(Probe::paper_table1());
    let power = Calibration::new(&scene).beam_power(60.0);
    assert!((power - 1.0).abs() < 1e-3, "{power}");
}

#[test]
fn voxel_speckle_is_45_db_under_a_mirror() {
    let n = 3000;
    for (probe, h) in
        [(Probe::paper_table1(), 0.04), (Probe::paper_table1(), 0.15), (Probe::linear(), 0.3)]
    {
        let mut scene = scene(probe);
        scene.simulation.scatter_mode = ScatterMode::Voxel;
        scene.simulation.cell = h;
        let (frame, k) = (tables::frame(&scene, 0), 1000usize);
        let (row, tissue) = (tables::rows(&scene)[k], tables::tissues(&scene)[0]);
        let gain = f64::from(row.volume_gain) / f64::from(row.compensation);
        let dz = f64::from(frame.sample_pitch);
        let pitch = scene.probe.line_pitch(k as f64 * dz);
        let taps = lateral_taps(f64::from(row.lateral_lines));
        let se = f64::from(row.sigma_elevation);
        let mut power = 0.0;
        for n in 0..n {
            let mut random = Random(u64::from(n) << 32);
            let shift: [f64; 2] = std::array::from_fn(|_| h * random.uniform());
            let (mut re, mut im) = (0.0, 0.0);
            for e in 0..frame.layers {
                let y = scene.probe.elevation(e);
                let mut cells = std::collections::HashMap::new();
                for j in 1 - taps.len() as i64..taps.len() as i64 {
                    let ix = ((j as f64 * pitch + shift[0]) / h).floor() as i64;
                    for m in -16i64..=16 {
                        let at = k as i64 + m;
                        let iz = ((at as f64 * dz + shift[1]) / h).floor() as i64;
                        let (a, unit) = *cells
                            .entry((ix, iz))
                            .or_insert_with(|| (random.gaussian(), random.uniform()));
                        let kappa = at as f64 + unit - 0.5;
                        let q = f64::from(tissue.sigma)
                            * a
                            * gain
                            * taps[j.unsigned_abs() as usize]
                            * (-y * y / (2.0 * se * se)).exp()
                            * axial(&frame, k as f64, kappa);
                        let (sin, cos) = (scene.probe.phase_per_mm() * dz * kappa).sin_cos();
                        re += q * cos;
                        im -= q * sin;
                    }
                }
            }
            power += re * re + im * im;
        }
        let level = decibel((power / f64::from(n)).sqrt());
        assert!((level + 45.0).abs() < tolerance(n), "h {h}: {level}");
    }
}

#[test]
fn points_show_their_amplitude_at_the_transmit_focus() {
    let scene = scene(Probe::linear());
    let calibration = Calibration::new(&scene);
    assert!((calibration.point_gain(scene.probe.focus) - 1.0).abs() < 1e-12);
    assert!(calibration.point_gain(38.0) < 0.9);
}

#[test]
fn noise_has_its_level_after_the_axial_kernel() {
    let mut scene = scene(Probe::paper_table1());
    let frame = tables::frame(&scene, 0);
    let energy: f64 = (-32..=32).map(|j| axial(&frame, 0.0, f64::from(j)).powi(2)).sum();
    let rms = f64::from(frame.noise) * (2.0 * energy).sqrt();
    assert!((decibel(rms) + 116.0).abs() < 1e-4, "{}", decibel(rms));
    scene.imaging.noise = f64::NEG_INFINITY;
    assert_eq!(tables::frame(&scene, 0).noise, 0.0);
}

#[test]
fn sums_cannot_reach_the_accumulators_end() {
    let mut scene = scene(Probe::paper_table1());
    scene.imaging.tgc_attenuation = 1.0; // the limit of 80 dB is reached at 57 mm
    scene.tissues.push(tissue(12.0));
    scene.simulation.paths = 4096;
    scene.instances.push(Instance {
        name: "plate".into(),
        mesh: 0,
        keyframes: Keyframes::default(),
        shown: true,
        tissue: 0,
        priority: 0,
        world_from_object: DAffine3::IDENTITY,
        surface: [Surface { roughness: f64::INFINITY, thickness: 0.3, specularity: 1.0, gain: 6.0 };
            2],
    });
    scene.wires.push(Wire {
        ends: [[-10.0, 0.0, 50.0], [10.0, 0.0, 50.0]],
        spacing: 0.05,
        amplitude: 0.5,
    });
    let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
    let surface = tables::surfaces(&scene)[0];
    let limit = f64::from(1u32 << 30);
    // Every path's echo in phase, split as the tracer does, on every layer.
    let paths = f64::from(frame.paths);
    let gamma = f64::from(surface.coherence);
    let row = rows[2047];
    let incoherent = paths.sqrt() * f64::from(row.incoherent_gain);
    let shares = gamma + (1.0 - gamma * gamma).sqrt() * incoherent;
    let weights = Calibration::new(&scene).elevation_weights(2047.0 * scene.probe.sample_pitch());
    let sum = shares * f64::from(surface.gain) * f64::from(row.surface_gain) * weights;
    let fixed = sum * f64::from(frame.surface_scale);
    assert!(fixed < limit && fixed > limit / 64.0, "{fixed:e}");
    assert_eq!(frame.surface_scale.log2().fract(), 0.0);
    // Eight standard deviations of the loudest speckle that a line hears itself, or every point of the wire that a beam at
    // 50 mm sees, in phase.
    let strip = Calibration::new(&scene).strip(2047.0 * scene.probe.sample_pitch());
    let own = (strip.own_energy() / strip.energy()).sqrt();
    let rms = own * amplitude(-45.0 + 12.0) * f64::from(row.compensation);
    let row = rows[1024];
    let near = tables::points(&scene)
        .iter()
        .map(|p| (-f64::from(p[0] / row.sigma_lateral).powi(2) / 2.0).exp())
        .sum::<f64>();
    let fixed =
        f64::from(frame.volume_scale) * (8.0 * rms).max(0.5 * near * f64::from(row.point_gain));
    assert!(fixed < limit && fixed > limit / 64.0, "{fixed:e}");
}

#[test]
fn speckle_stays_above_the_rounding_everywhere() {
    // The floor: at every depth of every preset a scatterer of liver on the axis deposits many units, so that
    // rounding (1/sqrt(12) each) is far below it.
    for probe in [
        Probe::paper_table1(),
        Probe::abdominal(),
        Probe::cardiac(),
        Probe::linear(),
        Probe::phased(),
    ] {
        let scene = scene(probe);
        let (frame, tissue) = (tables::frame(&scene, 0), tables::tissues(&scene)[0]);
        let strength = f64::from(tissue.amplitude / tissue.density.sqrt() * frame.volume_scale);
        let least = tables::rows(&scene)
            .iter()
            .enumerate()
            .map(|(k, row)| {
                // The two-way amplitude is the one-way intensity.
                let depth = k as f64 * f64::from(frame.sample_pitch);
                let left = (-f64::from(tissue.absorption) * depth).exp();
                strength * f64::from(row.volume_gain) * left
            })
            .fold(f64::INFINITY, f64::min);
        println!("{least:.0} units at least");
        assert!(least > 64.0, "{least}");
    }
}

#[test]
fn the_picture_holds_the_whole_sector() {
    let wide = Probe {
        kind: ProbeKind::Convex { radius: 10.0, field_of_view: 4.0 },
        ..Probe::paper_table1()
    };
    for probe in [Probe::paper_table1(), Probe::abdominal(), Probe::linear(), Probe::phased(), wide]
    {
        let scene = scene(probe);
        let frame = tables::frame(&scene, 0);
        let right = -frame.image_left;
        let bottom = frame.image_top + frame.pixel_pitch * frame.image_height as f32;
        assert!(right <= frame.pixel_pitch * (frame.image_width + 1) as f32 / 2.0);
        let mut extent = [0f64; 2]; // least distances to the top and right edges
        extent.fill(f64::INFINITY);
        for i in 0..=1000 {
            // Points of the sector's outline, from the definition of the scanlines.
            let u = f64::from(i) / 1000.0 - 0.5;
            for depth in [0.0, scene.probe.depth] {
                let (x, z) = match scene.probe.kind {
                    ProbeKind::Convex { radius, field_of_view } => {
                        let (s, c) = (u * field_of_view).sin_cos();
                        ((radius + depth) * s, (radius + depth) * c - radius)
                    }
                    ProbeKind::Phased { field_of_view } => {
                        let (s, c) = (u * field_of_view).sin_cos();
                        (depth * s, depth * c)
                    }
                    ProbeKind::Linear { width } => (u * width, depth),
                };
                extent[0] = extent[0].min(z - f64::from(frame.image_top));
                extent[1] = extent[1].min(f64::from(right) - x);
                assert!(f64::from(bottom) - z > -1e-4);
            }
        }
        // Contained (to f32), and no wider than a pixel too much.
        let pixel = f64::from(frame.pixel_pitch);
        assert!(extent[0] > -1e-4 && extent[0] < 1e-3, "{extent:?}");
        assert!(extent[1] > -1e-4 && extent[1] < pixel, "{extent:?}");
    }
}

#[test]
fn tgc_adds_sliders_to_the_limited_curve() {
    let mut scene = scene(Probe::paper_table1());
    scene.imaging.tgc_limit = 35.0;
    scene.imaging.tgc_sliders = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0];
    let rows = tables::rows(&scene);
    let at = |k: usize| decibel(f64::from(rows[k].tgc));
    // 2 x 0.5 dB/(cm MHz) x 7 MHz x 2.5 cm
    assert!((at(512) - 17.5).abs() < 1e-4, "{}", at(512));
    // limited to 35 dB, and half-way between the last two sliders at 13/14 of the depth
    let k = 2048 * 13 / 14;
    let slider = 7.0 * (k as f64 / 2048.0 * 7.0 - 6.0);
    assert!((at(k) - 35.0 - slider).abs() < 1e-4, "{}", at(k));
    assert!((decibel(f64::from(rows[2047].compensation)) - 35.0).abs() < 1e-4);
}

/// Deformed tissue is searched over 5.5 mm at most, in parts of a bin of at least eight samples, whatever the pitch of samples.
#[test]
fn pieces_of_deformed_tissue_are_as_long_in_every_resolution() {
    let samples = [2048.0, 1024.0, 512.0, 300.0].map(|count| tables::piece(165.0 / count));
    assert_eq!(samples, [64, 32, 16, 8]);
    assert_eq!([tables::piece(0.0), tables::piece(f64::INFINITY), tables::piece(10.0)], [64, 8, 8]);
}
