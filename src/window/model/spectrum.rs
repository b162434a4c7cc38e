//! Pulsed-wave Doppler: spectra of the gate's echoes, against time.

use std::collections::VecDeque;

use crate::probe::Probe;
use crate::settings::Spectral;
use insonify_lab::doppler::spectrum::{Spectra, bins};

/// Longest time that is kept, s.
const KEPT: f64 = 20.0;
/// Time by which a spectrum may come before the last one and still belong to the strip, s: spectra that are made one by one lie
/// in the middle of their pulses.
const BACK: f64 = 0.6;

/// Spectra that the simulation has made.
#[derive(Clone, Debug)]
pub struct Heard {
    /// The probe that they were made with.
    pub probe: Probe,
    /// The settings that they were made with.
    pub spectral: Spectral,
    /// Gain of the image where the gate lies, dB.
    pub undone: f64,
    /// The spectra; times of the scene, s.
    pub spectra: Spectra,
}

/// One spectrum at its time.
#[derive(Debug)]
struct Kept {
    seconds: f64,
    power: Vec<f32>,
}

/// The strip of spectra of one gate.
#[derive(Debug, Default)]
pub struct SpectrumStrip {
    /// The probe, and the settings without those that only say how spectra are shown.
    of: Option<(Probe, Spectral)>,
    undone: f64,
    columns: VecDeque<Kept>,
    revision: u64,
}

/// Settings without those that only say how spectra are shown.
fn heard_by(spectral: &Spectral) -> Spectral {
    let Spectral { angle, baseline, invert, gain, dynamic_range, duration, .. } =
        Spectral::default();
    Spectral { angle, baseline, invert, gain, dynamic_range, duration, ..spectral.clone() }
}

impl SpectrumStrip {
    /// Adds spectra. Those of another gate, or of a time before, clear the strip; of the same moment they replace what was there.
    pub fn add(&mut self, heard: &Heard) {
        let of = (heard.probe.clone(), heard_by(&heard.spectral));
        if self.of.as_ref() != Some(&of) {
            self.columns.clear();
            self.of = Some(of);
        }
        self.undone = heard.undone;
        self.revision += 1;
        let times = &heard.spectra.times;
        for (&seconds, power) in times.iter().zip(heard.spectra.columns(&heard.spectral)) {
            match self.columns.back() {
                Some(last) if seconds < last.seconds - BACK => self.columns.clear(),
                _ => while self.columns.pop_back_if(|last| last.seconds >= seconds).is_some() {},
            }
            self.columns.push_back(Kept { seconds, power: power.to_vec() });
        }
        let newest = self.newest().unwrap_or_default();
        while self.columns.pop_front_if(|oldest| oldest.seconds < newest - KEPT).is_some() {}
    }

    /// Number that grows with every change.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Gain of the image where the gate lies, dB.
    pub fn undone(&self) -> f64 {
        self.undone
    }

    /// The probe and the settings of the gate; none before the first spectrum.
    pub fn of(&self) -> Option<&(Probe, Spectral)> {
        self.of.as_ref()
    }

    /// Time of the newest spectrum, s.
    pub fn newest(&self) -> Option<f64> {
        self.columns.back().map(|column| column.seconds)
    }

    /// Number of spectra in the `window` seconds before `end`, and the time from the first of them to `end`, s.
    pub fn within(&self, end: f64, window: f64) -> (usize, f64) {
        let begin = self.columns.partition_point(|column| column.seconds <= end - window);
        let first = self.columns.get(begin).map_or(end, |column| column.seconds);
        (self.columns.len() - begin, end - first)
    }

    /// `count` spectra at even times of the `window` seconds before `end`: each lasts until the next. Silence before the first.
    pub fn even(&self, end: f64, window: f64, count: usize) -> Spectra {
        let bins = self.of.as_ref().map_or(0, |(_, spectral)| bins(spectral));
        let mut out = Spectra::default();
        let mut next = self.columns.partition_point(|column| column.seconds <= end - window);
        for x in 0..count {
            let moment = end - window * (1.0 - (x as f64 + 1.0) / count as f64);
            while self.columns.get(next).is_some_and(|column| column.seconds <= moment) {
                next += 1;
            }
            out.times.push(moment);
            match next.checked_sub(1) {
                Some(at) => out.power.extend(&self.columns[at].power),
                None => out.power.resize(out.power.len() + bins, 0.0),
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spectra at these times, of which each has its number as the power of its first bin.
    fn heard(spectral: &Spectral, times: &[f64]) -> Heard {
        let bins = bins(spectral);
        let mut power = vec![0.0; bins * times.len()];
        for (n, column) in power.chunks_exact_mut(bins).enumerate() {
            column[0] = n as f32 + 1.0;
        }
        let spectra = Spectra { times: times.to_vec(), power };
        Heard { probe: Probe::linear(), spectral: spectral.clone(), undone: 3.0, spectra }
    }

    fn levels(strip: &SpectrumStrip, end: f64, count: usize) -> Vec<f32> {
        let (_, spectral) = strip.of().expect("some");
        strip.even(end, 1.0, count).columns(spectral).map(|column| column[0]).collect()
    }

    #[test]
    fn each_spectrum_lasts_until_the_next() {
        let mut strip = SpectrumStrip::default();
        strip.add(&heard(&Spectral::default(), &[0.45, 0.85]));
        assert_eq!(levels(&strip, 1.0, 10), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
        let (count, span) = strip.within(1.0, 1.0);
        assert_eq!(count, 2);
        assert!((span - 0.55).abs() < 1e-12);
        // A little before the last one: in its place. Long before: a strip that begins anew.
        strip.add(&heard(&Spectral::default(), &[0.8, 0.9]));
        assert_eq!(levels(&strip, 1.0, 10), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!(strip.within(1.0, 1.0).0, 3);
        strip.add(&heard(&Spectral::default(), &[0.1]));
        assert_eq!((strip.newest(), strip.within(1.0, 1.0).0), (Some(0.1), 1));
    }

    #[test]
    fn what_only_shows_spectra_otherwise_keeps_them() {
        let (mut strip, first) = (SpectrumStrip::default(), Spectral::default());
        strip.add(&heard(&first, &[0.5]));
        let shown = Spectral { angle: 1.0, baseline: 0.5, invert: true, gain: 50.0, ..first };
        strip.add(&heard(&shown, &[0.6]));
        assert_eq!(strip.within(1.0, 1.0).0, 2);
        strip.add(&heard(&Spectral { prf: 4000.0, ..shown.clone() }, &[0.7]));
        assert_eq!(strip.within(1.0, 1.0).0, 1);
        strip.add(&heard(&Spectral { prf: 4000.0, depth: 30.0, ..shown }, &[0.8]));
        assert_eq!(strip.within(1.0, 1.0).0, 1);
    }

    #[test]
    fn memory_is_bounded() {
        let mut strip = SpectrumStrip::default();
        for i in 0..300 {
            strip.add(&heard(&Spectral::default(), &[f64::from(i) * 0.125]));
        }
        assert_eq!(strip.columns.len(), 161);
    }
}
