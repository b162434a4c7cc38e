//! Doppler processing of packets of pulses: wall filter, autocorrelation, and velocity, variance and power from them.

mod colour;
pub mod gate;
pub mod spectrum;
pub mod trace;

use std::f64::consts::PI;
use std::ops::Range;

use crate::probe::Probe;
use crate::scene::Scene;
use crate::settings::Doppler;
use crate::sim::Packet;

pub use colour::{ColourMode, colour};

/// The correlations of the echoes of a packet at one sample, of which velocity, variance and power follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Correlation {
    /// Sum of each pulse's echo times the conjugate of the one before, over pairs: real and imaginary part. Of what moves
    /// towards the probe its phase is above 0.
    pub next: [f64; 2],
    /// Power: mean of squares, over pulses.
    pub power: f64,
}

impl Correlation {
    /// Velocity towards the probe, in the unit of `nyquist`, the velocity that turns an echo by half a turn from pulse to
    /// pulse; 0 where there is no echo. After Kasai et al. 1985, IEEE Trans. Sonics Ultrason. 32, 458-464.
    pub fn velocity(&self, nyquist: f64) -> f64 {
        let [re, im] = self.next;
        nyquist * im.atan2(re) / PI
    }

    /// Variance of the velocity, in the square of that unit (Kasai et al. 1985).
    pub fn variance(&self, nyquist: f64) -> f64 {
        if self.power <= 0.0 {
            return 0.0;
        }
        let alike = self.next[0].hypot(self.next[1]) / self.power;
        2.0 * (nyquist / PI).powi(2) * (1.0 - alike).max(0.0)
    }
}

/// The velocity, mm/s, that turns an echo by half a turn from pulse to pulse: c PRF / (4 f).
pub fn nyquist(probe: &Probe, prf: f64) -> f64 {
    // mm/us over MHz are mm.
    probe.speed / probe.frequency * prf / 4.0
}

/// The packet of the box of these settings.
pub fn packet(probe: &Probe, doppler: &Doppler) -> Packet {
    let span = |begin: f64, end: f64, all: u32| -> Range<u32> {
        let [begin, end] = [begin, end].map(|share| (share * f64::from(all)).round() as u32);
        let begin = begin.min(all - 1);
        begin..end.clamp(begin + 1, all)
    };
    let lines = span(doppler.left, doppler.right, probe.scanlines);
    let samples = span(doppler.top, doppler.bottom, probe.samples);
    Packet::even(doppler.pulses, doppler.prf, lines, samples)
}

/// The correlations of a packet's echoes behind the wall filter, by scanline and sample, as the scene's settings say.
pub fn process(scene: &Scene, packet: &Packet, echoes: &[[f32; 2]]) -> Vec<Correlation> {
    let (doppler, pulses) = (&scene.doppler, packet.times.len());
    let mut filtered = echoes.to_vec();
    wall_filter(&mut filtered, pulses, doppler.order());
    let gate = (doppler.gate / scene.probe.sample_pitch()).round() as usize;
    correlations(&filtered, pulses, packet.samples.len(), gate)
}

/// Orthonormal polynomials over `count` pulses up to this order: what a wall filter takes off.
fn polynomials(count: usize, order: u32) -> Vec<Vec<f64>> {
    let mut made: Vec<Vec<f64>> = Vec::new();
    for power in 0..=order {
        let middle = (count as f64 - 1.0) / 2.0;
        let mut next: Vec<f64> = (0..count)
            .map(|n| ((n as f64 - middle) / middle.max(1.0)).powi(power as i32))
            .collect();
        for before in &made {
            let share: f64 = next.iter().zip(before).map(|(a, b)| a * b).sum();
            next.iter_mut().zip(before).for_each(|(a, b)| *a -= share * b);
        }
        let norm = next.iter().map(|a| a * a).sum::<f64>().sqrt();
        // As many polynomials as there are pulses take everything off.
        if norm > 1e-9 {
            next.iter_mut().for_each(|a| *a /= norm);
            made.push(next);
        }
    }
    made
}

/// The echoes of a packet's pulses without the polynomial up to this order that fits best to each sample's
/// (regression filter: Hoeks et al. 1991, Ultrason. Imaging 13, 265-281). `echoes` are by pulse, then by sample.
pub fn wall_filter(echoes: &mut [[f32; 2]], pulses: usize, order: Option<u32>) {
    let Some(order) = order else { return };
    let each = echoes.len() / pulses;
    let taken = polynomials(pulses, order);
    for at in 0..each {
        for polynomial in &taken {
            let mut share = [0.0_f64; 2];
            for (n, weight) in polynomial.iter().enumerate() {
                let [re, im] = echoes[n * each + at].map(f64::from);
                share = [share[0] + weight * re, share[1] + weight * im];
            }
            for (n, weight) in polynomial.iter().enumerate() {
                let echo = &mut echoes[n * each + at];
                echo[0] -= (weight * share[0]) as f32;
                echo[1] -= (weight * share[1]) as f32;
            }
        }
    }
}

/// The correlations of filtered echoes, by pulse, scanline and sample, averaged along the scanline over `gate` samples.
pub fn correlations(
    echoes: &[[f32; 2]],
    pulses: usize,
    samples: usize,
    gate: usize,
) -> Vec<Correlation> {
    let each = echoes.len() / pulses;
    let one = |at: usize| {
        let echo = |n: usize| echoes[n * each + at].map(f64::from);
        let mut own = Correlation::default();
        for n in 0..pulses {
            let [re, im] = echo(n);
            own.power += (re * re + im * im) / pulses as f64;
            if n > 0 {
                let [a, b] = echo(n - 1);
                let pairs = (pulses - 1) as f64;
                own.next[0] += (re * a + im * b) / pairs;
                own.next[1] += (im * a - re * b) / pairs;
            }
        }
        own
    };
    let all: Vec<Correlation> = (0..each).map(one).collect();
    let reach = gate / 2;
    let mut out = Vec::with_capacity(each);
    for line in all.chunks(samples) {
        for k in 0..line.len() {
            let near = &line[k.saturating_sub(reach)..(k + reach + 1).min(line.len())];
            let mut mean = Correlation::default();
            for one in near {
                mean.power += one.power / near.len() as f64;
                mean.next[0] += one.next[0] / near.len() as f64;
                mean.next[1] += one.next[1] / near.len() as f64;
            }
            out.push(mean);
        }
    }
    out
}

#[cfg(test)]
mod tests;
