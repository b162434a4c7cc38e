//! `profile stages`: the time of each stage of a frame, beside the bytes that it has to move and the
//! operations that it has to do, by scene and number of paths.

use std::path::PathBuf;
use std::time::Instant;

use insonify::output;
use insonify::scene::Scene;
use insonify::sim::layout::Counters;
use insonify::sim::{Simulator, Tracer};
use miette::{IntoDiagnostic, Result};
use serde_json::{Value, json};

use crate::Machine;
use crate::measure::Statistics;
use crate::table::{Table, ms, write_json};

#[derive(clap::Args)]
pub struct Arguments {
    /// Scene files.
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Paths per line.
    #[arg(long, value_delimiter = ',', default_value = "8,32,128", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    paths: Vec<u32>,
    /// Frames of which the median counts, after one that does not.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Overrides an entry of all scene files, e.g. --set probe.scanlines=64.
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = insonify::scene::file::override_of)]
    overrides: Vec<(String, String)>,
    /// Name of the JSON file in the output folder.
    #[arg(long, default_value = "stages")]
    name: String,
}

/// Times of a frame of one scene, ms.
struct Measured {
    /// By stage, in the order of the frame.
    stages: Vec<(String, Statistics)>,
    device: Statistics,
    /// From the order of a frame to its pixels in memory.
    latency: Statistics,
}

pub fn run(machine: &Machine, arguments: &Arguments) -> Result<()> {
    let mut all = Vec::new();
    for file in &arguments.scenes {
        let (scene, _) = Scene::load(file, &arguments.overrides)?;
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        for &tracer in &machine.tracers {
            for &paths in &arguments.paths {
                let mut scene = scene.clone();
                scene.simulation.paths = paths;
                all.push(one(machine, &scene, &name, tracer, arguments.frames)?);
            }
        }
    }
    let provenance = &machine.provenance;
    write_json(&machine.output, &arguments.name, &json!({ "machine": provenance, "runs": all }))
}

/// Measures and prints one scene with one tracer.
fn one(machine: &Machine, scene: &Scene, name: &str, tracer: Tracer, frames: u32) -> Result<Value> {
    let began = Instant::now();
    let simulator = Simulator::new(&machine.device, &machine.library, scene, tracer);
    let mut simulator = simulator.into_diagnostic()?;
    let build = began.elapsed().as_secs_f64() * 1e3;
    let measured = measure(&mut simulator, scene, frames)?;
    let counters = simulator.counters().into_diagnostic()?;
    let sizes = Sizes::of(&simulator);
    let paths = scene.simulation.paths;
    let mut table = Table::new(
        format!(
            "{name}, {tracer}, {paths} paths: median ms of {frames} frames; the frame {} ms on the device, \
             its pixels after {} ms (p95 {}); {} rays, {} segments, {} scatterer cells, {} deposits",
            ms(measured.device.median),
            ms(measured.latency.median),
            ms(measured.latency.p95),
            counters.rays,
            counters.segments,
            counters.candidates,
            counters.deposits,
        ),
        &["stage", "ms", "MB", "GB/s", "million operations", "G/s"],
    );
    let mut stages = serde_json::Map::new();
    for (stage, time) in &measured.stages {
        let work = work(stage, &sizes, &counters);
        let rate = |amount: f64| amount / time.median / 1e6;
        let cell = |value: Option<f64>| value.map_or("-".into(), ms);
        table.add(vec![
            stage.clone(),
            ms(time.median),
            cell(work.map(|w| w.bytes / 1e6)),
            cell(work.map(|w| rate(w.bytes))),
            cell(work.map(|w| w.operations / 1e6)),
            cell(work.map(|w| rate(w.operations))),
        ]);
        stages.insert(
            stage.clone(),
            json!({
                "ms": time.median,
                "bytes": work.map(|w| w.bytes),
                "operations": work.map(|w| w.operations),
            }),
        );
    }
    table.print();
    output::line("");
    Ok(json!({
        "scene": name, "tracer": tracer.to_string(), "paths": paths, "frames": frames,
        "triangles": scene.triangles(), "build_ms": build,
        "device_ms": measured.device, "latency_ms": measured.latency, "stages": stages,
        "counters": {
            "rays": counters.rays, "interactions": counters.interactions,
            "segments": counters.segments, "candidates": counters.candidates,
            "deposits": counters.deposits, "saturated": counters.saturated,
            "segments_dropped": counters.segments_dropped,
        },
    }))
}

fn measure(simulator: &mut Simulator, scene: &Scene, frames: u32) -> Result<Measured> {
    let (mut stages, mut device, mut latency) = (Vec::<(String, Vec<f64>)>::new(), vec![], vec![]);
    for index in 0..=frames {
        let began = Instant::now();
        simulator.frame(scene, index).into_diagnostic()?;
        simulator.pixels().into_diagnostic()?;
        let elapsed = began.elapsed().as_secs_f64() * 1e3;
        let finished = simulator.wait().into_diagnostic()?;
        // The first frame may include the driver's compilation.
        if index == 0 {
            continue;
        }
        latency.push(elapsed);
        for frame in finished {
            device.push(frame.total_ms());
            // A stage that runs more than once counts whole.
            let mut seen: Vec<&str> = Vec::new();
            for (name, _) in &frame.passes {
                if seen.contains(&name.as_str()) {
                    continue;
                }
                seen.push(name);
                let time = frame.of(name);
                match stages.iter_mut().find(|(known, _)| known == name) {
                    Some((_, times)) => times.push(time),
                    None => stages.push((name.clone(), vec![time])),
                }
            }
        }
    }
    let of = |(name, times): (String, Vec<f64>)| (name, Statistics::of(times));
    Ok(Measured {
        stages: stages.into_iter().map(of).collect(),
        device: Statistics::of(device),
        latency: Statistics::of(latency),
    })
}

/// Sizes that determine the work of a frame.
struct Sizes {
    /// Number of lines: scanlines times layers.
    lines: f64,
    /// Samples of one of them, and of all scanlines.
    per_line: f64,
    samples: f64,
    pixels: f64,
    /// Mean taps of the lateral and of the axial kernel.
    taps: [f64; 2],
}

impl Sizes {
    fn of(simulator: &Simulator) -> Self {
        let (frame, rows) = (simulator.constants(), &simulator.tables().rows);
        let [scanlines, layers, samples, width, height] =
            [frame.scanlines, frame.layers, frame.samples, frame.image_width, frame.image_height]
                .map(f64::from);
        let taps = |sigma: f32, deviations: f64, most: f64| {
            2.0 * (deviations * f64::from(sigma)).ceil().min(most) + 1.0
        };
        // Of surfaces and of scatterers.
        let lateral = rows.iter().flat_map(|row| {
            [row.lateral_lines, row.strip_lines].map(|lines| taps(lines, 3.0, 16.0))
        });
        Self {
            lines: scanlines * layers,
            per_line: samples,
            samples: scanlines * samples,
            pixels: width * height,
            taps: [lateral.sum::<f64>() / samples, taps(frame.axial_sigma, 4.0, 32.0)],
        }
    }
}

/// Bytes to and from memory where every value is moved once, and operations.
#[derive(Clone, Copy)]
struct Work {
    bytes: f64,
    operations: f64,
}

/// Returns the work of a stage, counted by hand from the kernels, to be compared with the device's limits;
/// none for stages whose work depends on the path through a tree. An operation is an addition, a
/// multiplication or a comparison; a logarithm, exponential, cosine or root counts as ten.
fn work(stage: &str, sizes: &Sizes, counters: &Counters) -> Option<Work> {
    let Sizes { lines, per_line, samples, pixels, taps: [lateral, axial] } = *sizes;
    let (bytes, operations) = match stage {
        // Segments read, both integers of a sample flushed per line; a cell is hashed and placed, an
        // accepted one weighed and deposited.
        "scatter" => (
            80.0 * f64::from(counters.segments) + 8.0 * per_line * lines,
            20.0 * f64::from(counters.candidates) + 90.0 * f64::from(counters.deposits),
        ),
        // Two accumulators in, baseband out (points have a third, where there are some); a multiplication and an addition
        // for each part and for the weight, and the noise.
        "beam" => (24.0 * samples, (6.0 * lateral + 100.0) * samples),
        // Baseband in, IQ and level out.
        "axial" => (20.0 * samples, (4.0 * axial + 35.0) * samples),
        "display" => (4.0 * samples + 4.0 * pixels, 60.0 * pixels),
        // How much `convert` and `blur` do depends on the border's length.
        "fuse" => (12.0 * samples + 4.0 * pixels, 65.0 * pixels),
        _ => return None,
    };
    Some(Work { bytes, operations })
}
