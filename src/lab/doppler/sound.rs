//! What flows, to be heard: a gate's echoes as stereo sound.

use std::io::{Seek, Write};

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::gate::WallFilter;
use super::spectrum::lowest;
use crate::settings::Spectral;

/// Samples per second of a sound, which every player takes.
pub const RATE: u32 = 48_000;
/// Largest amplitude of a sound file; 1 is what it can hold.
const LOUDEST: f64 = 0.9;
/// Time in which a sound begins and ends, s: a sudden one clicks.
const FADE: f64 = 0.005;

/// The sound of a gate's echoes: for each of [`RATE`] samples a second what comes towards the probe (left) and what goes away
/// (right), the other way round with `invert`, in the unit of the echoes. What lies below the wall filter is not heard. The
/// pitch is the Doppler frequency; `baseline` says, as in the spectra, up to which one towards the probe and from which one
/// away from it.
pub fn sound(spectral: &Spectral, echoes: &[Complex<f64>]) -> Vec<[f64; 2]> {
    let pulses = echoes.len();
    let samples = (pulses as f64 / spectral.prf * f64::from(RATE)).round() as usize;
    if samples < 2 {
        return Vec::new();
    }
    let mut filter = WallFilter::new(spectral.wall_filter, spectral.prf);
    let mut spectrum: Vec<Complex<f64>> = echoes.iter().map(|&echo| filter.next(echo)).collect();
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(pulses).process(&mut spectrum);
    // From the lowest frequency on, in which each occurs once: what is between is interpolated as band limits say.
    let lowest = lowest(spectral, pulses);
    let back = planner.plan_fft_inverse(samples);
    let direction = |is_heard: &dyn Fn(i64) -> bool| -> Vec<f64> {
        let mut bins = vec![Complex::default(); samples];
        for k in (lowest..lowest + pulses as i64).filter(|k| is_heard(*k)) {
            // Higher ones than the sound can hold are left out.
            if 2 * k.unsigned_abs() < samples as u64 {
                let from = k.rem_euclid(pulses as i64) as usize;
                bins[k.rem_euclid(samples as i64) as usize] = spectrum[from] / pulses as f64;
            }
        }
        back.process(&mut bins);
        bins.iter().map(|value| value.re).collect()
    };
    let [towards, away] = [direction(&|k| k > 0), direction(&|k| k < 0)];
    let fade = (FADE * f64::from(RATE)).min(samples as f64 / 2.0);
    let faded = |n: usize| ((n.min(samples - 1 - n) as f64 + 0.5) / fade).min(1.0);
    let both = towards.into_iter().zip(away).enumerate();
    both.map(|(n, (towards, away))| {
        let sides = if spectral.invert { [away, towards] } else { [towards, away] };
        sides.map(|side| side * faded(n))
    })
    .collect()
}

/// Writes a sound as a WAV file of 16 bits, as loud as that holds.
///
/// # Errors
/// An error of the file.
pub fn write_wav(to: impl Write + Seek, sound: &[[f64; 2]]) -> Result<(), hound::Error> {
    let most = sound.as_flattened().iter().fold(0.0, |most, value| f64::max(most, value.abs()));
    let scale = if most > 0.0 { LOUDEST / most * f64::from(i16::MAX) } else { 0.0 };
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: RATE,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::new(to, spec)?;
    for value in sound.as_flattened() {
        writer.write_sample((value * scale).round() as i16)?;
    }
    writer.finalize()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::io::Cursor;

    use super::*;

    /// Echoes of a second of what turns so often a second, forwards above 0.
    fn turning(prf: f64, hz: f64) -> Vec<Complex<f64>> {
        (0..prf as usize).map(|n| Complex::from_polar(2.0, TAU * hz * n as f64 / prf)).collect()
    }

    fn powers(sound: &[[f64; 2]]) -> [f64; 2] {
        let sum = |side: usize| sound.iter().map(|sides| sides[side].powi(2)).sum::<f64>();
        [0, 1].map(|side| sum(side) / sound.len() as f64)
    }

    /// Mean frequency of one side, by its passages through zero.
    fn pitch(sound: &[[f64; 2]], side: usize) -> f64 {
        let passages = sound.windows(2).filter(|two| two[0][side] < 0.0 && two[1][side] >= 0.0);
        passages.count() as f64 / sound.len() as f64 * f64::from(RATE)
    }

    #[test]
    fn what_comes_is_on_the_left_and_what_goes_on_the_right_at_its_frequency() {
        let spectral = Spectral { prf: 5000.0, wall_filter: 0.0, ..Spectral::default() };
        for (hz, invert, side) in
            [(700.0, false, 0), (-700.0, false, 1), (700.0, true, 1), (-1900.0, true, 0)]
        {
            let spectral = Spectral { invert, ..spectral.clone() };
            let sound = sound(&spectral, &turning(5000.0, hz));
            assert_eq!(sound.len(), 48_000);
            let powers = powers(&sound);
            // Amplitude 2, but for 5 ms of fading at both ends.
            assert!((powers[side] - 2.0).abs() < 0.03, "{hz} {powers:?}");
            assert!(powers[1 - side] < 1e-12, "{hz} {powers:?}");
            assert!((pitch(&sound, side) - hz.abs()).abs() < 2.0, "{hz}");
        }
    }

    #[test]
    fn a_shifted_baseline_hears_what_would_have_folded_over() {
        let spectral =
            Spectral { prf: 5000.0, wall_filter: 0.0, baseline: 0.6, ..Spectral::default() };
        let folded = turning(5000.0, 3200.0);
        let heard = sound(&spectral, &folded);
        assert!((pitch(&heard, 0) - 3200.0).abs() < 2.0 && powers(&heard)[1] < 1e-12);
        let heard = sound(&Spectral { baseline: 0.0, ..spectral }, &folded);
        assert!((pitch(&heard, 1) - 1800.0).abs() < 2.0 && powers(&heard)[0] < 1e-12);
    }

    #[test]
    fn tissue_is_not_heard() {
        let spectral = Spectral { prf: 5000.0, wall_filter: 100.0, ..Spectral::default() };
        let still: Vec<Complex<f64>> = vec![Complex::new(50.0, -20.0); 5000];
        assert!(powers(&sound(&spectral, &still)).iter().all(|power| *power < 1e-9));
        assert!(sound(&spectral, &[]).is_empty());
    }

    #[test]
    fn files_are_as_loud_as_they_can_be() {
        let mut file = Cursor::new(Vec::new());
        write_wav(&mut file, &[[0.0, 0.01], [-0.02, 0.005]]).expect("memory");
        let mut reader = hound::WavReader::new(Cursor::new(file.into_inner())).expect("a WAV");
        assert_eq!((reader.spec().channels, reader.spec().sample_rate), (2, RATE));
        let samples: Vec<i16> = reader.samples().map(|s| s.expect("a sample")).collect();
        assert_eq!(samples, [0, 14745, -29490, 7373]);
        let mut file = Cursor::new(Vec::new());
        write_wav(&mut file, &[[0.0; 2]; 3]).expect("silence");
    }
}
