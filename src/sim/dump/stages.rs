//! Writes the stages of image formation as arrays and images.

use std::path::Path;

use serde_json::json;

use super::super::Simulator;
use super::{DumpError, png};
use crate::output::npy::{self, Element};
use crate::output::{self, files};
use crate::scene::Scene;

/// One axis of a dumped array.
struct Axis {
    /// Name of the quantity along the axis.
    name: &'static str,
    /// Unit of `start` and `step`.
    unit: &'static str,
    /// Coordinate of the first entry.
    start: f64,
    /// Distance between entries.
    step: f64,
    /// Number of entries.
    size: usize,
}

/// Writes `NAME.npy` and its sidecar.
fn stage(
    dir: &Path,
    name: &str,
    meaning: &str,
    axes: &[Axis],
    data: &[f32],
) -> Result<(), DumpError> {
    let shape: Vec<usize> = axes.iter().map(|axis| axis.size).collect();
    let path = dir.join(format!("{name}.npy"));
    npy::write(&path, Element::Float, &shape, bytemuck::cast_slice(data))
        .map_err(|e| DumpError::file(&path, e))?;
    sidecar(dir, name, meaning, axes)
}

/// Writes the sidecar `NAME.json` of a stage: its axes from slowest to fastest, its meaning.
fn sidecar(dir: &Path, name: &str, meaning: &str, axes: &[Axis]) -> Result<(), DumpError> {
    let axes: Vec<_> = axes
        .iter()
        .map(|a| json!({"name": a.name, "unit": a.unit, "start": a.start, "step": a.step, "size": a.size}))
        .collect();
    let text = output::json(&json!({"meaning": meaning, "axes": axes}));
    let path = dir.join(format!("{name}.json"));
    files::replace(&path, text.as_bytes()).map_err(|e| DumpError::file(&path, e))
}

/// Writes every stage of the last frame.
pub(super) fn write(simulator: &mut Simulator, scene: &Scene, dir: &Path) -> Result<(), DumpError> {
    let frame = *simulator.constants();
    let (lines, samples) = (frame.scanlines as usize, frame.samples as usize);
    let pitch = scene.probe.sample_pitch();
    let axis = |name, unit, start, step, size| Axis { name, unit, start, step, size };
    let scanline = || axis("scanline", "1", 0.0, 1.0, lines);
    let depth = || axis("depth", "mm", 0.0, pitch, samples);
    let complex = || axis("complex", "real, imaginary", 0.0, 1.0, 2);
    let write = |name: &str, meaning: &str, axes: &[Axis], data: &[f32]| {
        stage(dir, name, meaning, axes, data)
    };

    let echoes = simulator.echoes()?;
    let rows = simulator.tables().rows.clone();
    let count = 2 * lines * samples;
    let row = |i: usize| &rows[i / 2 % samples];
    let surface = echoes[0][..count].iter().enumerate();
    let volume = echoes[1][..count].iter().enumerate();
    let undone: Vec<f32> = surface
        .map(|(i, &v)| v as f32 * row(i).surface_undo)
        .chain(volume.map(|(i, &v)| v as f32 * row(i).volume_undo))
        .collect();
    write(
        "0_echoes",
        "deposited echoes relative to a perfect mirror, complex baseband, before any kernel",
        &[axis("kind", "surface, volume", 0.0, 1.0, 2), scanline(), depth(), complex()],
        &undone,
    )?;
    let (factor, rf) = simulator.rf(&scene.probe)?;
    write(
        "1_rf",
        "radio-frequency line before TGC",
        &[scanline(), axis("depth", "mm", 0.0, pitch / factor as f64, samples * factor)],
        &rf,
    )?;
    let iq = simulator.iq()?;
    write("2_iq", "complex baseband before TGC", &[scanline(), depth(), complex()], &iq)?;
    let envelope = simulator.envelope()?;
    write("3_envelope", "envelope after TGC", &[scanline(), depth()], &envelope)?;
    let log = simulator.log_image()?;
    write("4_log", "log-compressed envelope, 0 black to 1 white", &[scanline(), depth()], &log)?;
    let (width, height, rgba) = simulator.pixels()?;
    png(&dir.join("5_bmode.png"), width, height, &rgba)?;
    let (x, z, pixel) =
        (f64::from(frame.image_left), f64::from(frame.image_top), f64::from(frame.pixel_pitch));
    let axes = [
        axis("depth", "mm", z + pixel / 2.0, pixel, height as usize),
        axis("lateral", "mm", x + pixel / 2.0, pixel, width as usize),
    ];
    sidecar(dir, "5_bmode", "scan-converted B-mode image, pixel centres in probe space", &axes)?;
    let Some(steps) = simulator.fusion_steps()? else {
        return Ok(());
    };
    // RGBA of grey levels 0..1, opaque throughout: beside the sector all of them are 0.
    let grey = |levels: &[f32]| -> Vec<u8> {
        let byte = |v: &f32| (v * 255.0 + 0.5) as u8;
        let pixels = levels.iter().map(|v| [byte(v), byte(v), byte(v), 255]);
        pixels.flatten().collect()
    };
    for (name, meaning, rgba) in [
        ("6_background", "scan-converted acquired volume", grey(&steps.background)),
        ("7_mask", "scan-converted mask, white outside the masking meshes", grey(&steps.mask)),
        (
            "8_blurred_mask",
            "box-blurred mask: the weight of the acquired volume",
            grey(&steps.blurred),
        ),
        ("9_simulation", "the simulation alone; 5_bmode is the fused image", steps.simulated),
    ] {
        png(&dir.join(format!("{name}.png")), width, height, &rgba)?;
        sidecar(dir, name, meaning, &axes)?;
    }
    Ok(())
}
