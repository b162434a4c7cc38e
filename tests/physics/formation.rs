//! Image formation alone, kernel by kernel on the device: envelope and time-gain compensation.

use insonify::probe::Probe;
use insonify::scene::Scene;
use insonify::sim::calibration::lateral_taps;
use insonify::sim::{layout, tables};

use crate::common::signal::{Random, scene};
use crate::physics::check::{Bench, Check, Curve, Outcome, Physics, Plot};
use crate::physics::hilbert::envelope;
use crate::physics::stages::{Stages, every_kind};

/// Radio-frequency scanline of complex baseband: Re{IQ exp(+i 4 pi f0 z / c)}.
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

/// Envelope in `detect`, from its log-compressed output.
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

/// Check T26.
pub fn detection_shows_the_hilbert_envelope() -> Check {
    Check {
        row: "T26",
        name: "detection_shows_the_hilbert_envelope",
        claim: "At fs = 4.5 f0 the envelope that the kernels detect is that of the radio-frequency \
            line, Re{IQ exp(i 4 pi f0 z / c)}, by the Hilbert transform: isolated points and fully \
            developed speckle. 1 % RMS for what of the pulse's spectrum lies below zero and above the \
            Nyquist frequency (4e-4) and for single precision in the logarithm (1e-5 of 240 dB is \
            0.03 %).",
        planted: "Half a sample between the two.",
        run: detected_envelopes,
    }
}

/// Two scanlines of 1024 baseband samples: four isolated points; dense scatterers. Margins stay dark, because a
/// discrete Fourier transform wraps.
fn two_lines(scene: &Scene) -> Vec<f32> {
    let mut random = Random(26);
    let mut lateral = vec![0f32; 2 * 2 * 1024];
    let isolated = [120.3, 300.5, 555.0, 800.77].map(|kappa| (0, kappa, 1.0));
    let dense = (0..4000).map(|_| (1, 100.0 + 800.0 * random.uniform(), random.gaussian()));
    for (line, kappa, amplitude) in isolated.into_iter().chain(dense.collect::<Vec<_>>()) {
        let f = kappa - f64::floor(kappa);
        let phase = scene.probe.phase_per_mm() * scene.probe.sample_pitch() * kappa;
        let (sin, cos) = phase.sin_cos();
        let at = 2 * (line * 1024 + kappa as usize);
        for (i, v) in [(1.0 - f) * cos, -(1.0 - f) * sin, f * cos, -f * sin].into_iter().enumerate()
        {
            lateral[at + i] += (amplitude * v) as f32;
        }
    }
    lateral
}

fn detected_envelopes(bench: &Bench, physics: Physics) -> Outcome {
    let mut scene =
        scene(Probe { depth: 25.0, samples: 1024, scanlines: 2, ..Probe::paper_table1() });
    scene.imaging.dynamic_range = 240.0;
    scene.imaging.gain = -80.0; // white is above any echo
    let mut out = Outcome::default();
    let sampling = scene.probe.speed / (2.0 * scene.probe.sample_pitch());
    out.compare(
        "sampling frequency, of the carrier's",
        sampling / scene.probe.frequency,
        4.5,
        0.01,
    )
    .unlike("depth as the way there and back", 9.0);
    let (frame, rows) = (tables::frame(&scene, 0), tables::rows(&scene));
    let stages = Stages::new(&bench.device);
    let iq = stages.axial(&frame, &two_lines(&scene));
    let log = stages.detect(&frame, &rows, &iq);
    for (line, what) in ["points", "speckle"].into_iter().enumerate() {
        let own = &iq[2 * line * 1024..2 * (line + 1) * 1024];
        let mut hilbert = envelope(&remodulate(&scene, own));
        if physics == Physics::Planted {
            hilbert = hilbert.windows(2).map(|w| (w[0] + w[1]) / 2.0).collect();
        }
        let n = hilbert.len();
        let detected = undo_log(&scene, &rows, &log[line * 1024..line * 1024 + n]);
        let magnitude: Vec<f64> =
            own[..2 * n].chunks(2).map(|q| f64::from(q[0]).hypot(f64::from(q[1]))).collect();
        for (stage, got) in [("detect", &detected), ("axial", &magnitude)] {
            let what = format!("{stage}: RMS difference for {what}");
            out.compare(what, relative_rms(got, &hilbert), 0.0, 0.01);
        }
        let shown = |v: &[f64]| (500..620).map(|k| [k as f64, v[k]]).collect();
        out.plots.push(Plot::linear(
            format!("Envelope of {what}"),
            ["sample", "envelope"],
            vec![
                Curve::line("Hilbert transform", shown(&hilbert)),
                Curve::dots("detect, without its logarithm", shown(&detected)),
            ],
        ));
    }
    out
}

/// Mean power of a log image in 16 ranges of depth, dB from their mean.
fn levels(scene: &Scene, log: &[f32]) -> Vec<f64> {
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
    levels.iter().map(|level| level - mean).collect()
}

/// Check T27.
pub fn matched_gain_makes_decaying_speckle_flat_for_every_probe() -> Check {
    Check {
        row: "T27",
        name: "matched_gain_makes_decaying_speckle_flat_for_every_probe",
        claim: "Speckle that decays as homogeneous tissue does, exp(-absorption z) of two-way \
            amplitude, is flat after matched compensation, from the accumulators to the log image: \
            within 0.5 dB; the means over about 7000 speckles vary by 0.05 dB.",
        planted: "A compensation for the way down only.",
        run: matched_gain,
    }
}

/// Accumulated volume echoes of speckle that decays with depth.
fn decaying(scene: &Scene, frame: &layout::Frame, rows: &[layout::Row]) -> Vec<i32> {
    let attenuation = scene.tissues[0].absorption(scene.probe.frequency);
    let samples = scene.probe.samples as usize;
    let mut random = Random(27);
    (0..scene.probe.scanlines as usize * samples)
        .flat_map(|i| {
            let row = &rows[i % samples];
            let z = (i % samples) as f64 * scene.probe.sample_pitch();
            // What a line hears itself, of which smoothing over lines makes as much as there is; the two-way amplitude is
            // the one-way intensity weight exp(-absorption z).
            let taps = lateral_taps(f64::from(row.strip_lines));
            let own = (1.0 + 2.0 * taps[1..].iter().map(|w| w * w).sum::<f64>()).sqrt().recip();
            let echo = 3e-3
                * own
                * (-attenuation * z).exp()
                * f64::from(row.compensation)
                * f64::from(frame.volume_scale);
            [(); 2].map(|()| (echo * random.gaussian()).round() as i32)
        })
        .collect()
}

fn matched_gain(bench: &Bench, physics: Physics) -> Outcome {
    let stages = Stages::new(&bench.device);
    let mut out = Outcome::default();
    let mut curves = vec![Curve::line("flat", vec![[0.0, 0.0], [16.0, 0.0]])];
    for (name, probe) in every_kind() {
        let mut scene = scene(probe);
        scene.imaging.noise = f64::NEG_INFINITY;
        scene.imaging.tgc_limit = 120.0;
        scene.imaging.dynamic_range = 120.0;
        scene.imaging.gain = 0.0;
        let (frame, mut rows) = (tables::frame(&scene, 0), tables::rows(&scene));
        let volume = decaying(&scene, &frame, &rows);
        let surface = vec![0; volume.len()];
        let (lateral, saturated) = stages.beam(&frame, &rows, &surface, &volume);
        assert_eq!(saturated, 0, "{name}: echoes fit the fixed point");
        let iq = stages.axial(&frame, &lateral);
        if physics == Physics::Planted {
            rows.iter_mut().for_each(|row| row.tgc = row.tgc.sqrt());
        }
        let levels = levels(&scene, &stages.detect(&frame, &rows, &iq));
        let worst = levels.iter().fold(0.0, |w, d| f64::max(w, d.abs()));
        let what = format!("{name}: largest departure from the mean, dB");
        out.compare(what, worst, 0.0, 0.5);
        let places = (0..16).map(|i| f64::from(i) + 0.5);
        curves.push(Curve::dots(name, places.zip(levels).map(|(x, d)| [x, d]).collect()));
    }
    out.plots.push(Plot::linear(
        "Mean power of decaying speckle",
        ["depth, sixteenths of the range", "from the mean, dB"],
        curves,
    ));
    out
}
