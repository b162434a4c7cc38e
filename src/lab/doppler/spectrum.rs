//! Spectra of a gate's echoes against time.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::gate::WallFilter;
use super::nyquist;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::settings::Spectral;
use crate::sim::calibration::Calibration;

/// Fewest bins of a spectrum.
const FEWEST_BINS: usize = 256;

/// Spectra as they come: a bin for each frequency, from 0 up to half of the PRF, then from below that up to 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectra {
    /// Time of the middle of each, s.
    pub times: Vec<f64>,
    /// Power of each bin of each spectrum, bins of a spectrum next to each other. White noise has its own power.
    pub power: Vec<f32>,
}

impl Spectra {
    /// The bins of each in turn, of spectra with these settings.
    pub fn columns(&self, spectral: &Spectral) -> impl ExactSizeIterator<Item = &[f32]> {
        self.power.chunks_exact(bins(spectral))
    }

    /// The spectra with a velocity for each bin, as settings show them: `baseline`, `invert` and `angle` may be others than those
    /// with which they were made.
    pub fn shown(&self, probe: &Probe, spectral: &Spectral) -> Spectrogram {
        let bins = bins(spectral);
        let lowest = lowest(spectral, bins);
        let fastest = nyquist(probe, spectral.prf) / spectral.angle.cos();
        let velocity = |j: usize| 2.0 * fastest * (lowest + j as i64) as f64 / bins as f64;
        let mut velocities: Vec<f64> = (0..bins).map(velocity).collect();
        let first = lowest.rem_euclid(bins as i64) as usize;
        let mut power = Vec::with_capacity(self.power.len());
        for column in self.columns(spectral) {
            let rising = (0..bins).map(|j| column[(j + first) % bins]);
            match spectral.invert {
                true => power.extend(rising.rev()),
                false => power.extend(rising),
            }
        }
        if spectral.invert {
            velocities.reverse();
            velocities.iter_mut().for_each(|v| *v = -*v);
        }
        Spectrogram { velocities, times: self.times.clone(), power }
    }
}

/// Number of the lowest frequency that is told apart, of `bins` that are as many parts of the PRF: what lies below folds over.
pub(super) fn lowest(spectral: &Spectral, bins: usize) -> i64 {
    // The middle of what is shown lies so many bins above that of frequencies.
    let up = if spectral.invert { -spectral.baseline } else { spectral.baseline };
    (up / 2.0 * bins as f64).round() as i64 - (bins / 2) as i64
}

/// Pulses of one spectrum.
pub fn pulses(spectral: &Spectral) -> usize {
    (spectral.window * spectral.prf).round().max(2.0) as usize
}

/// Bins of one spectrum.
pub fn bins(spectral: &Spectral) -> usize {
    (2 * pulses(spectral)).next_power_of_two().max(FEWEST_BINS)
}

/// Spectra against time, with their velocities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrogram {
    /// Velocity of each bin, mm/s, corrected for the angle, rising; above 0 what comes towards the probe, or, inverted, what goes.
    pub velocities: Vec<f64>,
    /// Time of the middle of each spectrum, s from the first pulse.
    pub times: Vec<f64>,
    /// Power of each bin of each spectrum, bins of a spectrum next to each other. White noise has its own power.
    pub power: Vec<f32>,
}

impl Spectrogram {
    /// The bins of each spectrum in turn.
    pub fn columns(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.power.chunks_exact(self.velocities.len())
    }

    /// Velocity from one bin to the next, mm/s.
    pub fn step(&self) -> f64 {
        self.velocities[1] - self.velocities[0]
    }
}

/// Makes spectra of echoes as they come.
pub struct Analyser {
    filter: WallFilter,
    window: Vec<f64>,
    /// Sum of the window's squares.
    energy: f64,
    fft: Arc<dyn Fft<f64>>,
    bins: usize,
    /// Filtered echoes from the beginning of the next spectrum on.
    waiting: Vec<Complex<f64>>,
    /// Number of the first of them.
    first: usize,
    prf: f64,
    rate: f64,
    /// Number of spectra made.
    count: usize,
    made: Spectra,
}

impl Analyser {
    /// An analyser with these settings.
    pub fn new(spectral: &Spectral) -> Self {
        let length = pulses(spectral);
        // Hann's window.
        let window: Vec<f64> = (0..length)
            .map(|n| 0.5 - 0.5 * (TAU * (n as f64 + 0.5) / length as f64).cos())
            .collect();
        let bins = bins(spectral);
        Self {
            filter: WallFilter::new(spectral.wall_filter, spectral.prf),
            energy: window.iter().map(|w| w * w).sum(),
            window,
            fft: FftPlanner::new().plan_fft_forward(bins),
            bins,
            waiting: Vec::new(),
            first: 0,
            prf: spectral.prf,
            rate: spectral.columns,
            count: 0,
            made: Spectra::default(),
        }
    }

    /// Adds echoes behind those that it has, and makes the spectra that these fill.
    pub fn add(&mut self, echoes: &[Complex<f64>]) {
        self.waiting.extend(echoes.iter().map(|&echo| self.filter.next(echo)));
        loop {
            let begin = self.next();
            let from = begin - self.first;
            if from + self.window.len() > self.waiting.len() {
                break;
            }
            self.spectrum(from);
            let middle = begin as f64 + (self.window.len() as f64 - 1.0) / 2.0;
            self.made.times.push(middle / self.prf);
            self.count += 1;
        }
        let done = (self.next() - self.first).min(self.waiting.len());
        self.waiting.drain(..done);
        self.first += done;
    }

    /// Number of the first echo of the next spectrum.
    fn next(&self) -> usize {
        (self.count as f64 / self.rate * self.prf).round() as usize
    }

    /// Adds the spectrum of the waiting echoes from one on.
    fn spectrum(&mut self, from: usize) {
        let own = self.waiting[from..].iter().zip(&self.window).map(|(echo, weight)| echo * weight);
        let mut values: Vec<Complex<f64>> = own.collect();
        values.resize(self.bins, Complex::default());
        self.fft.process(&mut values);
        self.made.power.extend(values.iter().map(|v| (v.norm_sqr() / self.energy) as f32));
    }

    /// Takes the spectra made since the last call; times are from the first echo. Those made later follow them.
    pub fn take(&mut self) -> Spectra {
        std::mem::take(&mut self.made)
    }
}

/// Gain of the image where the gate of a scene lies, dB: what [`greys`] takes.
pub fn image_gain(scene: &Scene) -> f64 {
    let calibration = Calibration::new(scene);
    calibration.tgc_db(scene.spectral.depth) + 20.0 * calibration.display_gain().log10()
}

/// Grey levels of spectra, 0 to 255: a row for each bin, the highest velocity on top, a column for each spectrum. White has the
/// level of the image's white with `spectral.gain`; `undone` is the gain of the image where the gate lies, dB.
pub fn greys(spectral: &Spectral, made: &Spectrogram, undone: f64) -> Vec<u8> {
    let (width, height) = (made.times.len(), made.velocities.len());
    let mut out = vec![0; width * height];
    for (x, column) in made.columns().enumerate() {
        for (j, &power) in column.iter().enumerate() {
            let level = 10.0 * f64::from(power).max(1e-30).log10() + undone + spectral.gain;
            let grey = 255.0 * (1.0 + level / spectral.dynamic_range).clamp(0.0, 1.0);
            out[(height - 1 - j) * width + x] = grey.round() as u8;
        }
    }
    out
}

#[cfg(test)]
mod tests;
