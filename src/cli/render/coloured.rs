//! Doppler modes: the image with the colours of its packet.

use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

use insonify::doppler::{self, ColourMode};
use insonify::scene::Scene;
use insonify::sim::Simulator;
use insonify::sim::facts::Area;

/// The last image of the simulator in colour, RGBA, and what is said of it. The simulator holds its packet then.
pub fn coloured(
    simulator: &mut Simulator,
    scene: &Scene,
    mode: ColourMode,
    index: u32,
    area: &Area,
) -> Result<(Vec<u8>, Value)> {
    let (_, _, mut rgba) = simulator.pixels().into_diagnostic()?;
    let packet = doppler::packet(&scene.probe, &scene.doppler);
    let echoes = simulator.packet(scene, index, &packet).into_diagnostic()?;
    doppler::colour(scene, mode, &packet, echoes, area, &mut rgba);
    let words = match mode {
        ColourMode::Color => "velocity",
        ColourMode::Power => "power",
    };
    let said = json!({
        "shows": words,
        "prf_hz": scene.doppler.prf,
        "pulses": packet.times.len(),
        "nyquist_mm_per_s": doppler::nyquist(&scene.probe, scene.doppler.prf),
        "scanlines": [packet.lines.start, packet.lines.end],
        "samples": [packet.samples.start, packet.samples.end],
    });
    Ok((rgba, said))
}
