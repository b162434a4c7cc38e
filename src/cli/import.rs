//! `insonify import`: a scene from a segmentation or from meshes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use glam::{DAffine3, DVec3};
use insonify::import::table::{self, Table};
use insonify::import::{self, Draft, LabelMap, Options};
use insonify::output;
use insonify::scene::Scene;
use insonify::scene::mesh::Units;
use insonify::settings::suggest;
use insonify::volume::{Frame, Pose, frames_of_pose, transform};
use miette::{Result, miette};

use super::common::{Progress, distinct, notes};
use super::reconstruct::spacing;

/// Arguments of `insonify import`.
#[derive(Debug, Args)]
pub struct Import {
    /// A label map (.nii, .nii.gz, .nrrd, .seg.nrrd, .mha, .mhd), a folder of meshes or of masks, one file per organ,
    /// named after it, a configuration of PLUS's simulator (.xml), or for a trajectory a tracked sequence (.mha, .mhd, .nrrd)
    #[arg(required_unless_present = "print_table")]
    source: Option<PathBuf>,
    /// Folder of the scene: scene.toml, and the meshes that it shows; or a trajectory (.csv)
    #[arg(short, long, value_name = "FOLDER", required_unless_present = "print_table")]
    output: Option<PathBuf>,
    /// Table of structures (.csv): columns value, name, tissue, priority, note, of which it may leave out some. Its
    /// rows come before those that ship.
    #[arg(long, value_name = "FILE")]
    labels: Option<PathBuf>,
    /// Meaning of the values where neither the file nor --labels gives it
    #[arg(long, value_enum)]
    classes: Option<Classes>,
    /// Structure that the probe looks at: its name, or a part of it [default: the largest organ]
    #[arg(long, value_name = "NAME")]
    look_at: Option<String>,
    /// Tissue of what lies inside the skin and belongs to no structure
    #[arg(long, value_name = "TISSUE", default_value = "fat")]
    around: String,
    /// Distance of voxels to resample the labels to, mm, by majority: one number, or one per axis as 1,1,2
    #[arg(long, value_parser = spacing)]
    spacing: Option<DVec3>,
    /// Unit of mesh files that are in another than their format's
    #[arg(long, value_name = "UNIT", value_parser = units)]
    units: Option<Units>,
    /// Frame of mesh files that do not state theirs (SPACE=) [default: lps]
    #[arg(long, value_enum)]
    frame: Option<Frame>,
    /// Tracked sequence whose poses a configuration of PLUS is seen with: the first that are valid
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Transform beside those of a configuration of PLUS, e.g. ProbeToReference="1 0 0 10 0 1 0 0 0 0 1 0 0 0 0 1"
    #[arg(long, value_name = "NAME=MATRIX", value_parser = named_transform)]
    transform: Vec<(String, DAffine3)>,
    /// For a trajectory: a configuration of PLUS, with the calibration of the probe
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// For a trajectory: the pose of the probe, as the sequence and --config name its two frames
    #[arg(long, value_name = "FROMToTO", default_value = "ProbeToReference")]
    pose: String,
    /// For a trajectory: turns its frame, RAS, into that of a world in LPS
    #[arg(long)]
    to_lps: bool,
    /// Replaces the scene in the folder
    #[arg(long)]
    force: bool,
    /// Prints the table that ships, as CSV, and ends
    #[arg(long)]
    print_table: bool,
}

/// Value of `--classes`.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Classes {
    /// The 117 classes of TotalSegmentator's task `total`, version 2.
    Totalsegmentator,
}

fn named_transform(text: &str) -> Result<(String, DAffine3), String> {
    let (name, matrix) = text.split_once('=').ok_or("write NAME=MATRIX")?;
    let matrix = transform(&matrix.replace([',', ';'], " ")).map_err(str::to_owned)?;
    Ok((name.to_owned(), matrix))
}

fn units(text: &str) -> Result<Units, String> {
    let names = Units::NAMES.iter().map(|(name, _)| *name);
    Units::named(text).ok_or_else(|| suggest::among(text, names))
}

/// Runs the command.
///
/// # Errors
/// Every fault of files and arguments, reported once.
pub fn run(args: &Import) -> Result<()> {
    let (Some(source), Some(folder)) = (&args.source, &args.output) else {
        output::line(table::SHIPPED.trim_end());
        return Ok(());
    };
    let ends =
        |path: &Path, with: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(with));
    if ends(folder, "csv") {
        let given = [
            ("the sequence", Some(source)),
            ("--config", args.config.as_ref()),
            ("--labels", args.labels.as_ref()),
        ];
        let given = given.map(|(name, path)| (name, path.map(PathBuf::as_path)));
        distinct(&given, &[("-o", Some(folder))])?;
        return trajectory(source, folder, args);
    }
    if ends(folder, "toml") && !folder.is_dir() {
        let own = folder.with_extension("");
        let remedy = format!("take `-o {}`: scene.toml is written into it", own.display());
        return Err(miette!(help = remedy, "-o {}: it names a folder", folder.display()));
    }
    if ends(source, "xml") {
        return device_set(source, folder, args);
    }
    let mut table = match &args.labels {
        Some(path) => Table::load(path)?,
        None => Table::shipped(),
    };
    if let Some(Classes::Totalsegmentator) = args.classes {
        table = table.with_total_segmentator();
    }
    let options = Options {
        table,
        spacing: args.spacing,
        look_at: args.look_at.clone(),
        around: args.around.clone(),
        units: args.units,
        frame: args.frame,
        force: args.force,
    };
    if let Some((option, cause, remedy)) = options.fault() {
        return Err(miette!(help = remedy, "--{option}: {cause}"));
    }
    let mut shown: Option<(String, Progress)> = None;
    let mut tell = |noun: &str, done: usize, of: usize| {
        if shown.as_ref().is_none_or(|(now, _)| now != noun) {
            if let Some((_, last)) = shown.take() {
                last.finish();
            }
            shown = Some((noun.to_owned(), Progress::new(of as u32, noun)));
        }
        if let Some((_, progress)) = &mut shown {
            progress.done(done as u32);
        }
    };
    let done = if source.is_dir() {
        import::folder::import(source, folder, &options, &mut tell)
    } else {
        tell("read", 0, 1);
        let map = LabelMap::load(source)?;
        let draft = import::map::import(source, map, folder, &options, &mut tell);
        draft.map(|draft| (draft, Vec::new()))
    };
    if let Some((_, progress)) = shown {
        progress.finish();
    }
    let (draft, issues) = done?;
    notes(issues);
    let path = draft.finish()?;
    report(&draft);
    output::line(path.display());
    Ok(())
}

/// A scene of a configuration of PLUS.
fn device_set(source: &Path, folder: &Path, args: &Import) -> Result<()> {
    let mut poses = match &args.sequence {
        Some(sequence) => import::trajectory::first_poses(sequence)?,
        None => BTreeMap::new(),
    };
    poses.extend(args.transform.iter().map(|(name, t)| (name.clone(), Pose::ok(*t))));
    let scene = import::device_set::import(source, folder, &poses, args.force)?;
    notes(&scene.issues);
    let path = scene.finish()?;
    // What of it can be seen is known with the probe's pose and all meshes.
    notes(Scene::load(&path, &[])?.1);
    scene.draft.messages().iter().for_each(output::line);
    for part in &scene.draft.parts {
        output::line(format!("{}: {} triangles, {:.1} ml", part.name, part.triangles, part.volume));
    }
    output::line(path.display());
    Ok(())
}

/// A trajectory of tracked poses.
fn trajectory(source: &Path, file: &Path, args: &Import) -> Result<()> {
    let wrong =
        || miette!(help = "write it like ProbeToReference", "--pose {}: no two frames", args.pose);
    let (tool, reference) = frames_of_pose(&args.pose).ok_or_else(wrong)?;
    let naming = import::trajectory::Naming {
        tool: tool.to_owned(),
        reference: reference.to_owned(),
        to_lps: args.to_lps,
    };
    let made = import::trajectory::import(source, args.config.as_deref(), &naming)?;
    output::files::replace(file, made.text.as_bytes()).map_err(|e| {
        miette!(
            help = "check the folder and the room in it",
            "{}: cannot be written: {e}",
            file.display()
        )
    })?;
    output::line(format!(
        "{} poses over {:.3} s, {} frames left out (no valid pose, or no later than the one before)",
        made.rows, made.duration, made.left_out
    ));
    output::line(file.display());
    Ok(())
}

/// Says what became of each structure, what had no tissue, and where the probe is.
fn report(draft: &Draft) {
    for part in &draft.parts {
        let note = match (part.known, part.note.as_str()) {
            (false, _) => " (no table knows it)".to_owned(),
            (true, "") => String::new(),
            (true, note) => format!(" ({note})"),
        };
        output::line(format!(
            "{}: {}{note}, {} triangles, {:.1} ml",
            part.name, part.tissue, part.triangles, part.volume
        ));
    }
    draft.messages().iter().for_each(output::line);
    let all: usize = draft.parts.iter().map(|p| p.triangles).sum();
    output::line(format!("{} meshes, {all} triangles", draft.parts.len()));
    match &draft.view {
        Some((view, organ)) => output::line(format!(
            "the probe looks at {organ}, {:.0} mm deep; {}",
            view.distance,
            import::way(view)
        )),
        None => output::line("no place on the skin was found for the probe; set [probe.pose]"),
    }
}
