//! The gate of spectral Doppler: its echoes, pulse after pulse; of a continuous wave those of all of its line.

use std::ops::Range;

use rustfft::num_complex::Complex;

use crate::probe::Probe;
use crate::scene::Scene;
use crate::settings::{Spectral, Wave};
use crate::sim::{Packet, SimError, Simulator};

/// Time for which tissue is taken to stand still, s: its echoes are made anew as often.
const STILL: f64 = 0.01;
/// Most pulses of a packet.
const MOST: f64 = 64.0;

/// The samples of the gate on its scanline.
fn samples(probe: &Probe, spectral: &Spectral) -> Range<u32> {
    let [start, end] = [-0.5, 0.5].map(|end| {
        let at = (spectral.depth + end * spectral.gate) / probe.sample_pitch();
        at.round().clamp(0.0, f64::from(probe.samples)) as u32
    });
    let start = start.min(probe.samples - 1);
    start..end.max(start + 1)
}

/// The scanline and the samples that are heard, as a packet of `pulses` pulses of which the scene's time is the first.
fn packet(probe: &Probe, spectral: &Spectral, pulses: usize) -> Packet {
    let line = (spectral.line * f64::from(probe.scanlines)) as u32;
    let line = line.min(probe.scanlines - 1);
    Packet {
        times: (0..pulses).map(|n| n as f64 / spectral.prf).collect(),
        lines: line..line + 1,
        samples: match spectral.wave {
            Wave::Pulsed => samples(probe, spectral),
            Wave::Continuous => 0..probe.samples,
        },
        renewed: true,
    }
}

/// Echoes of the gate of a scene's `[spectral]`: complex baseband, the mean over the gate, for `pulses` pulses from `start` on (s,
/// the scene's time, which is then that of the last packet). Echoes of what comes turn forwards. `first` is the number of the
/// first packet of pulses, which selects their noise; returns the number of the next one as well.
///
/// # Errors
/// Those of [`Simulator::packet`].
pub fn record(
    simulator: &mut Simulator,
    scene: &mut Scene,
    start: f64,
    pulses: usize,
    first: u32,
) -> Result<(Vec<Complex<f64>>, u32), SimError> {
    let spectral = scene.spectral.clone();
    let at_once = match spectral.tissue {
        true => 1,
        false => (spectral.prf * STILL).round().clamp(1.0, MOST) as usize,
    };
    // Of a continuous wave the sum, as loud as the gate would be: the phase of an echo is that of its place, whatever the pulse.
    let length = samples(&scene.probe, &spectral).len() as f64;
    let mut echoes = Vec::with_capacity(pulses);
    let mut index = first;
    while echoes.len() < pulses {
        scene.set_time(start + echoes.len() as f64 / spectral.prf);
        let packet = packet(&scene.probe, &spectral, at_once.min(pulses - echoes.len()));
        let made = simulator.packet(scene, index, &packet)?;
        let mean = |gate: &[[f32; 2]]| {
            let all = gate.iter().map(|&[re, im]| Complex::new(f64::from(re), f64::from(im)));
            all.sum::<Complex<f64>>() / length
        };
        echoes.extend(made.chunks_exact(packet.samples.len()).map(mean));
        index = index.wrapping_add(1);
    }
    Ok((echoes, index))
}

/// A Butterworth high-pass of second order, which takes off what tissue sends back: by the bilinear transform, with the
/// warping of its cut-off taken back (Oppenheim and Schafer, Discrete-Time Signal Processing, 7.1).
#[derive(Clone, Debug)]
pub struct WallFilter {
    feed: [f64; 3],
    back: [f64; 2],
    state: Option<[Complex<f64>; 2]>,
}

impl WallFilter {
    /// The filter that halves the power at `cut` Hz, of echoes at `prf` Hz; 0 passes everything.
    pub fn new(cut: f64, prf: f64) -> Self {
        let k = (std::f64::consts::PI * cut / prf).tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        let back = [2.0 * (k * k - 1.0), 1.0 - std::f64::consts::SQRT_2 * k + k * k];
        match cut > 0.0 {
            true => {
                Self { feed: [norm, -2.0 * norm, norm], back: back.map(|b| b * norm), state: None }
            }
            false => Self { feed: [1.0, 0.0, 0.0], back: [0.0; 2], state: None },
        }
    }

    /// The next echo without what changes slowly. The first one counts as what has always been there.
    pub fn next(&mut self, echo: Complex<f64>) -> Complex<f64> {
        let [b0, b1, b2] = self.feed;
        let [a1, a2] = self.back;
        let [s1, s2] = self.state.unwrap_or([echo * (b1 + b2), echo * b2]);
        let out = echo * b0 + s1;
        self.state = Some([echo * b1 - out * a1 + s2, echo * b2 - out * a2]);
        out
    }
}
