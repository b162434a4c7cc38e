//! Doppler modes: the image with the colours of its packet, and the packet as a file.

use std::path::Path;

use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use super::mode::Colours;
use crate::cli::common;
use insonify::doppler;
use insonify::output::npz::{self, Entry};
use insonify::scene::Scene;
use insonify::sim::{ColourMode, Correlation, Packet, Simulator};

/// Key of the Nyquist velocity in what is said of a packet.
const NYQUIST: &str = "nyquist_mm_per_s";

/// Refuses settings with which nothing could be coloured.
///
/// # Errors
/// The fault with its remedy, if these settings cannot colour an image of this probe.
pub fn check(scene: &Scene, colours: Colours) -> Result<()> {
    let fault = match colours {
        Colours::Doppler(mode) => mode.fault(&scene.settings),
        Colours::Strain => {
            let fault = scene.doppler.fault_of_box();
            fault.map(|(key, message, remedy)| (format!("doppler.{key}"), message, remedy))
        }
    };
    match fault {
        None => Ok(()),
        Some((path, message, remedy)) => Err(miette!(help = remedy, "{path}: {message}")),
    }
}

/// Refuses a file that could not be written as a packet; makes its folder.
///
/// # Errors
/// An extension of another format; a folder that cannot be made or written to.
pub fn check_packet(file: &Path) -> Result<()> {
    if file.extension().is_none_or(|e| !e.eq_ignore_ascii_case("npz")) {
        return Err(miette!(
            help = "end the name in .npz",
            "{} is not written: a packet is an archive of NumPy arrays",
            file.display()
        ));
    }
    common::writable(file)
}

/// The last image of the simulator, which is that of `seconds`, in colour, RGBA, and what is said of it. The packet goes into
/// `file`, where one is given.
pub fn coloured(
    simulator: &mut Simulator,
    scene: &mut Scene,
    mode: ColourMode,
    (index, seconds): (u32, f64),
    file: Option<&Path>,
) -> Result<(Vec<u8>, Value)> {
    let settings = mode.doppler(&scene.settings);
    let made = doppler::make_packet(simulator, scene, seconds, index, mode, &settings);
    let packet = made.into_diagnostic()?;
    // Before they are filtered.
    let echoes = file.map(|_| simulator.pulses()).transpose().into_diagnostic()?;
    simulator.colour(scene, mode, None).into_diagnostic()?;
    let rgba = simulator.coloured_pixels().into_diagnostic()?.expect("just made");
    let said = json!({
        "shows": mode.word(),
        "prf_hz": settings.prf,
        "pulses": packet.times.len(),
        NYQUIST: doppler::nyquist(&scene.probe, settings.prf),
        "baseline": settings.baseline,
        "inverted": settings.invert,
        "scanlines": [packet.lines.start, packet.lines.end],
        "samples": [packet.samples.start, packet.samples.end],
        "wall_filter": settings.wall_filter.to_string(),
        "frequency_mhz": scene.probe.frequency,
        "speed_mm_per_us": scene.probe.speed,
    });
    if let (Some(file), Some(echoes)) = (file, echoes) {
        let found = simulator.correlations().into_diagnostic()?;
        write(file, scene, &packet, &echoes, &found, &said)
            .map_err(|e| miette!("writing {}: {e}", file.display()))?;
    }
    Ok((rgba, said))
}

/// Writes the echoes of a packet, and what was found in them.
fn write(
    file: &Path,
    scene: &Scene,
    packet: &Packet,
    echoes: &[[f32; 2]],
    found: &[Correlation],
    said: &Value,
) -> std::io::Result<()> {
    let nyquist = said[NYQUIST].as_f64().expect("said above");
    let of = |value: &dyn Fn(&Correlation) -> f64| -> Vec<f32> {
        found.iter().map(|one| value(one) as f32).collect()
    };
    let velocity = of(&|one| one.velocity(nyquist));
    let variance = of(&|one| one.variance(nyquist));
    let power = of(&|one| one.power.into());
    let times: Vec<f32> = packet.times.iter().map(|&t| t as f32).collect();
    let pitch = scene.probe.sample_pitch();
    let depth: Vec<f32> = packet.samples.clone().map(|k| (f64::from(k) * pitch) as f32).collect();
    let map = [packet.lines.len(), packet.samples.len()];
    let all = [times.len(), map[0], map[1], 2];
    npz::write(
        file,
        &[
            Entry::floats("iq", &all, bytemuck::cast_slice(echoes)),
            Entry::floats("velocity", &map, bytemuck::cast_slice(&velocity)),
            Entry::floats("variance", &map, bytemuck::cast_slice(&variance)),
            Entry::floats("power", &map, bytemuck::cast_slice(&power)),
            Entry::floats("times", &[times.len()], bytemuck::cast_slice(&times)),
            Entry::floats("depth", &[depth.len()], bytemuck::cast_slice(&depth)),
        ],
        &[("packet.json", &said.to_string())],
    )
}
