//! `insonify dataset`: labelled samples by a plan, shard by shard.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use miette::{IntoDiagnostic, Result, miette};

use super::common::{self, Progress, TracerChoice};
use insonify::dataset::{DatasetError, Event, Made, Part, Plan, Run, Store};
use insonify::gpu::{Device, DeviceOptions, cache_folder, peak_bytes};
use insonify::output;
use insonify::sim::Tracer;

/// Arguments of `insonify dataset`.
#[derive(Debug, Args)]
pub struct Dataset {
    /// The plan (.toml): scenes, poses, ranges of settings, counts, splits and formats.
    plan: PathBuf,
    /// Folder of the data set. Shards may share it.
    #[arg(short, long)]
    output: PathBuf,
    /// Makes only shard I of N, counted from 0: the same bytes as in the whole.
    #[arg(long, value_name = "I/N", value_parser = shard, default_value = "0/1")]
    shard: [u32; 2],
    /// Goes on with what a run that was stopped left of this shard; the result is the same.
    #[arg(long)]
    resume: bool,
    /// Checks the plan and says what it makes, and makes nothing.
    #[arg(long)]
    check: bool,
    /// Tracer.
    #[arg(long, value_enum, default_value = "auto")]
    tracer: TracerChoice,
    /// Vulkan device: part of its name, or its index in `insonify info`.
    #[arg(long)]
    device: Option<String>,
    /// Runs with Vulkan's validation layers and fails on any message.
    #[arg(long)]
    validate: bool,
}

fn shard(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once('/').map(|(i, n)| [i, n].map(|part| part.trim().parse::<u32>()));
    match parts {
        Some([Ok(index), Ok(count)]) if index < count => Ok([index, count]),
        Some([Ok(_), Ok(count)]) if count > 0 => {
            Err(format!("shards are counted from 0: the last is {}/{count}", count - 1))
        }
        _ => Err("write it like 7/10".to_owned()),
    }
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Dataset) -> Result<()> {
    let (plan, warnings) = Plan::load(&args.plan)?;
    common::notes(&warnings);
    let run = Run { plan: &plan, root: &args.output, shard: args.shard, resume: args.resume };
    let checked = run.check()?;
    let (parts, samples) = (run.parts(), run.samples());
    if args.check {
        print_plan(&plan, &parts, samples);
        if checked < samples {
            output::line(format!(
                "the draws of {checked} of them were checked, evenly among them; the rest when they are made"
            ));
        }
        return Ok(());
    }
    if parts.is_empty() {
        let ([index, count], all) = (args.shard, plan.parts().len());
        output::note(format!(
            "the plan has {all} parts: shard {index} of {count} has none of them"
        ));
        return Ok(());
    }
    let device = Device::new(&DeviceOptions {
        without_acceleration_structures: args.tracer == TracerChoice::Bvh,
        selector: args.device.clone(),
        validate: args.validate,
        kept_in: cache_folder(),
        ..DeviceOptions::default()
    })
    .into_diagnostic()?;
    let wanted = match args.tracer {
        TracerChoice::Auto => None,
        TracerChoice::RayQuery if !device.supports_ray_query() => {
            return Err(miette!(
                help = "use --tracer bvh, which runs everywhere, or another --device",
                "{} has no ray query",
                device.name()
            ));
        }
        TracerChoice::RayQuery => Some(Tracer::RayQuery),
        TracerChoice::Bvh => Some(Tracer::Bvh),
    };
    let mut log = Log::new(samples);
    let sheet = run.make(&device, wanted, &mut |store, event| log.take(store, event))?;
    let rate = log.rate();
    log.progress.finish();
    output::line(format!(
        "{}: {} samples made, {} were there; {}",
        args.output.display(),
        log.made,
        log.kept,
        sheet.display()
    ));
    let mega = |bytes: u64| bytes as f64 / 1e6;
    let memory = peak_bytes().map_or(String::new(), |bytes| {
        format!(
            "; {:.0} MB of memory, and {:.0} MB on the device",
            mega(bytes),
            mega(device.memory().peak)
        )
    });
    output::line(format!(
        "{:.0} samples an hour; {:.1} MB in {}{memory}",
        rate,
        mega(held(&args.output)),
        args.output.display()
    ));
    let messages = device.validation_messages();
    match messages.first() {
        Some(first) if args.validate => {
            Err(miette!("{} validation messages, the first: {first}", messages.len()))
        }
        _ => Ok(()),
    }
}

/// Bytes of all files below a folder.
fn held(folder: &Path) -> u64 {
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of = |entry: std::fs::DirEntry| match entry.path() {
        path if path.is_dir() => held(&path),
        _ => entry.metadata().map_or(0, |facts| facts.len()),
    };
    all.map(of).sum()
}

/// Prints what a plan makes.
fn print_plan(plan: &Plan, parts: &[Part], samples: u32) {
    for split in &plan.splits {
        output::line(format!("{}: {} samples", split.name, split.samples.len()));
    }
    output::line(format!("{} classes: {}", plan.classes.len(), plan.classes.join(", ")));
    output::line(format!(
        "this shard: {} parts of {}, {samples} samples",
        parts.len(),
        plan.parts().len()
    ));
}

/// Progress, and a line for each part.
struct Log {
    progress: Progress,
    begun: Instant,
    made: u32,
    kept: u32,
    /// Kinds of losses that were told.
    lost: Vec<String>,
}

impl Log {
    fn new(samples: u32) -> Self {
        let progress = Progress::new(samples, "samples");
        Self { progress, begun: Instant::now(), made: 0, kept: 0, lost: Vec::new() }
    }

    /// Samples made in an hour.
    fn rate(&self) -> f64 {
        let hours = self.begun.elapsed().as_secs_f64() / 3600.0;
        f64::from(self.made) / hours.max(1e-9)
    }

    fn take(&mut self, store: &Store<'_>, event: Event<'_>) -> Result<(), DatasetError> {
        match event {
            Event::Made(made) => {
                self.made += 1;
                self.losses(store, made);
            }
            Event::Kept => self.kept += 1,
            Event::Part(part) => {
                let count = part.samples.len();
                output::line(format!(
                    "{}: {count} samples, {:.0} an hour",
                    store.part_name(part),
                    self.rate()
                ));
            }
        }
        self.progress.done(self.made + self.kept);
        Ok(())
    }

    /// Tells of each kind of loss once.
    fn losses(&mut self, store: &Store<'_>, made: &Made) {
        for lost in common::lost(&made.counters) {
            let kind = lost.trim_start_matches(|c: char| c.is_ascii_digit()).to_owned();
            if !self.lost.contains(&kind) {
                output::note(format!("warning: sample {}: {lost}", store.name(made.sample.number)));
                self.lost.push(kind);
            }
        }
    }
}
