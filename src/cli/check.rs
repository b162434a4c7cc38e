//! `insonify check FILE`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use insonify::output;
use insonify::scene::check;

/// Arguments of `insonify check`.
#[derive(Debug, Args)]
pub struct Check {
    /// A scene (.toml) or a mesh (.obj, .gltf, .glb, .stl)
    file: PathBuf,
}

impl Check {
    /// Prints the report.
    pub fn run(&self) -> miette::Result<ExitCode> {
        let report = check::report(&self.file);
        output::line(&report);
        let passed = report.passed();
        match report.error {
            Some(error) => Err(error.into()),
            None if passed => Ok(ExitCode::SUCCESS),
            None => Ok(ExitCode::FAILURE),
        }
    }
}
