//! Image formation on the device against closed forms: envelope, time-gain compensation and scan
//! conversion of every probe kind.

#[path = "common/signal.rs"]
mod signal;
#[path = "common/stages.rs"]
mod stages;

use std::f64::consts::TAU;

use insonify::probe::{Kind, Probe};
use insonify::scene::Scene;
use insonify::sim::{layout, tables};
use signal::{Random, scene};
use stages::Stages;

fn every_kind() -> [Probe; 3] {
    [Probe::paper_table1(), Probe::linear(), Probe::phased()]
}

/// Complex samples, re and im interleaved.
fn magnitude(iq: &[f32]) -> Vec<f64> {
    iq.chunks(2)
        .map(|q| f64::from(q[0]).hypot(f64::from(q[1])))
        .collect()
}

/// Magnitude of the analytic signal of `signal`, by a plain DFT: positive frequencies doubled,
/// negative ones zero.
fn hilbert_envelope(signal: &[f64]) -> Vec<f64> {
    let n = signal.len();
    let turn: Vec<(f64, f64)> = (0..n)
        .map(|i| (TAU * i as f64 / n as f64).sin_cos())
        .collect();
    let spectrum: Vec<(f64, f64)> = (0..=n / 2)
        .map(|f| {
            let double = if f == 0 || 2 * f == n { 1.0 } else { 2.0 } / n as f64;
            let (mut re, mut im) = (0.0, 0.0);
            for (i, s) in signal.iter().enumerate() {
                let (sin, cos) = turn[f * i % n];
                re += s * cos;
                im -= s * sin;
            }
            (double * re, double * im)
        })
        .collect();
    (0..n)
        .map(|i| {
            let (mut re, mut im) = (0.0, 0.0);
            for (f, (a, b)) in spectrum.iter().enumerate() {
                let (sin, cos) = turn[f * i % n];
                re += a * cos - b * sin;
                im += a * sin + b * cos;
            }
            re.hypot(im)
        })
        .collect()
}

/// Radio-frequency line of complex baseband: Re{IQ exp(+i 4 pi f0 z / c)}.
fn remodulate(scene: &Scene, iq: &[f32]) -> Vec<f64> {
    let phase = scene.probe.phase_per_mm() * scene.probe.sample_pitch();
    iq.chunks(2)
        .enumerate()
        .map(|(k, q)| {
            let (sin, cos) = (phase * k as f64).sin_cos();
            f64::from(q[0]) * cos - f64::from(q[1]) * sin
        })
        .collect()
}

/// RMS difference of two envelopes relative to the RMS of the second.
fn relative_rms(a: &[f64], b: &[f64]) -> f64 {
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (difference / b.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

/// Envelope that `detect` saw, from its log-compressed output.
fn undo_log(scene: &Scene, rows: &[layout::Row], log: &[f32]) -> Vec<f64> {
    let imaging = &scene.imaging;
    log.iter()
        .zip(rows)
        .map(|(&v, row)| {
            let level = (f64::from(v) - 1.0) * imaging.dynamic_range - imaging.gain;
            10f64.powf(level / 20.0) / f64::from(row.tgc)
        })
        .collect()
}

/// At fs = 4.5 f0 the envelope of the complex baseband is the Hilbert envelope of the radio
/// frequency signal. 1 % for what of the pulse's spectrum lies below zero and above the Nyquist
/// frequency (4e-4) and for single precision in the logarithm (1e-5 of 240 dB is 0.03 %).
#[test]
fn the_envelope_is_the_hilbert_envelope() {
    let mut scene = scene(Probe {
        depth: 25.0,
        samples: 1024,
        scanlines: 2,
        ..Probe::paper_table1()
    });
    scene.imaging.dynamic_range = 240.0;
    scene.imaging.gain = -80.0; // white is above any echo
    let sampling = scene.probe.speed / (2.0 * scene.probe.sample_pitch());
    assert!(sampling >= 4.0 * scene.probe.frequency);
    let frame = tables::frame(&scene, 0);
    let rows = tables::rows(&scene);
    // Line 0: four isolated points; line 1: dense scatterers. Margins stay dark, for a DFT wraps.
    let mut random = Random(26);
    let mut lateral = vec![0f32; 2 * 2 * 1024];
    let isolated = [120.3, 300.5, 555.0, 800.77].map(|kappa| (0, kappa, 1.0));
    let dense = (0..4000).map(|_| (1, 100.0 + 800.0 * random.uniform(), random.gaussian()));
    for (line, kappa, amplitude) in isolated.into_iter().chain(dense.collect::<Vec<_>>()) {
        let f = kappa - f64::floor(kappa);
        let phase = scene.probe.phase_per_mm() * scene.probe.sample_pitch() * kappa;
        let (sin, cos) = phase.sin_cos();
        let at = 2 * (line * 1024 + kappa as usize);
        for (i, v) in [(1.0 - f) * cos, -(1.0 - f) * sin, f * cos, -f * sin]
            .into_iter()
            .enumerate()
        {
            lateral[at + i] += (amplitude * v) as f32;
        }
    }
    let device = Stages::new();
    let iq = device.axial(&frame, &lateral);
    let log = device.detect(&frame, &rows, &iq);
    for line in 0..2 {
        let own = &iq[2 * line * 1024..2 * (line + 1) * 1024];
        let hilbert = hilbert_envelope(&remodulate(&scene, own));
        let detected = undo_log(&scene, &rows, &log[line * 1024..(line + 1) * 1024]);
        let error = relative_rms(&detected, &hilbert);
        assert!(error < 0.01, "line {line}: {error}");
        // Planted error: half a sample.
        let shifted: Vec<f64> = hilbert.windows(2).map(|w| (w[0] + w[1]) / 2.0).collect();
        let error = relative_rms(&detected[..1023], &shifted);
        assert!(
            error > 0.01,
            "line {line}: half a sample was not seen: {error}"
        );
        assert!(relative_rms(&magnitude(own), &hilbert) < 0.01);
    }
}

/// Largest departure from the mean over 16 depth ranges, dB, of a log image's mean power.
fn unevenness(scene: &Scene, log: &[f32]) -> f64 {
    let samples = scene.probe.samples as usize;
    let step = samples / 16;
    let levels: Vec<f64> = (0..16)
        .map(|part| {
            let power: f64 = log
                .chunks(samples)
                .flat_map(|line| &line[part * step..(part + 1) * step])
                .map(|&v| 10f64.powf(f64::from(v) * scene.imaging.dynamic_range / 10.0))
                .sum();
            10.0 * power.log10()
        })
        .collect();
    let mean = levels.iter().sum::<f64>() / 16.0;
    levels
        .iter()
        .fold(0.0, |worst, level| f64::max(worst, (level - mean).abs()))
}

/// Speckle that decays as homogeneous tissue does is flat after the matched TGC, from the
/// accumulators to the log image. 0.5 dB; the means over about 7000 speckles vary by 0.05 dB.
#[test]
fn homogeneous_tissue_is_flat_after_matched_gain() {
    for probe in every_kind() {
        let mut scene = scene(probe);
        scene.imaging.noise = f64::NEG_INFINITY;
        scene.imaging.tgc_limit = 120.0;
        scene.imaging.dynamic_range = 120.0;
        scene.imaging.gain = 0.0;
        let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
        let attenuation = scene.tissues[0].absorption(scene.probe.frequency);
        let samples = scene.probe.samples as usize;
        let mut random = Random(27);
        let volume: Vec<i32> = (0..scene.probe.scanlines as usize * samples)
            .flat_map(|i| {
                let row = &rows[i % samples];
                let z = (i % samples) as f64 * scene.probe.sample_pitch();
                // Two-way amplitude is the one-way intensity weight exp(-absorption z).
                let echo = 3e-3
                    * (-attenuation * z).exp()
                    * f64::from(row.compensation)
                    * f64::from(frame.volume_scale);
                [(); 2].map(|()| (echo * random.gaussian()).round() as i32)
            })
            .collect();
        let surface = vec![0; volume.len()];
        let device = Stages::new();
        let (lateral, saturated) = device.beam(&frame, &rows, &surface, &volume);
        assert_eq!(saturated, 0);
        let iq = device.axial(&frame, &lateral);
        let log = device.detect(&frame, &rows, &iq);
        let worst = unevenness(&scene, &log);
        assert!(worst < 0.5, "{:?}: {worst} dB", scene.probe.kind);
        // Planted error: a TGC for the way down only.
        let one_way: Vec<layout::Row> = rows
            .iter()
            .map(|row| layout::Row {
                tgc: row.tgc.sqrt(),
                ..*row
            })
            .collect();
        let worst = unevenness(&scene, &device.detect(&frame, &one_way, &iq));
        assert!(worst > 5.0, "one-way compensation was not seen: {worst} dB");
    }
}

/// Smooth brightness over depth (mm) and position across the face (-1/2 .. 1/2): curved so
/// strongly that half a sample (0.01-0.03 mm) and half a line change it by more than the 1e-3
/// allowed, and so little that bilinear interpolation errs by less than 3e-4.
fn brightness(probe: &Probe, depth: f64, across: f64) -> f64 {
    let sample = probe.sample_pitch();
    0.5 + 0.25 * (depth * 0.05 / sample).sin() + 0.2 * (across * 12.0).cos()
}

struct Conversion {
    /// Share of pixels that no value within 1e-3 of the exact one explains.
    wrong: f64,
    /// Area of the opaque pixels, mm^2.
    area: f64,
}

/// Compares pixels with the exact brightness, moved by `shift` samples and lines.
fn compare(scene: &Scene, frame: &layout::Frame, pixels: &[u32], shift: [f64; 2]) -> Conversion {
    let probe = &scene.probe;
    let pitch = f64::from(frame.pixel_pitch);
    let lines = f64::from(probe.scanlines);
    let (mut inside, mut checked, mut wrong) = (0u32, 0u32, 0u32);
    for j in 0..frame.image_height {
        for i in 0..frame.image_width {
            let pixel = pixels[(j * frame.image_width + i) as usize];
            if pixel >> 24 == 0 {
                assert_eq!(pixel, 0, "outside the sector is transparent black");
                continue;
            }
            inside += 1;
            let x = f64::from(frame.image_left) + (f64::from(i) + 0.5) * pitch;
            let z = f64::from(frame.image_top) + (f64::from(j) + 0.5) * pitch;
            let (depth, across) = match probe.kind {
                Kind::Convex {
                    radius,
                    field_of_view,
                } => (
                    x.hypot(z + radius) - radius,
                    x.atan2(z + radius) / field_of_view,
                ),
                Kind::Phased { field_of_view } => (x.hypot(z), x.atan2(z) / field_of_view),
                Kind::Linear { width } => (z, x / width),
            };
            // The outer half lines and the last sample are clamped, not interpolated.
            let (column, row) = ((across + 0.5) * lines - 0.5, depth / probe.sample_pitch());
            if column < 0.0 || column > lines - 1.0 || row > f64::from(probe.samples - 1) {
                continue;
            }
            checked += 1;
            let v = brightness(
                probe,
                depth + shift[0] * probe.sample_pitch(),
                across + shift[1] / lines,
            );
            let grey = |v: f64| (v * 255.0 + 0.5).floor() as u32;
            let level = pixel & 0xff;
            wrong += u32::from(level < grey(v - 1e-3) || level > grey(v + 1e-3));
        }
    }
    Conversion {
        wrong: f64::from(wrong) / f64::from(checked),
        area: f64::from(inside) * pitch * pitch,
    }
}

/// Scan conversion of a smooth function within 1e-3 at every pixel, and the sector's area
/// within 0.5 % (pixels at its edge count whole or not at all).
#[test]
fn scan_conversion_is_exact_for_every_probe() {
    let device = Stages::new();
    for probe in every_kind() {
        let scene = scene(probe);
        let probe = &scene.probe;
        let frame = tables::frame(&scene, 0);
        let log: Vec<f32> = (0..probe.scanlines)
            .flat_map(|l| (0..probe.samples).map(move |k| (l, k)))
            .map(|(l, k)| {
                let across = (f64::from(l) + 0.5) / f64::from(probe.scanlines) - 0.5;
                brightness(probe, f64::from(k) * probe.sample_pitch(), across) as f32
            })
            .collect();
        let grey: Vec<u32> = (0..256).collect();
        let pixels = device.display(&frame, &log, &grey);
        let exact = compare(&scene, &frame, &pixels, [0.0, 0.0]);
        assert_eq!(exact.wrong, 0.0, "{:?}", probe.kind);
        let area = match probe.kind {
            Kind::Convex {
                radius,
                field_of_view,
            } => field_of_view / 2.0 * ((radius + probe.depth).powi(2) - radius * radius),
            Kind::Phased { field_of_view } => field_of_view / 2.0 * probe.depth.powi(2),
            Kind::Linear { width } => width * probe.depth,
        };
        assert!(
            (exact.area / area - 1.0).abs() < 0.005,
            "{} {area}",
            exact.area
        );
        // Planted errors: half a sample, half a line.
        for shift in [[0.5, 0.0], [0.0, 0.5]] {
            let moved = compare(&scene, &frame, &pixels, shift);
            assert!(
                moved.wrong > 0.2,
                "{:?} {shift:?}: {}",
                probe.kind,
                moved.wrong
            );
        }
    }
}

/// The accumulators' end is reported once per sample, whichever of its four numbers reached it.
#[test]
fn saturation_is_counted() {
    let scene = scene(Probe {
        scanlines: 3,
        samples: 50,
        ..Probe::linear()
    });
    let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
    let (mut surface, mut volume) = (vec![0; 300], vec![0; 300]);
    surface[0] = 1 << 30;
    volume[1] = i32::MIN;
    volume[299] = -(1 << 30);
    volume[100] = (1 << 30) - 1;
    let (_, saturated) = Stages::new().beam(&frame, &rows, &surface, &volume);
    assert_eq!(saturated, 2);
}

/// What the log image must be at the ends of the envelope's range.
#[test]
fn detection_of_nothing_and_of_everything() {
    let scene = scene(Probe {
        scanlines: 1,
        samples: 4,
        ..Probe::linear()
    });
    let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
    let iq = [0.0, 0.0, 1e9, 0.0, f32::NAN, 0.0, f32::INFINITY, 0.0];
    let log = Stages::new().detect(&frame, &rows, &iq);
    assert_eq!(log, [0.0, 1.0, 0.0, 1.0]);
}
