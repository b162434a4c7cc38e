//! `insonify dataset`: labelled samples by a plan, shard by shard.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use miette::{IntoDiagnostic, Result, miette};

use super::common::{self, Progress, TracerChoice};
use insonify::dataset::layouts::{self, Layout, Licence};
use insonify::dataset::{DatasetError, Event, Format, Made, Part, Plan, Run, Store, Studio};
use insonify::gpu::{Device, DeviceOptions, cache_folder, peak_bytes};
use insonify::output;
use insonify::settings::suggest;
use insonify::sim::Tracer;

/// Arguments of `insonify dataset`.
#[derive(Debug, Args)]
pub struct Dataset {
    /// The plan (.toml): scenes, poses, ranges of settings, counts, splits and formats; with --layout the folder of a
    /// finished data set
    plan: PathBuf,
    /// Folder of the data set; shards may share it. With --layout the new folder, or the table (.csv)
    #[arg(short, long)]
    output: PathBuf,
    /// Makes only shard I of N, counted from 0: the same bytes as in the whole.
    #[arg(long, value_name = "I/N", value_parser = shard, default_value = "0/1")]
    shard: [u32; 2],
    /// Goes on with what a run that was stopped left of this shard; the result is the same.
    #[arg(long)]
    resume: bool,
    /// Checks the plan, says what it makes, and makes a sample of each scene for a trial: time, files and bytes of all.
    #[arg(long)]
    check: bool,
    /// Writes a finished data set once more in the layout of nnU-Net, COCO or Hugging Face, or as a table of its samples.
    #[arg(long, value_name = "LAYOUT", value_parser = layout, conflicts_with_all = ["check", "resume", "shard"])]
    layout: Option<Layout>,
    /// The licence that the card of a layout states, such as cc-by-4.0.
    #[arg(long, requires = "layout")]
    licence: Option<String>,
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

fn layout(text: &str) -> Result<Layout, String> {
    let found = Layout::ALL.into_iter().find(|layout| layout.word() == text);
    found.ok_or_else(|| suggest::among(text, Layout::ALL.map(Layout::word).into_iter()))
}

/// Writes a finished data set in a layout.
fn laid_out(args: &Dataset, layout: Layout) -> Result<()> {
    let licence = Licence::new(args.licence.clone());
    let mut progress: Option<Progress> = None;
    layouts::write(&args.plan, layout, &licence, &args.output, &mut |done, of| {
        let shown = progress.get_or_insert_with(|| Progress::new(of as u32, "samples"));
        shown.done(done as u32);
    })?;
    if let Some(progress) = progress {
        progress.finish();
    }
    output::line(args.output.display());
    Ok(())
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Dataset) -> Result<()> {
    if let Some(layout) = args.layout {
        return laid_out(args, layout);
    }
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
        if parts.is_empty() {
            return Ok(());
        }
        return match device(args) {
            Ok((device, tracer)) => tried(&plan, &args.output, &parts, &device, tracer),
            Err(error) => {
                output::note(format!("how long it takes is not known: {error}"));
                Ok(())
            }
        };
    }
    if parts.is_empty() {
        let ([index, count], all) = (args.shard, plan.parts().len());
        output::note(format!(
            "the plan has {all} parts: shard {index} of {count} has none of them"
        ));
        return Ok(());
    }
    let (device, wanted) = device(args)?;
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

/// The device that was asked for, and its tracer where that was.
fn device(args: &Dataset) -> Result<(Arc<Device>, Option<Tracer>)> {
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
    Ok((device, wanted))
}

/// Makes a sample of each scene twice, of which the second says what the others take, and prints that for the shard.
fn tried(
    plan: &Plan,
    root: &Path,
    parts: &[Part],
    device: &Arc<Device>,
    tracer: Option<Tracer>,
) -> Result<()> {
    let store = Store::new(plan, root);
    let mut studio = Studio::new(plan, device, tracer);
    let (mut seconds, mut files, mut bytes) = (0.0, 0, 0);
    for ([first, second], count) in plan.scenes_of(parts) {
        // The first one includes what is made once.
        studio.make(first)?;
        let began = Instant::now();
        let made = studio.make(second)?;
        seconds += began.elapsed().as_secs_f64() * f64::from(count);
        let [own, weight] = store.weight(&made);
        files += own * u64::from(count);
        bytes += weight * u64::from(count);
    }
    let archives = if plan.formats.contains(&Format::WebDataset) { parts.len() } else { 0 };
    output::line(format!(
        "about {}, {} in {} files, by a trial on {}",
        time(seconds),
        size(bytes),
        files + archives as u64,
        device.name()
    ));
    Ok(())
}

/// A time in words.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} hours", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// Bytes in words.
fn size(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b if b < 1e12 => format!("{:.1} GB", b / 1e9),
        b => format!("{:.2} TB", b / 1e12),
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
