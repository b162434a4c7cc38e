//! Measures the costs of animation (acceleration structures rebuilt, against those that are switched),
//! the saving by fusion with an acquired volume, and the time of each stage of a frame.
//!
//! ```text
//! cargo run --release --bin profile -- strategies scenes/heart.toml
//! cargo run --release --bin profile -- crossover
//! cargo run --release --bin profile -- crossover --splits --tracer bvh
//! cargo run --release --bin profile -- paper --json paper.json
//! cargo run --release --bin profile -- stages scenes/*.toml
//! ```
//! Times are the device's own; what the processor does for a frame (recording, and the trees of the
//! compute tracer) is counted with them. Compared runs take turns frame by frame, so that a machine
//! that slows down slows all of them.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand};
use insonify::gpu::{Device, DeviceOptions, prepare_process};
use insonify::output;
use insonify::sim::Tracer;
use insonify::sim::shaders::Library;
use insonify_tools::provenance::Provenance;
use miette::{IntoDiagnostic, Result, miette};

#[path = "profile/builds.rs"]
mod builds;
#[path = "profile/crossover.rs"]
mod crossover;
#[path = "profile/fusion.rs"]
mod fusion;
#[path = "profile/measure.rs"]
mod measure;
#[path = "profile/paper.rs"]
mod paper;
#[path = "profile/splits.rs"]
mod splits;
#[path = "profile/stages.rs"]
mod stages;
#[path = "profile/strategies.rs"]
mod strategies;
#[path = "profile/table.rs"]
mod table;

/// Measures what frames, animation and fusion cost on this machine.
#[derive(Parser)]
#[command(name = "profile")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Vulkan device: part of its name, or its index in `insonify info`.
    #[arg(long, global = true)]
    device: Option<String>,
    /// Tracer [default: every one that the device has].
    #[arg(long, global = true, value_enum)]
    tracer: Option<TracerChoice>,
    /// Folder for CSV, JSON and plots.
    #[arg(short, long, global = true, default_value = "target/profile")]
    output: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TracerChoice {
    RayQuery,
    Bvh,
}

#[derive(Subcommand)]
enum Command {
    /// Every strategy over the motion of a scene.
    Strategies(strategies::Arguments),
    /// Range in which rebuilding is faster than selecting, over the distance between keyframes and their triangles.
    Crossover(crossover::Arguments),
    /// Tables I to III of Starkov et al. 2019, beside the paper's numbers.
    Paper(paper::Arguments),
    /// Time of each stage of a frame, with its bytes and operations, and the time of a picture.
    Stages(stages::Arguments),
    /// Acceleration structures of the device alone.
    Builds(builds::Arguments),
}

/// Device, shaders, tracers and output folder of all measurements.
struct Machine {
    device: Arc<Device>,
    library: Library,
    tracers: Vec<Tracer>,
    output: PathBuf,
    provenance: Provenance,
}

fn main() -> ExitCode {
    prepare_process();
    insonify::issue::tell_errors();
    insonify::output::exit(program())
}

fn program() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let device = Device::new(&DeviceOptions {
        selector: arguments.device.clone(),
        ..DeviceOptions::default()
    })
    .into_diagnostic()?;
    let tracers = match arguments.tracer {
        Some(TracerChoice::Bvh) => vec![Tracer::Bvh],
        Some(TracerChoice::RayQuery) if !device.supports_ray_query() => {
            return Err(miette!(
                help = "use --tracer bvh, or another --device",
                "{} has no ray query",
                device.name()
            ));
        }
        Some(TracerChoice::RayQuery) => vec![Tracer::RayQuery],
        None if device.supports_ray_query() => vec![Tracer::Bvh, Tracer::RayQuery],
        None => vec![Tracer::Bvh],
    };
    let machine = Machine {
        provenance: Provenance::of(&device),
        device,
        library: Library::embedded(),
        tracers,
        output: arguments.output,
    };
    output::line(&machine.provenance);
    match arguments.command {
        Command::Strategies(arguments) => strategies::run(&machine, &arguments)?,
        Command::Crossover(arguments) => crossover::run(&machine, &arguments)?,
        Command::Paper(arguments) => paper::run(&machine, &arguments)?,
        Command::Stages(arguments) => stages::run(&machine, &arguments)?,
        Command::Builds(arguments) => builds::alone(&machine, &arguments)?,
    }
    Ok(ExitCode::SUCCESS)
}
