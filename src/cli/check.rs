//! `insonify check FILE`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use insonify::import;
use insonify::output;
use insonify::scene::{Issue, check};
use insonify::sim::beyond_some_devices;
use insonify::sim::calibration::Work;
use insonify::sim::contact::{Coupling, REACH_SKIN, Skins, UNTOUCHED};
use insonify::volume::{self, Format, Summary, Volume};

/// Arguments of `insonify check`.
#[derive(Debug, Args)]
pub struct Check {
    /// A scene (.toml), a mesh (.obj, .stl, .ply, .vtk, .vtp, .off, .3mf, .gltf, .glb) or a volume or
    /// sequence (.mha, .mhd, .nrrd, .nhdr, .nii, .nii.gz, .dcm)
    #[arg(value_parser = super::common::scene_file())]
    file: PathBuf,
}

impl Check {
    /// Prints the report.
    pub fn run(&self) -> miette::Result<ExitCode> {
        if volume::is_volume(&self.file) {
            return self.volume();
        }
        let mut report = check::report(&self.file);
        if let Some(Work { too_much, message, remedy }) = report.scene.as_ref().and_then(Work::of) {
            let make = if too_much { Issue::error } else { Issue::warning };
            report.issues.push(make(&self.file, 1, message, remedy.to_owned()));
        }
        if let Some((message, remedy)) = report.scene.as_ref().and_then(beyond_some_devices) {
            report.issues.push(Issue::warning(&self.file, 1, message, remedy.to_owned()));
        }
        let touch = report.scene.as_ref().and_then(|s| Coupling::of(s, &mut Skins::default()));
        if touch.is_some_and(|coupling| coupling.touch.share == 0.0) {
            let warning =
                Issue::warning(&self.file, 1, UNTOUCHED.to_owned(), REACH_SKIN.to_owned());
            report.issues.push(warning);
        }
        output::line(&report);
        let passed = report.passed();
        match report.error {
            Some(error) => Err(error.into()),
            None if passed => Ok(ExitCode::SUCCESS),
            None => Ok(ExitCode::FAILURE),
        }
    }

    fn volume(&self) -> miette::Result<ExitCode> {
        let failed = |_: &_| output::line(check::tally(1, 0));
        let segments = import::summary(&self.file).inspect_err(failed)?;
        if segments.is_some() && volume::is_dicom(&self.file) {
            output::line(self.file.display());
            segments.iter().for_each(|segments| output::line(format_args!("  {segments}")));
            output::line(check::tally(0, 0));
            return Ok(ExitCode::SUCCESS);
        }
        let (volume, warnings) = Volume::load(&self.file).inspect_err(failed)?;
        output::line(self.file.display());
        output::line(&volume);
        segments.iter().for_each(|segments| output::line(format_args!("  {segments}")));
        if matches!(volume.format, Format::MetaImage | Format::Nrrd)
            && let Some(sequence) = Summary::read(&self.file)?
        {
            output::line(sequence);
        }
        for warning in &warnings {
            output::line(warning);
        }
        output::line(check::tally(0, warnings.len()));
        Ok(ExitCode::SUCCESS)
    }
}
