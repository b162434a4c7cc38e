//! Subcommands, one module each: arguments and execution.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{issue, output};

mod acquire;
mod check;
mod common;
mod dataset;
mod images;
mod import;
mod info;
mod matching;
mod reconstruct;
mod register;
mod render;
mod serve;
mod study;
mod task;
mod vary;
#[cfg(feature = "window")]
mod view;

/// Real-time ultrasound by Monte-Carlo path tracing. Without a command it opens the window with pictures of the scenes
/// that ship.
#[derive(Debug, Parser)]
#[command(name = "insonify", version, after_help = EXAMPLES)]
#[cfg_attr(not(feature = "window"), command(arg_required_else_help = true))]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

/// The end of `--help`.
const EXAMPLES: &str = "\
Start with:
  insonify                             the window: choose a scene, drag the probe on the skin
  insonify view heart                  the window with a scene that ships, or with a scene file
  insonify render abdomen -o out/abdomen.png
  insonify info                        the Vulkan devices of this machine
Scenes that ship: abdomen, artery, carotid, early, ectopic, fetus, heart, limbs, phantom, pregnancy.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Acquire tracked frames of a scene along a sweep, and a volume from them
    Acquire(Box<acquire::Acquire>),
    /// Check a scene, a mesh or a volume and say what it holds; exits 1 on errors
    Check(check::Check),
    /// Make labelled samples of scenes by a plan: a data set, shard by shard
    Dataset(Box<dataset::Dataset>),
    /// Make a scene from a segmentation or from meshes
    Import(Box<import::Import>),
    /// List the Vulkan devices and what each lacks
    Info(info::Info),
    /// Fit gain, TGC, dynamic range and speckle size to the acquired volume around the mask
    Match(Box<matching::Match>),
    /// Reconstruct a volume from tracked frames
    Reconstruct(Box<reconstruct::Reconstruct>),
    /// Place the acquired volume, or the model in it, by a surface that was segmented in the volume
    Register(Box<register::Register>),
    /// Render a scene to a B-mode image
    Render(Box<render::Render>),
    /// Simulate without a window: a tracker moves the probe, viewers receive the images
    Serve(Box<serve::Serve>),
    /// Make a user study of realism (form and key), or tables of what was answered
    Study(study::Study),
    /// Score recorded trajectories at the tasks that a scene sets its learners
    Task(Box<task::Arguments>),
    /// Render a scene many times, one parameter at a time, onto one labelled sheet
    // Its old name was `sweep`, which now means a path of the probe.
    #[command(alias = "sweep")]
    Vary(Box<vary::Vary>),
    /// Open a window: the live image, the probe under the keyboard, every setting
    #[cfg(feature = "window")]
    View(Box<view::View>),
}

/// The command that `arguments` ask for, of which the first is the program's name.
fn command(arguments: Vec<OsString>) -> Command {
    #[cfg(feature = "window")]
    let bare = || Cli::parse_from(["insonify", "view", "--gallery"]).command;
    #[cfg(not(feature = "window"))]
    let bare = || None;
    Cli::parse_from(arguments).command.or_else(bare).expect("clap asks for one")
}

/// Runs the command line of `arguments`, of which the first is the program's name, and returns the exit code. An error is
/// printed once, with its remedy; the code is then 1. Arguments that are wrong, `--help` and `--version` end the process.
pub fn run(arguments: Vec<OsString>) -> ExitCode {
    issue::tell_errors();
    output::exit(match command(arguments) {
        Command::Acquire(args) => acquire::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Check(check) => check.run(),
        Command::Dataset(args) => dataset::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Import(args) => import::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Info(info) => info::run(&info).map(|()| ExitCode::SUCCESS),
        Command::Match(args) => matching::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Reconstruct(args) => reconstruct::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Register(args) => register::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Render(render) => render::run(&render).map(|()| ExitCode::SUCCESS),
        Command::Serve(serve) => serve::run(&serve).map(|()| ExitCode::SUCCESS),
        Command::Study(study) => study::run(&study).map(|()| ExitCode::SUCCESS),
        Command::Task(args) => task::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Vary(vary) => vary::run(&vary).map(|()| ExitCode::SUCCESS),
        #[cfg(feature = "window")]
        Command::View(view) => view::run(&view).map(|()| ExitCode::SUCCESS),
    })
}

#[cfg(test)]
mod tests {
    use super::EXAMPLES;
    use crate::scene::shipped;

    #[test]
    fn the_help_names_the_scenes_that_ship() {
        assert!(EXAMPLES.ends_with(&format!("{}.", shipped::names())), "{}", shipped::names());
    }
}
