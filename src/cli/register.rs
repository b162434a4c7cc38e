//! `insonify register`: the model and the acquired volume laid onto each other by a surface.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use glam::{DAffine3, DVec3};
use insonify::output;
use insonify::register::landmarks::{self, Landmark};
use insonify::register::{Fit, Placement, Transformation, icp, scale_of};
use insonify::scene::file::{Entry, save_with};
use insonify::scene::{Acquired, Scene};
use insonify::volume::Frame;
use miette::{Result, miette};

use super::common::{self, notes, seconds, writable};

mod inputs;
mod report;

/// Arguments of `insonify register`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("segmented").args(["points", "volume_surface"]))]
#[command(group = ArgGroup::new("known").args(["points", "volume_surface", "landmarks", "volume_landmarks"]).multiple(true).required(true))]
#[command(group = ArgGroup::new("destination").args(["output", "in_place", "dry_run"]))]
pub struct Register {
    /// Scene file (.toml) with [volume].
    #[arg(value_parser = super::common::scene_file())]
    scene: PathBuf,
    /// The model's surface: the name of a mesh of the scene, or a mesh file in its world. May be given
    /// several times.
    #[arg(long, value_name = "MESH", requires = "segmented")]
    surface: Vec<String>,
    /// Points of the same surface in the volume's frame, mm: .csv with the columns x, y, z, or the
    /// .fcsv or .mrk.json of 3D Slicer.
    #[arg(long, value_name = "FILE", requires = "surface")]
    points: Option<PathBuf>,
    /// The same surface as it was segmented in the volume: a mesh file in the volume's frame, mm.
    #[arg(long, value_name = "FILE", requires = "surface")]
    volume_surface: Option<PathBuf>,
    /// Points that are laid on --volume-surface.
    #[arg(long, value_name = "COUNT", default_value_t = 5000, requires = "volume_surface", value_parser = clap::value_parser!(u32).range(100..=500_000))]
    samples: u32,
    /// Landmarks to begin with: .csv with the columns name, model_x, model_y, model_z (in the scene's
    /// world) and volume_x, volume_y, volume_z (in the volume's frame), mm. Without --points and
    /// --volume-surface they are all there is.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["model_landmarks", "volume_landmarks"])]
    landmarks: Option<PathBuf>,
    /// The same in two files, paired by label: those of the model, in the scene's world.
    #[arg(long, value_name = "FILE", requires = "volume_landmarks")]
    model_landmarks: Option<PathBuf>,
    /// Those of the volume, in its frame.
    #[arg(long, value_name = "FILE", requires = "model_landmarks")]
    volume_landmarks: Option<PathBuf>,
    /// Frame of the volume's points, surface and landmarks where their files say none [default: lps].
    #[arg(long, value_enum)]
    frame: Option<Frame>,
    /// Changes allowed: rotation and shift, or the scale as well.
    #[arg(long, value_enum, default_value = "rigid")]
    transformation: Transformation,
    /// Start of the search without landmarks.
    #[arg(long, value_enum, default_value = "scene", conflicts_with_all = ["landmarks", "model_landmarks"])]
    start: Start,
    /// Moves this mesh or transform of the scene, with all below it, to the volume, instead of the
    /// volume to the model.
    #[arg(long = "move", value_name = "NODE", requires = "surface")]
    moved: Option<String>,
    /// Time at which the scene is registered: seconds, or with a unit, e.g. "400 ms".
    #[arg(long, default_value = "0", value_parser = seconds, allow_hyphen_values = true)]
    time: f64,
    /// Scene file to write.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes into SCENE itself.
    #[arg(long)]
    in_place: bool,
    /// Says what would be set and writes nothing, as without -o and --in-place.
    #[arg(long)]
    dry_run: bool,
    /// Writes placement, distances and warnings as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Value of `--start`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Start {
    /// The scene's present placement of the volume.
    Scene,
    /// The same, shifted so that the mean of the points lies on the centroid of the surface.
    Centroids,
}

/// Result of a registration. Transforms are from the world with the volume at its present place to the world
/// of the model.
struct Registered {
    landmarks: Vec<Landmark>,
    /// Transform at the start of the search.
    start: DAffine3,
    /// Transform at its end.
    transform: DAffine3,
    /// Fit of the surface; none where there were only landmarks.
    fit: Option<Fit>,
    /// Mean of the registered points, with the volume at its present place.
    middle: DVec3,
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user, reported once; the scene file is then untouched.
pub fn run(args: &Register) -> Result<()> {
    distinct(args)?;
    args.output.iter().chain(&args.json).try_for_each(|path| writable(path))?;
    let (mut scene, found) = Scene::load(&args.scene, &[])?;
    notes(&found);
    scene.set_time(args.time);
    let volume = scene.volume.take().ok_or_else(|| {
        miette!(
            help = "add [volume] with file = \"NAME.mha\", and [fusion] with the mesh that is simulated in it",
            "{} has no volume to register",
            args.scene.display()
        )
    })?;
    let target = Target::of(args, &scene, &volume)?;
    let mut warnings = Vec::new();
    let made = search(args, &scene, &volume, &mut warnings);
    // The warnings may explain why there is no result.
    let made = made.inspect_err(|_| report::warn(&warnings))?;
    let placement = Placement::of(&target.placed(&made.transform), args.transformation);
    warnings.extend(report::doubts(&made));
    report::print(&made);
    report::warn(&warnings);
    let entries = placement.entries(&target.table);
    for (path, value) in entries.iter().filter_map(|(p, v)| Some((p, v.as_ref()?))) {
        output::line(format!("{path} = {value}"));
    }
    write(args, &entries, &target, &made)?;
    if let Some(file) = &args.json {
        let report = report::json(&made, &target.table, &placement, &warnings);
        common::write_json(file, &report)?;
    }
    Ok(())
}

/// Searches the transform from the volume to the model.
fn search(
    args: &Register,
    scene: &Scene,
    volume: &Acquired,
    warnings: &mut Vec<String>,
) -> Result<Registered> {
    let world_from_lps = volume.world_from_lps;
    let landmarks = inputs::landmarks(args, &world_from_lps, warnings)?;
    let points = inputs::points(args)?;
    if let Some(points) = &points {
        warnings.extend(inputs::outside(points, volume));
    }
    let points: Option<Vec<DVec3>> = points.map(|all| {
        let placed = all.into_iter().map(|p| world_from_lps.transform_point3(p));
        placed.collect()
    });
    let (transformation, from) = (args.transformation, landmarks.iter().map(|l| l.from));
    let mut start = match landmarks.is_empty() {
        true => DAffine3::IDENTITY,
        false => landmarks::closed_form(&landmarks, transformation)?,
    };
    let mean = |sum: DVec3, count: usize| sum / count.max(1) as f64;
    let middle = match &points {
        Some(points) => mean(points.iter().sum(), points.len()),
        None => mean(from.sum(), landmarks.len()),
    };
    let fit = match &points {
        Some(points) => {
            let surface = inputs::surface(args, scene)?;
            if args.start == Start::Centroids {
                start = DAffine3::from_translation(surface.centre() - middle);
            }
            let fit = icp::fit(points, &surface, start, transformation)?;
            warnings.extend(report::apart(&fit, surface.size()));
            Some(fit)
        }
        None => None,
    };
    Ok(Registered {
        landmarks,
        start,
        transform: fit.as_ref().map_or(start, |f| f.transform),
        fit,
        middle,
    })
}

/// The placement to be changed.
struct Target {
    /// Its table in the scene file.
    table: String,
    /// The present placement.
    rest: DAffine3,
    /// The world from its parent for a node; none for the volume, which is moved by default.
    world_from_parent: Option<DAffine3>,
}

impl Target {
    fn of(args: &Register, scene: &Scene, volume: &Acquired) -> Result<Self> {
        let Some(name) = &args.moved else {
            return Ok(Self {
                table: "volume".to_owned(),
                rest: volume.world_from_lps,
                world_from_parent: None,
            });
        };
        let node = inputs::carrier(args, scene, name)?;
        let key = toml_edit::Key::new(name);
        Ok(Self {
            table: format!("{}.{}", node.kind, key.display_repr()),
            rest: node.rest,
            world_from_parent: Some(node.world_from_parent),
        })
    }

    /// The placement after `model_from_volume`, which moves the world about the volume to the model.
    fn placed(&self, model_from_volume: &DAffine3) -> DAffine3 {
        match self.world_from_parent {
            None => *model_from_volume * self.rest,
            // The model moves by the inverse, in its parent's axes.
            Some(world_from_parent) => {
                let volume_from_model = model_from_volume.inverse();
                world_from_parent.inverse() * volume_from_model * world_from_parent * self.rest
            }
        }
    }
}

/// Refuses files of which one would replace another; -o may be the scene itself, which keeps all but what is set.
fn distinct(args: &Register) -> Result<()> {
    let read = [
        ("--points", &args.points),
        ("--volume-surface", &args.volume_surface),
        ("--landmarks", &args.landmarks),
        ("--model-landmarks", &args.model_landmarks),
        ("--volume-landmarks", &args.volume_landmarks),
    ];
    let read = read.map(|(name, path)| (name, path.as_deref()));
    common::distinct(&read, &[("-o", args.output.as_deref()), ("--json", args.json.as_deref())])?;
    common::distinct(&[("the scene", Some(&args.scene))], &[("--json", args.json.as_deref())])
}

fn write(args: &Register, entries: &[Entry], target: &Target, made: &Registered) -> Result<()> {
    let output = match (&args.output, args.in_place) {
        (Some(output), _) => output,
        (None, true) => &args.scene,
        (None, false) => {
            if !args.dry_run {
                output::note("nothing is written: give -o FILE or --in-place");
            }
            return Ok(());
        }
    };
    let note = (format!("{}.translate", target.table), report::note(made, &inputs::names(args)));
    save_with(&args.scene, output, entries, &[note])?;
    output::line(output.display());
    Ok(())
}

impl Registered {
    /// Shift of the middle (mm), angle (degrees) and scale.
    fn motion(&self) -> (f64, f64, f64) {
        let shift = self.transform.transform_point3(self.middle) - self.middle;
        let (_, rotation, _) = self.transform.to_scale_rotation_translation();
        let angle = rotation.to_axis_angle().1.to_degrees();
        (shift.length(), angle.min(360.0 - angle), scale_of(&self.transform))
    }
}
