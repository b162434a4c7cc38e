//! Runs single kernels against their f64 twins:
//! `cargo run --release --bin kernels -- list | run NAME [--input DIR] [--output DIR] | check | compile`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use clap::{Parser, Subcommand, ValueEnum};
use insonify::gpu::{self, Device, DeviceOptions, Kernel, prepare_process};
use insonify::output;
use insonify::sim::layout::{ROLE_BRANCHES, ROLE_MAIN, ROLE_WHOLE};
use insonify::sim::rounds::Round;
use insonify::sim::shaders::Library;
use insonify_tools::harness::{self, Case, SUBJECTS, Size, Subject, dump};
use miette::{Context, IntoDiagnostic, Result, miette};

/// Runs of which the fastest is reported.
const REPEATS: usize = 5;

#[derive(Parser)]
#[command(about = "Runs one kernel alone and compares it with its f64 twin")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Index or part of the name of the Vulkan device.
    #[arg(long, global = true)]
    device: Option<String>,
    /// Turns the validation layers on.
    #[arg(long, global = true)]
    validate: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Names every kernel with its variants, bindings and tolerance.
    List,
    /// Runs one kernel, prints its error and its time.
    Run {
        /// Name of the kernel, see `list`.
        name: String,
        /// Folder with NAME.npy for the bindings to replace.
        #[arg(long)]
        input: Option<PathBuf>,
        /// Folder that gets every binding as NAME.npy, before and after the run.
        #[arg(long)]
        output: Option<PathBuf>,
        /// Size of the random inputs.
        #[arg(long, value_enum, default_value = "standard")]
        size: Extent,
    },
    /// Runs kernels on every case; fails where one differs from its twin.
    Check {
        /// Names of kernels, see `list` [default: all].
        names: Vec<String>,
        /// Cases [default: all].
        #[arg(long = "case", value_enum)]
        cases: Vec<Case>,
    },
    /// Compiles every kernel and variant, each in a process of its own; fails where the driver's compiler ends its
    /// process. Other widths of Mesa's vectors: LP_NATIVE_VECTOR_WIDTH, with a MESA_SHADER_CACHE_DIR of its own.
    Compile,
}

#[derive(Clone, Copy, ValueEnum)]
enum Extent {
    /// A few scanlines.
    Small,
    /// The paper's Table I.
    Standard,
}

fn main() -> ExitCode {
    prepare_process();
    insonify::issue::tell_errors();
    insonify::output::exit(program())
}

fn program() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let library = Library::embedded();
    if let Command::List = arguments.command {
        list(&library);
        return Ok(ExitCode::SUCCESS);
    }
    let device = Device::new(&DeviceOptions {
        selector: arguments.device.clone(),
        validate: arguments.validate,
        ..Default::default()
    })
    .into_diagnostic()?;
    output::line(format_args!("{} ({})", device.name(), device.driver()));
    let passed = match arguments.command {
        Command::List => true,
        Command::Run { name, input, output, size } => {
            let subject = find(&name, &library)?;
            let size = match size {
                Extent::Small => Size::Small,
                Extent::Standard => Size::Standard,
            };
            run(&device, &library, subject, size, input.as_deref(), output.as_deref())?
        }
        Command::Check { names, cases } => {
            let all = SUBJECTS.iter().map(Ok).collect();
            let named = || names.iter().map(|name| find(name, &library)).collect();
            let subjects: Result<Vec<_>> = if names.is_empty() { all } else { named() };
            let cases = if cases.is_empty() { &Case::ALL[..] } else { &cases };
            check(&device, &library, &subjects?, cases)?
        }
        Command::Compile => compile(&device, &library),
    };
    let messages = device.validation_messages();
    for message in &messages {
        eprintln!("validation: {message}");
    }
    Ok(ExitCode::from(u8::from(!passed || !messages.is_empty())))
}

fn find(name: &str, library: &Library) -> Result<&'static Subject> {
    let names: Vec<_> = SUBJECTS.iter().map(|s| s.name).collect();
    let found = SUBJECTS.iter().find(|s| s.name == name || s.stems(library).contains(&name));
    found.ok_or_else(|| miette!("no kernel '{name}'; there are {}", names.join(", ")))
}

fn list(library: &Library) {
    for subject in &SUBJECTS {
        let bindings: Vec<_> =
            (subject.job)(Case::One, Size::Small).inputs.iter().map(|i| i.name).collect();
        output::line(format_args!("{:<9} {}", subject.name, subject.stems(library).join(" ")));
        output::line(format_args!("          bindings:  {}", bindings.join(" ")));
        output::line(format_args!("          tolerance: {}", subject.tolerance));
    }
}

/// Variants of a subject that the device can run.
fn kernels(device: &Arc<Device>, library: &Library, subject: &Subject) -> Result<Vec<Kernel>> {
    let mut kernels = Vec::new();
    for stem in subject.stems(library) {
        if stem.ends_with("_query") && !device.supports_ray_query() {
            output::line(format_args!("{stem}: not run, the device has no ray query"));
            continue;
        }
        kernels.push(Kernel::new(device, stem, library.words(stem), &[]).into_diagnostic()?);
    }
    Ok(kernels)
}

fn run(
    device: &Arc<Device>,
    library: &Library,
    subject: &Subject,
    size: Size,
    input: Option<&Path>,
    output: Option<&Path>,
) -> Result<bool> {
    let mut job = (subject.job)(Case::Random, size);
    if let Some(dir) = input {
        let found = dump::read(dir, subject, &mut job).map_err(|e| miette!("{e}"))?;
        output::line(format_args!("from {}: {}", dir.display(), found.join(", ")));
    }
    output::line(format_args!("tolerance: {}", subject.tolerance));
    let extent = subject.extent(&job);
    let mut passed = true;
    for kernel in kernels(device, library, subject)? {
        let mut fastest = f64::INFINITY;
        let mut outputs = Vec::new();
        for _ in 0..REPEATS {
            let outcome = harness::run(device, &kernel, &job, &extent).into_diagnostic()?;
            fastest = fastest.min(outcome.milliseconds);
            outputs = outcome.outputs;
        }
        output::line(format_args!("{}: {fastest:.3} ms, fastest of {REPEATS}", kernel.name()));
        let start = Instant::now();
        for check in (subject.check)(&job, &outputs) {
            output::line(format_args!("  {check}"));
            passed &= check.passed();
        }
        output::line(format_args!(
            "  twin: {:.0} ms on one CPU core",
            start.elapsed().as_secs_f64() * 1e3
        ));
        if let Some(dir) = output {
            let before: Vec<_> = job.inputs.iter().map(|i| i.bytes.clone()).collect();
            for (when, contents) in [("before", &before), ("after", &outputs)] {
                let dir = dir.join(kernel.name()).join(when);
                let written = dump::write(&dir, &job, contents).into_diagnostic();
                written.wrap_err_with(|| format!("writing {}", dir.display()))?;
            }
        }
    }
    Ok(passed)
}

fn check(
    device: &Arc<Device>,
    library: &Library,
    subjects: &[&Subject],
    cases: &[Case],
) -> Result<bool> {
    let mut passed = true;
    for subject in subjects {
        for kernel in kernels(device, library, subject)? {
            for &case in cases {
                let job = (subject.job)(case, Size::Small);
                let extent = subject.extent(&job);
                let outcome = harness::run(device, &kernel, &job, &extent).into_diagnostic()?;
                output::line(format_args!(
                    "{} {case:?}: {:.3} ms",
                    kernel.name(),
                    outcome.milliseconds
                ));
                for check in (subject.check)(&job, &outcome.outputs) {
                    output::line(format_args!("  {check}"));
                    passed &= check.passed();
                }
            }
        }
    }
    Ok(passed)
}

fn compile(device: &Arc<Device>, library: &Library) -> bool {
    let mut passed = true;
    for stem in library.stems() {
        let roles: &[u32] = match stem.starts_with("trace_") {
            true => &[ROLE_WHOLE, ROLE_MAIN, ROLE_BRANCHES],
            false => &[ROLE_WHOLE],
        };
        for &role in roles {
            let constants = if roles.len() > 1 { Round::constants(role) } else { &[] };
            if stem.ends_with("_query") && !device.supports_ray_query() {
                output::line(format_args!("{stem}: not compiled, the device has no ray query"));
                continue;
            }
            let start = Instant::now();
            let result = gpu::try_kernel(device, stem, library.words(stem), constants);
            let seconds = start.elapsed().as_secs_f64();
            let name = if roles.len() > 1 { format!("{stem} {role}") } else { stem.to_owned() };
            match &result {
                Ok(true) => output::line(format_args!("{name:<20} {seconds:6.2} s")),
                Ok(false) => output::line(format_args!("{name:<20} WRONG: refused")),
                Err(error) => output::line(format_args!("{name:<20} WRONG: {error}")),
            }
            passed &= matches!(result, Ok(true));
        }
    }
    passed
}
