//! Arguments and actions common to all commands that simulate.

use std::io::{IsTerminal, stderr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::builder::{PathBufValueParser, TypedValueParser};
use miette::{IntoDiagnostic, Report, Result, miette};

use insonify::gpu::{Device, DeviceOptions, GpuError, cache_folder};
use insonify::output;
use insonify::scene::file::{self, override_of};
use insonify::scene::{Scene, shipped};
use insonify::settings::{Quality, Simulation};
use insonify::sim::calibration::Work;
use insonify::sim::layout::Counters;
use insonify::sim::shaders::Library;
use insonify::sim::{self, SimError, Simulator, Tracer};

mod writing;

pub use writing::{distinct, writable, writable_folder, write_json, write_sidecar};

/// Arguments of every command that simulates.
#[derive(Clone, Debug, clap::Args)]
pub struct Common {
    /// Path and scatterer counts that suit the device [default: the scene's own]. Counts that --set
    /// gives stay.
    #[arg(long, value_enum)]
    pub quality: Option<Quality>,
    /// Time of the first frame: seconds, or with a unit, e.g. "400 ms".
    #[arg(long, default_value = "0", value_parser = seconds, allow_hyphen_values = true)]
    pub time: f64,
    /// Seed of every random number; replaces the scene's.
    #[arg(long)]
    pub seed: Option<u32>,
    /// Puts the probe to a named pose of the scene file ([[pose]]).
    #[arg(long, value_name = "NAME")]
    pub pose: Option<String>,
    /// Tracer.
    #[arg(long, value_enum, default_value = "auto")]
    pub tracer: TracerChoice,
    /// Vulkan device: part of its name, or its index in `insonify info`.
    #[arg(long)]
    pub device: Option<String>,
    /// The paper's way where the scene's differs: sampling, surfaces, scatterers, fusion, selector nodes
    /// (docs/paper.md). What --set gives stays.
    #[arg(long)]
    pub paper: bool,
    /// Overrides an entry of the scene file, e.g. --set simulation.paths=32 --set probe.depth="80 mm".
    #[arg(long = "set", value_name = "PATH=VALUE", value_parser = override_of)]
    pub overrides: Vec<(String, String)>,
    /// Runs with Vulkan's validation layers and fails on any message.
    #[arg(long)]
    pub validate: bool,
}

/// A scene on a device.
pub struct Stage {
    /// The device.
    pub device: Arc<Device>,
    /// The tracer that follows the rays.
    pub tracer: Tracer,
    /// The scene's simulator.
    pub simulator: Simulator,
    /// Time to upload the scene and to build its structures, ms.
    pub upload_ms: f64,
}

/// Which tracer follows the rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TracerChoice {
    /// Ray query where the device has it in hardware, else the compute BVH.
    Auto,
    /// The device's ray-tracing hardware, or its emulation.
    RayQuery,
    /// Our BVH in a compute kernel; runs everywhere.
    Bvh,
}

/// Parser of a scene file on the command line: a path, or the name of a scene that ships.
pub fn scene_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| shipped::find(&path))
}

/// A time on the command line, s.
pub fn seconds(text: &str) -> Result<f64, String> {
    insonify::settings::units::DURATION.finite(text)
}

/// Parser of a number from `least` to `most` on the command line.
pub fn between(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
        match (least..=most).contains(&value) {
            true => Ok(value),
            false => Err(format!("it must lie between {least} and {most}")),
        }
    }
}

impl Common {
    /// The requested device.
    ///
    /// # Errors
    /// No device of that name, or none at all.
    pub fn device(&self) -> Result<Arc<Device>> {
        Device::new(&DeviceOptions {
            without_acceleration_structures: self.tracer == TracerChoice::Bvh,
            ..self.device_options()
        })
        .into_diagnostic()
    }

    /// Options for the requested device, for both tracers.
    pub fn device_options(&self) -> DeviceOptions {
        DeviceOptions {
            selector: self.device.clone(),
            validate: self.validate,
            kept_in: cache_folder(),
            ..DeviceOptions::default()
        }
    }

    /// The tracer to use for `scene`; `auto` tries the device's ray query on it, and says in one line why
    /// it falls back.
    ///
    /// # Errors
    /// The device has no ray query.
    pub fn tracer(&self, device: &Arc<Device>, scene: &Scene) -> Result<Tracer> {
        let wanted = match self.tracer {
            // The selector nodes of `--paper` need the compute tracer.
            TracerChoice::Auto if self.paper => Some(Tracer::Bvh),
            TracerChoice::Auto => None,
            TracerChoice::RayQuery => Some(Tracer::RayQuery),
            TracerChoice::Bvh => Some(Tracer::Bvh),
        };
        if wanted == Some(Tracer::RayQuery) && !device.supports_ray_query() {
            return Err(miette!(
                help = "use --tracer bvh, which runs everywhere, or another --device",
                "{} has no ray query",
                device.name()
            ));
        }
        let (tracer, why) = Tracer::choose(wanted, device, &Library::embedded(), scene);
        if let Some(why) = why {
            output::note(why);
        }
        Ok(tracer)
    }

    /// Puts a loaded scene on the requested device, with its seed, time and quality set.
    ///
    /// # Errors
    /// No such device or tracer, or one for which the scene is too large.
    pub fn stage(&self, scene: &mut Scene, library: &Library) -> Result<Stage> {
        let device = self.device()?;
        let tracer = self.tracer(&device, scene)?;
        self.settle(scene, &device);
        let began = Instant::now();
        let simulator = simulator(&device, library, scene, tracer)?;
        let upload_ms = began.elapsed().as_secs_f64() * 1e3;
        Ok(Stage { device, tracer, simulator, upload_ms })
    }

    /// Overrides of the scene file at `path`: by `--paper` and `--pose`, and by `--set` after that.
    ///
    /// # Errors
    /// The file has no such pose.
    pub fn overrides(&self, path: &Path) -> Result<Vec<(String, String)>> {
        let selectors = self.tracer != TracerChoice::RayQuery;
        let mut all = match self.paper {
            true => file::paper(path, selectors),
            false => Vec::new(),
        };
        if let Some(name) = &self.pose {
            all.push(file::named_pose(path, name)?);
        }
        all.extend(self.overrides.iter().cloned());
        Ok(all)
    }

    /// Loads a scene with the overrides, and prints its warnings on standard error.
    ///
    /// # Errors
    /// The fault of the file.
    pub fn scene(&self, path: &Path) -> Result<Scene> {
        let (scene, warnings) = Scene::load(path, &self.overrides(path)?)?;
        notes(&warnings);
        Ok(scene)
    }

    /// Sets seed, time and quality of a loaded scene.
    pub fn settle(&self, scene: &mut Scene, device: &Device) {
        self.settle_simulation(&mut scene.simulation, device);
        scene.set_time(self.time);
    }

    /// Sets seed and quality in the settings of a loaded scene.
    pub fn settle_simulation(&self, simulation: &mut Simulation, device: &Device) {
        if let Some(seed) = self.seed {
            simulation.seed = seed;
        }
        if let Some(quality) = self.quality {
            let by_hand = self.overrides.iter().map(|(path, _)| path.as_str());
            simulation.set_quality_except(quality, sim::machine(device), by_hand);
        }
    }

    /// Fails on any message of the validation layers, where they were asked for.
    ///
    /// # Errors
    /// The first message.
    pub fn validated(&self, device: &Device) -> Result<()> {
        let messages = device.validation_messages();
        match messages.first() {
            Some(first) if self.validate => {
                Err(miette!("{} validation messages, the first: {first}", messages.len()))
            }
            _ => Ok(()),
        }
    }
}

/// Writes each of these to standard error.
pub fn notes<T: std::fmt::Display>(all: impl IntoIterator<Item = T>) {
    all.into_iter().for_each(output::note);
}

/// Uploads a scene, and reports on standard error which parts of it the device had to change.
///
/// # Errors
/// An error of the device.
pub fn simulator(
    device: &Arc<Device>,
    library: &Library,
    scene: &Scene,
    tracer: Tracer,
) -> Result<Simulator> {
    if let Some(Work { too_much, message, remedy }) = Work::of(scene) {
        if too_much {
            return Err(miette!(help = remedy, "{message}"));
        }
        output::note(format!("warning: {message}; {remedy}"));
    }
    let simulator = match Simulator::new(device, library, scene, tracer) {
        Err(SimError::Gpu(error @ GpuError::TooLarge { .. })) => return Err(too_large(&error)),
        made => made.into_diagnostic()?,
    };
    if let Some(warning) = simulator.warning() {
        output::note(format!("warning: {warning}"));
    }
    Ok(simulator)
}

/// The error of a device for which a scene is too large, with what to lower.
fn too_large(error: &GpuError) -> Report {
    let help = match error {
        GpuError::TooLarge { name, .. } if name == "pixels" => "lower imaging.image_height",
        _ => {
            "choose another device; or lower probe.scanlines, probe.samples and \
             simulation.max_interactions, or reduce the meshes"
        }
    };
    miette!(help = help, "{error}")
}

/// The losses of a frame, each with a remedy.
pub fn lost(counters: &Counters) -> Vec<String> {
    let mut out = Vec::new();
    if counters.saturated > 0 {
        out.push(format!(
            "{} samples saturated; lower surface_gain or speckle_gain",
            counters.saturated
        ));
    }
    if counters.segments_dropped > 0 {
        out.push(format!(
            "{} path segments did not fit and were dropped; lower simulation.max_interactions",
            counters.segments_dropped
        ));
    }
    if counters.stack_overflow > 0 {
        out.push(format!(
            "{} crossings of more than 16 nested meshes were ignored",
            counters.stack_overflow
        ));
    }
    out
}

/// The warning about a masking mesh that lies off the image.
pub fn unseen(scene: &Scene, mask: usize) -> String {
    format!(
        "the mask `{}` never meets the image: nothing is simulated in it; move the mesh or the probe",
        scene.instances[mask].name
    )
}

/// Time without a word of progress, s.
const QUIET: f64 = 1.0;

/// Progress on standard error: a line that is written over, where that is a terminal.
pub struct Progress {
    count: u32,
    noun: String,
    start: Instant,
    /// Time at which the line is written next, s.
    next: f64,
}

impl Progress {
    /// Progress of `count` items, each a `noun`.
    pub fn new(count: u32, noun: &str) -> Self {
        Self { count, noun: noun.to_owned(), start: Instant::now(), next: QUIET }
    }

    /// Shows that `count` items are done.
    pub fn done(&mut self, count: u32) {
        let gone = self.start.elapsed().as_secs_f64();
        if gone >= self.next && stderr().is_terminal() {
            self.next = gone + 0.1;
            let left = gone / f64::from(count.max(1)) * f64::from(self.count.saturating_sub(count));
            // The end of a longer line before it is erased (ECMA-48, EL).
            output::progress(format!(
                "\r{count}/{} {}, {left:.0} s left\x1b[K",
                self.count, self.noun
            ));
        }
    }

    /// Ends the display: all items are done.
    pub fn finish(self) {
        if self.next > QUIET {
            output::progress("\r\x1b[K");
        }
    }
}
