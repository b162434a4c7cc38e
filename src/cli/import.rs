//! `insonify import`: a scene from a segmentation or from meshes.

use std::path::PathBuf;

use clap::Args;
use glam::DVec3;
use insonify::import::table::{self, Table};
use insonify::import::{self, Draft, Options};
use insonify::output;
use insonify::scene::mesh::Units;
use insonify::scene::tissue::table as tissues;
use insonify::settings::suggest;
use insonify::volume::Frame;
use miette::{Result, miette};

use super::common::Progress;
use super::reconstruct::spacing;

/// Arguments of `insonify import`.
#[derive(Debug, Args)]
pub struct Import {
    /// A label map (.nii, .nii.gz, .nrrd, .seg.nrrd, .mha, .mhd), or a folder of meshes, one per organ, named after them
    #[arg(required_unless_present = "print_table")]
    source: Option<PathBuf>,
    /// Folder of the scene: scene.toml, and the meshes that it shows
    #[arg(short, long, value_name = "FOLDER", required_unless_present = "print_table")]
    output: Option<PathBuf>,
    /// Table of structures (.csv): columns value, name, tissue, priority, note, of which it may leave out some. Its
    /// rows come before those that ship.
    #[arg(long, value_name = "FILE")]
    labels: Option<PathBuf>,
    /// What the values mean where neither the file nor --labels says it
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
    frame: Option<FrameChoice>,
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

/// Value of `--frame`.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum FrameChoice {
    /// Left, posterior, superior.
    Lps,
    /// Right, anterior, superior.
    Ras,
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
    let mut table = match &args.labels {
        Some(path) => Table::load(path)?,
        None => Table::shipped(),
    };
    if let Some(Classes::Totalsegmentator) = args.classes {
        table = table.with_total_segmentator();
    }
    if !tissues::names().any(|t| t == args.around) {
        let remedy = suggest::among(&args.around, tissues::names());
        return Err(miette!(help = remedy, "--around: unknown tissue `{}`", args.around));
    }
    if let Some(spacing) = args.spacing
        && !(spacing.is_finite() && spacing.cmpgt(DVec3::splat(1e-3)).all())
    {
        return Err(miette!(help = "give mm, such as 1.5", "--spacing has to be above 0.001 mm"));
    }
    let options = Options {
        table,
        spacing: args.spacing,
        look_at: args.look_at.clone(),
        around: args.around.clone(),
        units: args.units,
        frame: args.frame.map(|frame| match frame {
            FrameChoice::Lps => Frame::Lps,
            FrameChoice::Ras => Frame::Ras,
        }),
        force: args.force,
    };
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
        import::map::import(source, folder, &options, &mut tell).map(|draft| (draft, Vec::new()))
    };
    if let Some((_, progress)) = shown {
        progress.finish();
    }
    let (draft, issues) = done?;
    for issue in issues {
        eprintln!("{issue}");
    }
    let path = draft.finish()?;
    report(&draft);
    output::line(path.display());
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
    let all: usize = draft.parts.iter().map(|p| p.triangles).sum();
    output::line(format!("{} meshes, {all} triangles", draft.parts.len()));
    let unknown: Vec<_> =
        draft.parts.iter().filter(|p| !p.known).map(|p| p.name.as_str()).collect();
    if !unknown.is_empty() {
        output::line(format!(
            "{} structures had no tissue and were given {}: {}; name them in a table (--labels)",
            unknown.len(),
            table::UNKNOWN,
            unknown.join(", ")
        ));
    }
    match &draft.view {
        Some((view, organ)) => output::line(format!(
            "the probe looks at {organ}, {:.0} mm deep; {}",
            view.distance,
            import::way(view)
        )),
        None => output::line("no place on the skin was found for the probe; set [probe.pose]"),
    }
}
