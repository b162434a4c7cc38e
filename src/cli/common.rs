//! What commands that simulate take and do alike.

use std::io::{IsTerminal, stderr};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use miette::{IntoDiagnostic, Result, miette};

use insonify::gpu::{Device, DeviceOptions, cache_folder};
use insonify::scene::Scene;
use insonify::scene::file::{self, override_of};
use insonify::settings::{Quality, Simulation};
use insonify::sim::layout::Counters;
use insonify::sim::shaders::Library;
use insonify::sim::{self, Simulator, Tracer};

/// Arguments of every command that simulates.
#[derive(Clone, Debug, clap::Args)]
pub struct Common {
    /// Path and scatterer counts that suit the device [default: the scene's own]. Counts that --set
    /// gives stay.
    #[arg(long, value_enum)]
    pub quality: Option<QualityChoice>,
    /// Time of the first frame: seconds, or with a unit, e.g. "400 ms".
    #[arg(long, default_value = "0", value_parser = seconds, allow_hyphen_values = true)]
    pub time: f64,
    /// Seed of every random number; replaces the scene's.
    #[arg(long)]
    pub seed: Option<u32>,
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

/// `--quality`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum QualityChoice {
    /// A first look. Software driver: 2 paths, 5 scatterers per resolution cell. GPU: 8 paths, 8 scatterers.
    Draft,
    /// Software driver: 8 paths, 8 scatterers per resolution cell. GPU: 32 paths, 16 scatterers.
    Standard,
    /// A proof, on any device: 128 paths, lattice cells 2/3 as long, no scatterer left out.
    Reference,
}

/// A time on the command line, s.
pub fn seconds(text: &str) -> Result<f64, String> {
    insonify::scene::file::seconds(text)
}

impl Common {
    /// The device that was asked for.
    ///
    /// # Errors
    /// None of that name, or none at all.
    pub fn device(&self) -> Result<Arc<Device>> {
        Device::new(&DeviceOptions {
            without_acceleration_structures: self.tracer == TracerChoice::Bvh,
            ..self.device_options()
        })
        .into_diagnostic()
    }

    /// The device that was asked for, for both tracers.
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
            // Its selector nodes are the compute tracer's.
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
            eprintln!("{why}");
        }
        Ok(tracer)
    }

    /// What of the scene file at `path` is overridden: by `--paper`, and by `--set` after that.
    pub fn overrides(&self, path: &Path) -> Vec<(String, String)> {
        let selectors = self.tracer != TracerChoice::RayQuery;
        let of_paper = self.paper.then(|| file::paper(path, selectors));
        [of_paper.unwrap_or_default(), self.overrides.clone()].concat()
    }

    /// Loads a scene with the overrides, and says on standard error what it warns of.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn scene(&self, path: &Path) -> Result<Scene> {
        let (scene, warnings) = Scene::load(path, &self.overrides(path))?;
        for warning in &warnings {
            eprintln!("{warning}");
        }
        Ok(scene)
    }

    /// Puts seed, time and quality into a scene that was loaded.
    pub fn settle(&self, scene: &mut Scene, device: &Device) {
        self.settle_simulation(&mut scene.simulation, device);
        scene.set_time(self.time);
    }

    /// Puts seed and quality into the settings of a scene that was loaded.
    pub fn settle_simulation(&self, simulation: &mut Simulation, device: &Device) {
        if let Some(seed) = self.seed {
            simulation.seed = seed;
        }
        if let Some(quality) = self.quality {
            set_quality(simulation, quality, device, &self.overrides);
        }
    }

    /// Fails on what the validation layers said, where they were asked for.
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

/// Uploads a scene, and says on standard error what of it the device does not take as it is.
///
/// # Errors
/// What the device refuses.
pub fn simulator(
    device: &Arc<Device>,
    library: &Library,
    scene: &Scene,
    tracer: Tracer,
) -> Result<Simulator> {
    let simulator = Simulator::new(device, library, scene, tracer).into_diagnostic()?;
    if let Some(warning) = simulator.warning() {
        eprintln!("warning: {warning}");
    }
    Ok(simulator)
}

/// Takes the counts of `quality` for this device, but for those that the user set by hand.
fn set_quality(
    simulation: &mut Simulation,
    quality: QualityChoice,
    device: &Device,
    overrides: &[(String, String)],
) {
    let quality = match quality {
        QualityChoice::Draft => Quality::Draft,
        QualityChoice::Standard => Quality::Standard,
        QualityChoice::Reference => Quality::Reference,
    };
    let by_hand = simulation.clone();
    simulation.set_quality(quality, sim::machine(device));
    for (key, _) in overrides {
        match key.as_str() {
            "simulation.paths" => simulation.paths = by_hand.paths,
            "simulation.cell" => simulation.cell = by_hand.cell,
            "simulation.scatterers_per_resolution_cell" => {
                simulation.scatterers_per_resolution_cell = by_hand.scatterers_per_resolution_cell
            }
            "simulation.volume_floor" => simulation.volume_floor = by_hand.volume_floor,
            "simulation.branch_floor" => simulation.branch_floor = by_hand.branch_floor,
            _ => {}
        }
    }
}

/// What a frame lost, and what to do about it.
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

/// What to say of a masking mesh that lies off the image.
pub fn unseen(scene: &Scene, mask: usize) -> String {
    format!(
        "the mask `{}` never meets the image: nothing is simulated in it; move the mesh or the probe",
        scene.instances[mask].name
    )
}

/// How long nothing is said of progress, s.
const QUIET: f64 = 1.0;

/// Progress on standard error: a line that is written over, where that is a terminal.
pub struct Progress {
    count: u32,
    noun: String,
    start: Instant,
    /// When the line is written next, s.
    next: f64,
}

impl Progress {
    /// `count` of what is called `noun`.
    pub fn new(count: u32, noun: &str) -> Self {
        Self { count, noun: noun.to_owned(), start: Instant::now(), next: QUIET }
    }

    /// So many are done.
    pub fn done(&mut self, count: u32) {
        let gone = self.start.elapsed().as_secs_f64();
        if gone >= self.next && stderr().is_terminal() {
            self.next = gone + 0.1;
            let left = gone / f64::from(count.max(1)) * f64::from(self.count.saturating_sub(count));
            // The end of a longer line before it is erased (ECMA-48, EL).
            eprint!("\r{count}/{} {}, {left:.0} s left\x1b[K", self.count, self.noun);
        }
    }

    /// All are done.
    pub fn finish(self) {
        if self.next > QUIET {
            eprint!("\r\x1b[K");
        }
    }
}
