//! `insonify study`: images rated blind, and results of the ratings.

use clap::{Args, Subcommand};
use miette::Result;

mod answers;
mod cases;
mod folder;
mod make;

/// Arguments of `insonify study`.
#[derive(Debug, Args)]
pub struct Study {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulate all images of a plan; write the form for the assessor, and the key apart from it
    Make(Box<make::Make>),
    /// Join saved answers with the key: tables of ranks, agreement and choices, with tests
    Answers(answers::Answers),
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(study: &Study) -> Result<()> {
    match &study.command {
        Command::Make(args) => make::run(args),
        Command::Answers(args) => answers::run(args),
    }
}
