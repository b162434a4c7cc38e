use std::f64::consts::PI;

use super::*;
use crate::doppler::broadening::Broadening;
use crate::doppler::trace::{measure, trace};
use crate::settings::Wave;

const PRF: f64 = 4000.0;

/// Settings of a probe of 5 MHz, where a velocity turns echoes by 2 v / 0.308 mm a second.
fn settings() -> (Probe, Spectral) {
    let probe = Probe { frequency: 5.0, speed: 1.54, ..Probe::linear() };
    (probe, Spectral { prf: PRF, wall_filter: 0.0, ..Spectral::default() })
}

/// Hz of a velocity, mm/s.
fn shift(v: f64) -> f64 {
    2.0 * v * 5e6 / 1.54e6
}

/// Echoes of what moves towards the probe by `velocity`, mm/s at a time, s.
fn moving(velocity: impl Fn(f64) -> f64, seconds: f64) -> Vec<Complex<f64>> {
    let mut turns = 0.0;
    (0..(seconds * PRF) as usize)
        .map(|n| {
            turns += shift(velocity(n as f64 / PRF)) / PRF;
            Complex::from_polar(1.0, TAU * turns)
        })
        .collect()
}

/// SplitMix64 (Steele, Lea, Flood 2014), 0 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn made(spectral: &Spectral, echoes: &[Complex<f64>]) -> Spectrogram {
    let mut analyser = Analyser::new(spectral);
    analyser.add(echoes);
    analyser.take().shown(&settings().0, spectral)
}

/// Lines as wide as Hann's window makes them, of scatterers that cross no beam.
fn lines(spectral: &Spectral) -> Broadening {
    // A wave without an end crosses nothing where there is no angle.
    let wide = Spectral { wave: Wave::Continuous, ..spectral.clone() };
    let lines = Broadening::of(&settings().0, [1.0; 3], &wide);
    assert!(lines.transit == 0.0 && lines.window > 0.0, "{lines:?}");
    lines
}

/// Velocity of the loudest bin of each spectrum.
fn peaks(made: &Spectrogram) -> Vec<f64> {
    let loudest = |column: &[f32]| {
        (0..column.len()).max_by(|&a, &b| column[a].total_cmp(&column[b])).expect("bins")
    };
    made.columns().map(|column| made.velocities[loudest(column)]).collect()
}

/// |H|^2 = 1 / (1 + (tan(pi fc / PRF) / tan(pi f / PRF))^4): a Butterworth filter behind the bilinear transform.
#[test]
fn the_wall_filter_has_butterworths_gain_and_takes_off_what_stands_still() {
    for (cut, frequency) in [(100.0, 50.0), (100.0, 100.0), (100.0, 300.0), (300.0, 200.0)] {
        let mut filter = WallFilter::new(cut, PRF);
        let at = |n: usize| Complex::from_polar(1.0, TAU * frequency * n as f64 / PRF);
        let out: Vec<f64> = (0..6000).map(|n| filter.next(at(n)).norm_sqr()).collect();
        let tangent = |f: f64| (PI * f / PRF).tan();
        let expected = 1.0 / (1.0 + (tangent(cut) / tangent(frequency)).powi(4));
        let settled = out[5000..].iter().sum::<f64>() / 1000.0;
        assert!((settled - expected).abs() < 1e-6, "{cut} {frequency}: {settled} {expected}");
    }
    let mut filter = WallFilter::new(100.0, PRF);
    let still = Complex::new(1e6, -2e5);
    assert!((0..1000).all(|_| filter.next(still).norm() < 1e-6), "from the first pulse on");
    let mut none = WallFilter::new(0.0, PRF);
    assert_eq!(none.next(still), still);
}

#[test]
fn a_velocity_stands_in_its_bin_folded_over_beyond_what_is_shown() {
    let (probe, spectral) = settings();
    let fastest = nyquist(&probe, PRF);
    let angle = 1.0_f64;
    for (v, change, expected) in [
        (100.0, spectral.clone(), 100.0),
        (-250.0, spectral.clone(), -250.0),
        (1.2 * fastest, spectral.clone(), -0.8 * fastest),
        // Half of Nyquist's above the middle: up to one and a half.
        (1.2 * fastest, Spectral { baseline: 0.5, ..spectral.clone() }, 1.2 * fastest),
        (-0.7 * fastest, Spectral { baseline: 0.5, ..spectral.clone() }, 1.3 * fastest),
        (100.0, Spectral { invert: true, ..spectral.clone() }, -100.0),
        (
            -1.2 * fastest,
            Spectral { invert: true, baseline: 0.5, ..spectral.clone() },
            1.2 * fastest,
        ),
        (100.0, Spectral { angle, ..spectral.clone() }, 100.0 / angle.cos()),
    ] {
        let made = made(&change, &moving(|_| v, 0.1));
        assert!(made.times.len() > 10 && made.velocities.is_sorted());
        for found in peaks(&made) {
            assert!((found - expected).abs() <= made.step(), "{v}: {found}, {expected}");
        }
    }
}

#[test]
fn noise_keeps_its_power_and_pieces_make_what_the_whole_makes() {
    let (_, spectral) = settings();
    let mut state = 7;
    // Uniform in a square of side 2 sqrt(3): variance 2.
    let mut value = || (random(&mut state) - 0.5) * 2.0 * 3.0_f64.sqrt();
    let echoes: Vec<Complex<f64>> = (0..40_000).map(|_| Complex::new(value(), value())).collect();
    let whole = made(&spectral, &echoes);
    let mean = whole.power.iter().map(|&p| f64::from(p)).sum::<f64>() / whole.power.len() as f64;
    assert!((mean - 2.0).abs() < 0.03, "{mean}");
    let mut analyser = Analyser::new(&spectral);
    for part in echoes.chunks(37) {
        analyser.add(part);
    }
    assert!(analyser.take().shown(&settings().0, &spectral) == whole);
    // The first and the last one lie half a window within.
    let ends = [whole.times[0], 10.0 - whole.times[whole.times.len() - 1]];
    assert!(ends.iter().all(|t| *t >= spectral.window / 2.0 - 1e-3 && *t < 0.012), "{ends:?}");
}

/// A flat spectrum up to a velocity, as a whole lumen with a parabolic profile has, and noise 20 dB below it.
#[test]
fn the_trace_finds_the_end_of_a_flat_spectrum_and_its_mean() {
    let (_, spectral) = settings();
    for fastest in [120.0, 250.0, -180.0] {
        let mut state = 3;
        let tones: Vec<[f64; 2]> =
            (0..800).map(|_| [fastest * random(&mut state), TAU * random(&mut state)]).collect();
        let echoes: Vec<Complex<f64>> = (0..(2.0 * PRF) as usize)
            .map(|n| {
                let time = n as f64 / PRF;
                let tone = |[v, phase]: &[f64; 2]| {
                    Complex::from_polar(1.0, TAU * shift(*v) * time + phase)
                };
                let noise = Complex::new(random(&mut state) - 0.5, random(&mut state) - 0.5);
                tones.iter().map(tone).sum::<Complex<f64>>() + noise * 7.0
            })
            .collect();
        let found = trace(&made(&spectral, &echoes), &lines(&spectral));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (most, middle) = (mean(&found.maximum), mean(&found.mean));
        // In single spectra speckle hides the end: a few percent less.
        assert!((0.9..1.02).contains(&(most / fastest)), "{most} of {fastest}");
        assert!((middle / fastest - 0.5).abs() < 0.03, "{middle} of {fastest}");
    }
    // Noise alone has no velocity.
    let mut state = 5;
    let noise: Vec<Complex<f64>> = (0..8000)
        .map(|_| Complex::new(random(&mut state) - 0.5, random(&mut state) - 0.5))
        .collect();
    let found = trace(&made(&spectral, &noise), &lines(&spectral));
    let heard = found.maximum.iter().filter(|v| **v != 0.0).count();
    assert!(heard * 50 < found.maximum.len(), "{heard} of {}", found.maximum.len());
}

/// Beats of 0.8 s: from 60 mm/s up to 240 within 0.08 s, and down again within 0.32.
fn beat(time: f64) -> f64 {
    let at = time.rem_euclid(0.8);
    match at {
        _ if at < 0.08 => 60.0 + 180.0 * at / 0.08,
        _ if at < 0.4 => 240.0 - 180.0 * (at - 0.08) / 0.32,
        _ => 60.0,
    }
}

#[test]
fn beats_are_measured() {
    let (_, spectral) = settings();
    let lines = lines(&spectral);
    let steady = made(&spectral, &moving(|_| 150.0, 3.0));
    // What the width of a line adds to the maximum of one velocity is taken off; it is there where nobody knows of it.
    let mean = |lines: &Broadening| {
        let found = trace(&steady, lines).maximum;
        found.iter().sum::<f64>() / found.len() as f64
    };
    let beyond = mean(&Broadening::default()) - 150.0;
    assert!((2.0..16.0).contains(&beyond), "{beyond}");
    // Hann's line is no Gaussian: a part stays.
    let wide = mean(&lines) - 150.0;
    assert!(wide.abs() < beyond / 2.0, "{wide} {beyond}");
    let found = trace(&steady, &lines);
    for sign in [1.0, -1.0] {
        let made = made(&spectral, &moving(|t| sign * beat(t + 0.3), 4.0));
        let found = measure(&made.times, &trace(&made, &lines)).expect("beats");
        assert_eq!(found.beats, 4);
        let close = |value: f64, expected: f64, share: f64| {
            assert!((value / expected - 1.0).abs() < share, "{value} {expected}: {found:?}");
        };
        close(found.beat_s, 0.8, 0.02);
        // The window and the average over spectra blunt the peak.
        close(found.psv_mm_per_s, 240.0 + wide, 0.04);
        close(found.edv_mm_per_s, 60.0 + wide, 0.04);
        close(found.vti_mm, 0.8 * (60.0 + wide) + 180.0 * 0.2, 0.03);
        close(found.ta_mean_mm_per_s, 105.0, 0.01);
        close(found.acceleration_time_s, 0.08, 0.2);
        close(found.ri, 180.0 / (240.0 + wide), 0.05);
        close(found.pi, 180.0 / (105.0 + wide), 0.05);
    }
    assert_eq!(measure(&steady.times, &found), None, "steady");
}

/// The Gaussian that scatterers crossing the beam make: half its weighted mean, its peak over 2 sqrt 2, lies 1.44 deviations
/// above its mean.
#[test]
fn the_edge_of_a_narrow_spectrum_is_where_half_its_mean_is_left() {
    let (_, spectral) = settings();
    let mut state = 11;
    let deviation = 12.0;
    let tones: Vec<[f64; 2]> = (0..2000)
        .map(|_| {
            let normal = (-2.0 * random(&mut state).max(1e-12).ln()).sqrt()
                * (TAU * random(&mut state)).cos();
            [150.0 + deviation * normal, TAU * random(&mut state)]
        })
        .collect();
    let echoes: Vec<Complex<f64>> = (0..(2.0 * PRF) as usize)
        .map(|n| {
            let time = n as f64 / PRF;
            tones
                .iter()
                .map(|[v, phase]| Complex::from_polar(1.0, TAU * shift(*v) * time + phase))
                .sum()
        })
        .collect();
    let spectra = made(&spectral, &echoes);
    let mean = |lines: &Broadening| {
        let found = trace(&spectra, lines).maximum;
        found.iter().sum::<f64>() / found.len() as f64
    };
    let most = mean(&Broadening::default());
    // Hann's window of 12 ms has a deviation of its own of 1 / (sqrt 3 T) Hz, and peaks of speckle lie above the mean.
    let window = 1.54e6 / (2.0 * 5e6) / (3.0_f64.sqrt() * spectral.window);
    let half = 150.0 + (2.0 * (2.0 * 2.0_f64.sqrt()).ln()).sqrt() * deviation.hypot(window);
    assert!((most / half - 1.0).abs() < 0.03, "{most} {half}");
    // Whoever knows the width of a line finds the velocity.
    let corrected = mean(&Broadening { transit: deviation / 150.0, window });
    assert!((corrected / 150.0 - 1.0).abs() < 0.03, "{corrected}");
}
