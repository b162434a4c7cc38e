//! Packets of pulses for Doppler modes: the colour box, and the velocity at which its colours fold over.

pub mod broadening;
pub mod gate;
pub mod sound;
pub mod spectrum;
pub mod trace;

use std::ops::Range;

use crate::output::dicom::ColourBox;
use crate::probe::Probe;
use crate::scene::Scene;
use crate::settings::Doppler;
use crate::sim::{ColourMode, Packet, SimError, Simulator};

/// The velocity, mm/s, that turns an echo by half a turn from pulse to pulse: c PRF / (4 f).
pub fn nyquist(probe: &Probe, prf: f64) -> f64 {
    // mm/us over MHz are mm.
    probe.speed / probe.frequency * prf / 4.0
}

/// Makes the packet of the colour box of a mode on the device, about `seconds`, the scene's time, with the settings that
/// [`ColourMode::doppler`] has of the scene's, of which the pulses may be fewer. Of tissue each pulse is made at its own time.
///
/// # Errors
/// Those of [`Simulator::frame`]; device out of memory.
pub fn make_packet(
    simulator: &mut Simulator,
    scene: &mut Scene,
    seconds: f64,
    index: u32,
    mode: ColourMode,
    settings: &Doppler,
) -> Result<Packet, SimError> {
    let mut packet = packet(&scene.probe, settings);
    match mode {
        ColourMode::Color | ColourMode::Power => simulator.make_packet(scene, index, &packet)?,
        ColourMode::Tissue => {
            packet.renewed = true;
            for (n, time) in packet.times.iter().enumerate() {
                scene.set_time(seconds + time);
                simulator.make_pulse(scene, index, &packet, n)?;
            }
            scene.set_time(seconds);
        }
    }
    Ok(packet)
}

/// The box of these settings over an image: its edges, and how fast its pulses follow each other.
pub fn shown(probe: &Probe, doppler: &Doppler) -> ColourBox {
    let mut edges = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    // Arcs of a sector are farthest out at their ends or where they cross its middle.
    let middle = 0.5_f64.clamp(doppler.left, doppler.right.max(doppler.left));
    for across in [doppler.left, middle, doppler.right] {
        let (origin, direction) = probe.ray_across(across - 0.5);
        for down in [doppler.top, doppler.bottom] {
            let at = origin + direction * (down * probe.depth);
            edges =
                [edges[0].min(at.x), edges[1].min(at.z), edges[2].max(at.x), edges[3].max(at.z)];
        }
    }
    ColourBox { edges, prf: doppler.prf }
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

#[cfg(test)]
mod tests;
