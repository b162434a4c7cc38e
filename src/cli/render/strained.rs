//! Strain: the image in the colours of how tissue was stretched and compressed since an image before, and the figures as a file.

use std::path::Path;

use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Value, json};

use insonify::doppler;
use insonify::output::npz::{self, Entry};
use insonify::scene::Scene;
use insonify::settings::{Doppler, VelocityMap, WallFilter};
use insonify::sim::Simulator;
use insonify::strain::{Deformation, deformation};

/// Number that selects the noise of the image before.
const BEFORE: u32 = 1 << 31;

/// The last image of the simulator, which is that of this number and time, in colour, RGBA, and what is said of it: what is
/// compressed in blue, what is stretched in red, in the box of `[doppler]`. The figures go into `file`, where one is given.
///
/// # Errors
/// An error of the device or of the file system.
pub fn strained(
    simulator: &mut Simulator,
    scene: &mut Scene,
    (index, seconds): (u32, f64),
    file: Option<&Path>,
) -> Result<(Vec<u8>, Value)> {
    let strain = scene.strain.clone();
    let mut echoes = |simulator: &mut Simulator, seconds: f64, index: u32| -> Result<Vec<f32>> {
        scene.set_time(seconds);
        simulator.frame(scene, index).into_diagnostic()?;
        simulator.iq().into_diagnostic()
    };
    let before = echoes(simulator, seconds - strain.interval, index ^ BEFORE)?;
    let after = echoes(simulator, seconds, index)?;
    let found = deformation(&scene.probe, &strain, [&before, &after]);
    // Nothing is filtered off, all greys are coloured, and the baseline of velocities is none of strains.
    let colours = Doppler {
        wall_filter: WallFilter::Off,
        priority: 1.0,
        baseline: 0.0,
        map: VelocityMap::Velocity,
        ..scene.doppler.clone()
    };
    let around = doppler::packet(&scene.probe, &colours);
    let (lines, samples) = (around.lines, around.samples);
    let share = |at: usize| {
        let value = f64::from(found.strain[at]) / strain.range;
        // Beyond the ends the colour is theirs.
        (f64::from(found.likeness[at]) >= strain.likeness).then(|| value.clamp(-0.999, 0.999))
    };
    let all = scene.probe.samples;
    let values: Vec<Option<f64>> = (lines.clone())
        .flat_map(|l| samples.clone().map(move |k| (l * all + k) as usize))
        .map(share)
        .collect();
    let made =
        simulator.colour_by(scene, &colours, (lines.clone(), samples.clone()), &values, None);
    made.into_diagnostic()?;
    let rgba = simulator.coloured_pixels().into_diagnostic()?.expect("just made");
    let coloured = values.iter().flatten().count();
    let said = json!({
        "shows": "strain",
        "interval_s": strain.interval,
        "range": strain.range,
        "scanlines": [lines.start, lines.end],
        "samples": [samples.start, samples.end],
        "coloured": coloured as f64 / values.len() as f64,
        "inverted": colours.invert,
    });
    if let Some(file) = file {
        write(file, scene, &found, &said)
            .map_err(|e| miette!("writing {}: {e}", file.display()))?;
    }
    Ok((rgba, said))
}

fn write(file: &Path, scene: &Scene, found: &Deformation, said: &Value) -> std::io::Result<()> {
    let (lines, samples) = (scene.probe.scanlines as usize, scene.probe.samples as usize);
    let pitch = scene.probe.sample_pitch();
    let depth: Vec<f32> = (0..samples).map(|k| (k as f64 * pitch) as f32).collect();
    let (map, along) = ([lines, samples], [samples]);
    let parts = [
        ("displacement", &map[..], &found.displacement),
        ("strain", &map, &found.strain),
        ("likeness", &map, &found.likeness),
        ("depth", &along, &depth),
    ];
    let entries =
        parts.map(|(name, shape, values)| Entry::floats(name, shape, bytemuck::cast_slice(values)));
    npz::write(file, &entries, &[("packet.json", &said.to_string())])
}
