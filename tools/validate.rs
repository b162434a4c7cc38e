//! Every check of the validation table as a page:
//! `cargo run --release --features validate --bin validate [-- --output DIR] [--only T5,T9]` writes `index.html`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use insonify::gpu::{Device, DeviceOptions, prepare_process};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

// The tests' own modules: the page shows the very checks that they run.
#[path = "../tests/common"]
#[allow(dead_code, reason = "what other tests use of them")]
mod common {
    pub mod crossings;
    pub mod moments;
    pub mod signal;
    pub mod skip;
}
#[path = "../tests/physics/mod.rs"]
mod physics;

use physics::{check, page, rows};

#[derive(Parser)]
#[command(about = "Runs every physics check and writes the validation report")]
struct Arguments {
    /// Folder that gets index.html.
    #[arg(long, default_value = "target/validation")]
    output: PathBuf,
    /// Rows to run, such as T5,T9; all without it.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Index or part of the name of the Vulkan device.
    #[arg(long)]
    device: Option<String>,
    /// Turns the validation layers on.
    #[arg(long)]
    validate: bool,
}

fn main() -> ExitCode {
    prepare_process();
    insonify::issue::tell_errors();
    insonify::output::exit(program())
}

fn program() -> Result<ExitCode> {
    let arguments = Arguments::parse();
    let mut checks = rows::all();
    let rows: Vec<&str> = checks.iter().map(|c| c.row).collect();
    for row in &arguments.only {
        if !rows.contains(&row.as_str()) {
            let known = rows.join(", ");
            return Err(miette!("no check for row '{row}'; there are {known}"));
        }
    }
    checks.retain(|c| arguments.only.is_empty() || arguments.only.iter().any(|r| r == c.row));
    let device = Device::new(&DeviceOptions {
        selector: arguments.device,
        validate: arguments.validate,
        ..Default::default()
    })
    .into_diagnostic()?;
    if !device.supports_ray_query() {
        return Err(miette!(
            "'{}' has no ray queries, and the checks use both tracers: choose another with --device, \
             or install the software driver (tools/setup.sh)",
            device.name()
        ));
    }
    let provenance = insonify_tools::provenance::Provenance::of(&device);
    println!("{provenance}");
    let bench = check::Bench::on(device);
    let mut examined = vec![];
    for check in checks {
        let found = check::examine(&check, &bench);
        let verdict = if found.holds() { "holds" } else { "DOES NOT HOLD" };
        println!("{:<4} {}: {verdict}", check.row, check.name);
        print!("{}", found.complaints(&check));
        examined.push((check, found));
    }
    let origin = [
        ("Device", provenance.device.as_str()),
        ("Driver", &provenance.driver),
        ("Commit", &provenance.commit),
    ];
    let html = page::page(&origin, &rows, &examined);
    let path = arguments.output.join("index.html");
    std::fs::create_dir_all(&arguments.output)
        .and_then(|()| std::fs::write(&path, html))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))?;
    println!("{}", path.display());
    let holds = examined.iter().all(|(_, found)| found.holds());
    Ok(if holds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
