//! `insonify study answers`: tables of the answers.

use std::path::{Path, PathBuf};

use clap::Args;
use insonify::output::{self, files};
use insonify::study::answers::read_all;
use insonify::study::key::Key;
use insonify::study::results::{Results, csv, markdown, plain, ratings};
use miette::{Context, IntoDiagnostic, Result, miette};

use super::super::common::{distinct, writable};

/// Arguments of `insonify study answers`.
#[derive(Debug, Args)]
pub struct Answers {
    /// Answers that the form saved (.json), one file per assessor.
    #[arg(required = true)]
    answers: Vec<PathBuf>,
    /// The key that was written with the form.
    #[arg(short, long)]
    key: PathBuf,
    /// The tables as a file, too: .csv, one row per value, or .md.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Every single answer with what was rated, .csv, for other programs.
    #[arg(long, value_name = "FILE")]
    ratings: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &Answers) -> Result<()> {
    let write: Option<fn(&Results) -> String> = match args.output.as_deref().map(extension) {
        None => None,
        Some(name) if name == "csv" => Some(csv),
        Some(name) if name == "md" => Some(markdown),
        Some(name) => {
            return Err(miette!(
                help = "name it NAME.csv or NAME.md",
                "the tables cannot be written as `{name}`"
            ));
        }
    };
    let answers = args.answers.iter().map(|path| ("answers", Some(path.as_path())));
    let read: Vec<_> = answers.chain([("--key", Some(args.key.as_path()))]).collect();
    distinct(&read, &[("-o", args.output.as_deref()), ("--ratings", args.ratings.as_deref())])?;
    args.output.iter().chain(&args.ratings).try_for_each(|path| writable(path))?;
    let key = Key::read(&args.key)?;
    let answers = read_all(&args.answers, &key)?;
    for (i, this) in answers.iter().enumerate() {
        let name = this.assessor.name.trim();
        let namesake = answers[..i].iter().find(|a| a.assessor.name.trim() == name);
        if let (false, Some(other)) = (name.is_empty(), namesake) {
            output::note(format!(
                "warning: {} and {} are two forms of `{name}`, and count as two assessors",
                other.file.display(),
                this.file.display()
            ));
        }
    }
    let results = Results::new(&key, &answers);
    output::line(plain(&results).trim_end());
    if let (Some(path), Some(write)) = (&args.output, write) {
        save(path, &write(&results))?;
    }
    if let Some(path) = &args.ratings {
        save(path, &ratings(&key, &answers))?;
    }
    Ok(())
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    extension.to_ascii_lowercase()
}

fn save(path: &Path, text: &str) -> Result<()> {
    files::replace(path, text.as_bytes())
        .into_diagnostic()
        .wrap_err_with(|| format!("writing {}", path.display()))
}
