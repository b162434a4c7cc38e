//! Spectra of a gate's echoes against time.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::gate::WallFilter;
use super::nyquist;
use crate::probe::Probe;
use crate::settings::Spectral;

/// Fewest bins of a spectrum.
const FEWEST_BINS: usize = 256;

/// Spectra against time.
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
    /// Filtered echoes from the beginning of the next spectrum on.
    waiting: Vec<Complex<f64>>,
    /// Number of the first of them.
    first: usize,
    /// Bins by which the lowest velocity lies beside the lowest frequency.
    shift: usize,
    inverted: bool,
    prf: f64,
    rate: f64,
    made: Spectrogram,
}

impl Analyser {
    /// An analyser with these settings, for a probe.
    pub fn new(probe: &Probe, spectral: &Spectral) -> Self {
        let length = (spectral.window * spectral.prf).round().max(2.0) as usize;
        // Hann's window.
        let window: Vec<f64> = (0..length)
            .map(|n| 0.5 - 0.5 * (TAU * (n as f64 + 0.5) / length as f64).cos())
            .collect();
        let bins = (2 * length).next_power_of_two().max(FEWEST_BINS);
        // The middle of what is shown lies so many bins above that of frequencies.
        let up = if spectral.invert { -spectral.baseline } else { spectral.baseline };
        let shift = (up / 2.0 * bins as f64).round();
        let fastest = nyquist(probe, spectral.prf) / spectral.angle.cos();
        let velocity = |j: usize| {
            let bin = j as f64 - (bins / 2) as f64 + shift;
            2.0 * fastest * bin / bins as f64
        };
        let mut velocities: Vec<f64> = (0..bins).map(velocity).collect();
        if spectral.invert {
            velocities.reverse();
            velocities.iter_mut().for_each(|v| *v = -*v);
        }
        let lowest = shift as i64 - (bins / 2) as i64;
        Self {
            filter: WallFilter::new(spectral.wall_filter, spectral.prf),
            energy: window.iter().map(|w| w * w).sum(),
            window,
            fft: FftPlanner::new().plan_fft_forward(bins),
            waiting: Vec::new(),
            first: 0,
            shift: lowest.rem_euclid(bins as i64) as usize,
            inverted: spectral.invert,
            prf: spectral.prf,
            rate: spectral.columns,
            made: Spectrogram { velocities, ..Spectrogram::default() },
        }
    }

    /// Adds echoes behind those that it has, and makes the spectra that these fill.
    pub fn add(&mut self, echoes: &[Complex<f64>]) {
        self.waiting.extend(echoes.iter().map(|&echo| self.filter.next(echo)));
        loop {
            let begin = (self.made.times.len() as f64 / self.rate * self.prf).round() as usize;
            let from = begin - self.first;
            if from + self.window.len() > self.waiting.len() {
                break;
            }
            self.spectrum(from);
            let middle = begin as f64 + (self.window.len() as f64 - 1.0) / 2.0;
            self.made.times.push(middle / self.prf);
        }
        let next = (self.made.times.len() as f64 / self.rate * self.prf).round() as usize;
        let done = (next - self.first).min(self.waiting.len());
        self.waiting.drain(..done);
        self.first += done;
    }

    /// Adds the spectrum of the waiting echoes from one on.
    fn spectrum(&mut self, from: usize) {
        let bins = self.made.velocities.len();
        let own = self.waiting[from..].iter().zip(&self.window).map(|(echo, weight)| echo * weight);
        let mut values: Vec<Complex<f64>> = own.collect();
        values.resize(bins, Complex::default());
        self.fft.process(&mut values);
        let power = |j: usize| {
            let up = if self.inverted { bins - 1 - j } else { j };
            (values[(up + self.shift) % bins].norm_sqr() / self.energy) as f32
        };
        self.made.power.extend((0..bins).map(power));
    }

    /// The spectra made so far.
    pub fn made(&self) -> &Spectrogram {
        &self.made
    }

    /// Takes the spectra made so far; those made later follow them.
    pub fn finish(self) -> Spectrogram {
        self.made
    }
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
