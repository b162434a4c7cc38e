//! Spectral Doppler: the spectra of a gate, or of a whole line, against time as a picture, with what is measured on them.

use std::io::Cursor;
use std::path::Path;

use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Map, Value, json};

use super::Render;
use crate::cli::common::{self, Progress};
use insonify::doppler::broadening::Broadening;
use insonify::doppler::spectrum::{Analyser, Spectrogram, greys, image_gain};
use insonify::doppler::trace::{Measured, Trace, measure, trace};
use insonify::doppler::{gate, nyquist, sound};
use insonify::exchange;
use insonify::gpu::FrameTimings;
use insonify::output;
use insonify::output::dicom::{self, About, DicomError, SpectralScale};
use insonify::output::files;
use insonify::output::npz::{self, Entry};
use insonify::scene::Scene;
use insonify::settings::{Wave, Words};
use insonify::sim::Simulator;

/// Echoes recorded between two steps of the progress.
const STEP: usize = 500;
/// Grey of the baseline.
const LINE: u8 = 110;

/// Refuses what does not go with a recording of a gate, and settings of which none can be made.
///
/// # Errors
/// The fault with its remedy.
pub fn check(args: &Render, output: &Path, scene: &Scene) -> Result<()> {
    let others = [
        ("--frames", args.frames.is_some()),
        ("--fps", args.fps.is_some()),
        ("--trajectory", args.trajectory.is_some()),
        ("--labels", args.labels.is_some()),
        ("--steps", args.steps),
    ];
    if let Some((name, _)) = others.iter().find(|(_, given)| *given) {
        return Err(miette!(
            help = "leave it out; --set spectral.duration=\"5 s\" records for longer",
            "{name} is for images, and a spectral mode is one recording of a gate"
        ));
    }
    let is_picture = output.extension().is_none_or(|e| e.eq_ignore_ascii_case("png"));
    if !is_picture && !dicom::is_meant(output) {
        return Err(miette!(
            help = "end the name in .png or .dcm; --packet NAME.npz has the numbers",
            "{} is not written: a spectrum is a picture",
            output.display()
        ));
    }
    if let Some(sound) = &args.sound {
        if sound.extension().is_none_or(|e| !e.eq_ignore_ascii_case("wav")) {
            return Err(miette!(
                help = "end the name in .wav",
                "{} is not written: a sound is a WAV file",
                sound.display()
            ));
        }
        common::writable(sound)?;
    }
    match scene.spectral.fault(&scene.probe) {
        None => common::writable(output),
        Some((key, message, remedy)) => Err(miette!(help = remedy, "spectral.{key}: {message}")),
    }
}

/// Refuses a sound of a mode that has none.
///
/// # Errors
/// The fault with its remedy.
pub fn check_silent(args: &Render) -> Result<()> {
    match &args.sound {
        None => Ok(()),
        Some(_) => Err(miette!(
            help = "--mode pw and --mode cw record a gate, which is heard",
            "--sound is what a gate hears, and colours have none"
        )),
    }
}

/// Records the gate of a scene and writes its spectra; `sidecar` is what else is said of the scene. Returns the device's timings of
/// each packet of pulses, and all that is said.
///
/// # Errors
/// An error of the device or of the file system.
pub fn write(
    args: &Render,
    output: &Path,
    simulator: &mut Simulator,
    scene: &mut Scene,
    mut sidecar: Map<String, Value>,
) -> Result<(Vec<FrameTimings>, Map<String, Value>)> {
    let spectral = scene.spectral.clone();
    let pulses = (spectral.duration * spectral.prf).round() as usize;
    let start = args.common.time;
    let mut analyser = Analyser::new(&spectral);
    let mut progress = Progress::new(pulses as u32, "pulses");
    let (mut echoes, mut index, mut timings) = (Vec::with_capacity(pulses), 0, Vec::new());
    while echoes.len() < pulses {
        let at = start + echoes.len() as f64 / spectral.prf;
        let count = STEP.min(pulses - echoes.len());
        let made;
        (made, index) = gate::record(simulator, scene, at, count, index).into_diagnostic()?;
        analyser.add(&made);
        echoes.extend(made);
        timings.extend(simulator.wait().into_diagnostic()?);
        progress.done(echoes.len() as u32);
    }
    progress.finish();
    let made = analyser.take().shown(&scene.probe, &spectral);
    let lines = Broadening::of(&scene.probe, scene.imaging.psf_scale, &spectral);
    let traces = trace(&made, &lines);
    let measured = measure(&made.times, &traces);
    sidecar.insert("spectrum".into(), facts(scene, &made, &traces, measured));
    match dicom::is_meant(output) {
        true => write_dicom(output, scene, &made).into_diagnostic()?,
        false => write_picture(output, scene, &made)
            .map_err(|e| miette!("writing {}: {e}", output.display()))?,
    }
    output::line(output.display());
    if let Some(file) = &args.packet {
        let echoes: Vec<[f32; 2]> = echoes.iter().map(|e| [e.re as f32, e.im as f32]).collect();
        let said = sidecar["spectrum"].to_string();
        write_arrays(file, &echoes, &made, &traces, &said)
            .map_err(|e| miette!("writing {}: {e}", file.display()))?;
        output::line(file.display());
    }
    if let Some(file) = &args.sound {
        let mut wav = Cursor::new(Vec::new());
        let written = sound::write_wav(&mut wav, &sound::sound(&spectral, &echoes));
        let written = written.map_err(std::io::Error::other);
        written
            .and_then(|()| files::replace(file, wav.get_ref()))
            .map_err(|e| miette!("writing {}: {e}", file.display()))?;
        output::line(file.display());
    }
    if !files::is_stream(output) {
        let name = output.file_name().unwrap_or_default().to_string_lossy();
        sidecar.insert("file".into(), name.into());
        common::write_sidecar(&output.with_extension("json"), &sidecar)?;
    }
    Ok((timings, sidecar))
}

fn facts(scene: &Scene, made: &Spectrogram, traces: &Trace, measured: Option<Measured>) -> Value {
    let spectral = &scene.spectral;
    let cosine = spectral.angle.cos();
    let farthest = |most: f64, v: &f64| if v.abs() > most.abs() { *v } else { most };
    json!({
        "wave": spectral.wave.word(),
        "prf_hz": spectral.prf,
        "frequency_mhz": scene.probe.frequency,
        "speed_mm_per_us": scene.probe.speed,
        "angle_deg": spectral.angle.to_degrees(),
        "nyquist_mm_per_s": nyquist(&scene.probe, spectral.prf) / cosine,
        // Rows of the picture, from the top.
        "velocity_mm_per_s": [made.velocities.last(), made.velocities.first()],
        // Columns of the picture.
        "time_s": [made.times.first(), made.times.last()],
        "above_baseline": if spectral.invert { "away" } else { "towards" },
        "maximum_mm_per_s": traces.maximum.iter().fold(0.0, farthest),
        "mean_mm_per_s": traces.mean.iter().sum::<f64>() / traces.mean.len().max(1) as f64,
        "measured": measured,
    })
}

/// The spectra as DICOM, whose region says what a pixel is.
fn write_dicom(output: &Path, scene: &Scene, made: &Spectrogram) -> Result<(), DicomError> {
    let (spectral, probe) = (&scene.spectral, &scene.probe);
    let greys = greys(spectral, made, image_gain(scene));
    let about = About {
        name: scene.name.clone(),
        pitch: 1.0,
        corner: [0.0; 2],
        frequency: probe.frequency,
        transducer: exchange::transducer(probe),
        colours: None,
        study: None,
    };
    let last = made.times.len() - 1;
    let step = (made.times[last] - made.times[0]) / last.max(1) as f64;
    let scale = SpectralScale {
        continuous: spectral.wave == Wave::Continuous,
        prf: spectral.prf,
        angle: spectral.angle.to_degrees(),
        time: [made.times[0], step],
        velocity: [made.velocities[made.velocities.len() - 1], -made.step()],
    };
    let size = [made.times.len(), made.velocities.len()].map(|n| n as u32);
    dicom::spectra(output, about, &scale, size, &greys)
}

fn write_picture(output: &Path, scene: &Scene, made: &Spectrogram) -> std::io::Result<()> {
    let mut pixels = greys(&scene.spectral, made, image_gain(scene));
    let (width, height) = (made.times.len(), made.velocities.len());
    // The baseline, where it is within the picture.
    let zero = -made.velocities[0] / made.step();
    if zero >= 0.0 && (zero as usize) < height {
        let row = height - 1 - zero as usize;
        pixels[row * width..][..width].iter_mut().for_each(|pixel| *pixel = LINE.max(*pixel));
    }
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    let kind = image::ExtendedColorType::L8;
    let made =
        image::ImageEncoder::write_image(encoder, &pixels, width as u32, height as u32, kind);
    made.map_err(std::io::Error::other)?;
    files::replace(output, &png)
}

fn write_arrays(
    file: &Path,
    echoes: &[[f32; 2]],
    made: &Spectrogram,
    traces: &Trace,
    said: &str,
) -> std::io::Result<()> {
    let short = |values: &[f64]| -> Vec<f32> { values.iter().map(|&v| v as f32).collect() };
    let [times, velocities, maximum, mean]: [Vec<f32>; 4] =
        [&made.times, &made.velocities, &traces.maximum, &traces.mean].map(|v| short(v));
    let slow_time = [echoes.len(), 2];
    let all = [times.len(), velocities.len()];
    let parts = [
        ("iq", &slow_time[..], bytemuck::cast_slice(echoes)),
        ("spectrum", &all[..], bytemuck::cast_slice(&made.power)),
        ("velocity", &all[1..], bytemuck::cast_slice(&velocities)),
        ("times", &all[..1], bytemuck::cast_slice(&times)),
        ("maximum", &all[..1], bytemuck::cast_slice(&maximum)),
        ("mean", &all[..1], bytemuck::cast_slice(&mean)),
    ];
    let entries = parts.map(|(name, shape, bytes)| Entry::floats(name, shape, bytes));
    npz::write(file, &entries, &[("packet.json", said)])
}
