//! `insonify view`: a scene in a window.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Arc;

use miette::{IntoDiagnostic, Result};

use super::common::{self, Common};
use insonify::output;
use insonify::scene::Scene;
use insonify::scene::animation::Track;
use insonify::scene::file;
use insonify::sim::shaders::Library;
use insonify::view::{self, Listen, Options};

/// Arguments of `insonify view`.
#[derive(Debug, clap::Args)]
pub struct View {
    /// Scene file (.toml), or the name of a scene that ships.
    #[arg(value_parser = common::scene_file(), default_value = "abdomen")]
    scene: PathBuf,
    /// Begins with pictures of the scenes that ship, to choose one.
    #[arg(long)]
    gallery: bool,
    #[command(flatten)]
    common: Common,
    /// Lets the probe go along a trajectory (.csv, .toml) from the start: one that the window has
    /// recorded, or any as scene files take them.
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Listens for OpenIGTLink at this port: trackers move the probe, viewers receive the images; 0
    /// takes any port that is free, and says which. 18944 is the usual one.
    #[arg(long, value_name = "PORT")]
    igtl_port: Option<u16>,
    /// Address of this machine to listen at; 0.0.0.0 lets other machines in.
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), requires = "igtl_port")]
    igtl_bind: IpAddr,
    /// Size of texts and controls, 0.5 to 3; 1 is what the display asks for. Ctrl+Plus and Ctrl+Minus
    /// change it.
    #[arg(long, default_value = "1", value_parser = scale)]
    scale: f32,
    /// Writes the window's picture (PNG) once it shows an image, and ends.
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
    /// Folder that stills (F2) and clips (F3) are written to; made where it does not exist.
    #[arg(long, value_name = "DIR", default_value = ".")]
    captures: PathBuf,
    /// Writes the timings of the last frames as one JSON object at the end.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn scale(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    match (0.5..=3.0).contains(&value) {
        true => Ok(value),
        false => Err("it must lie between 0.5 and 3".into()),
    }
}

/// Runs the command.
///
/// # Errors
/// Everything that the user or the device can get wrong, said once.
pub fn run(args: &View) -> Result<()> {
    common::distinct(
        &[("the scene", Some(&args.scene)), ("--trajectory", args.trajectory.as_deref())],
        &[("--screenshot", args.screenshot.as_deref()), ("--json", args.json.as_deref())],
    )?;
    args.screenshot.iter().chain(&args.json).try_for_each(|path| common::writable(path))?;
    let trajectory = trajectory(args)?;
    let common = args.common.clone();
    let overrides = common.overrides(&args.scene)?;
    let (scene, warnings) = Scene::load(&args.scene, &overrides)?;
    common::notes(&warnings);
    let options = Options {
        file: args.scene.clone(),
        warnings: warnings.iter().map(ToString::to_string).collect(),
        overrides,
        // Both tracers: the console exchanges them.
        device: common.device_options(),
        library: Arc::new(Library::embedded()),
        seconds: common.time,
        scale: args.scale,
        screenshot: args.screenshot.clone(),
        json: args.json.clone(),
        trajectory,
        listen: args.igtl_port.map(|port| Listen { address: args.igtl_bind, port }),
        captures: args.captures.clone(),
        gallery: args.gallery,
        prepare: Box::new(move |device, scene| {
            common.settle_simulation(&mut scene.simulation, device);
            Ok(common.tracer(device, scene)?)
        }),
    };
    for line in view::FIRST_STEPS {
        output::note(line);
    }
    view::run(scene, options).into_diagnostic()
}

fn trajectory(args: &View) -> Result<Option<(Track, PathBuf)>> {
    let Some(path) = &args.trajectory else {
        return Ok(None);
    };
    Ok(Some((file::load_trajectory(path)?, path.clone())))
}
