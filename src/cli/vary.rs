//! `insonify vary`: many images of one scene on one contact sheet.

use std::fmt;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use insonify::output;
use insonify::output::files;
use insonify::output::sheet::{Sheet, Tile};
use insonify::random::order;
use insonify::scene::Scene;
use insonify::sim::shaders::Library;
use miette::{Context, IntoDiagnostic, Result, miette};

use super::common::{self, Common, Stage};
use pictures::{Picture, Studio};
use record::Record;

pub(super) mod pictures;
mod record;

/// Arguments of `insonify vary`.
#[derive(Debug, Args)]
pub struct Vary {
    /// Scene file (.toml); its table [vary] says which parameters take which values.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// The sheet, NAME.png, with its table beside it, NAME.csv; or a folder for both and every single
    /// image [default: the scene's name and what is shown, here].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Subject of the images.
    #[arg(long, value_enum, default_value = "parameters")]
    show: Show,
    /// For blind rating: images in an order that this seed draws, numbered and without labels. Only the
    /// table says which is which.
    #[arg(long, value_name = "SEED")]
    shuffle: Option<u32>,
    /// Images side by side [default: what suits them].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100))]
    columns: Option<u32>,
    #[command(flatten)]
    common: Common,
}

/// The subject of the images of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Show {
    /// The scene, then one parameter at a time below and above its value.
    Parameters,
    /// The steps of fusion: acquired volume, simulation, mask, both images without and with blur.
    Steps,
    /// The surroundings of the mask: the acquired volume, nothing, or the scene's own scatterers.
    Surroundings,
    /// The ways in which simulation and acquired volume meet.
    Blends,
}

impl fmt::Display for Show {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Parameters => "parameters",
            Self::Steps => "steps",
            Self::Surroundings => "surroundings",
            Self::Blends => "blends",
        })
    }
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Vary) -> Result<()> {
    let common = &args.common;
    let files = Files::new(args)?;
    let (mut scene, variants, warnings) =
        Scene::load_variants(&args.scene, &common.overrides(&args.scene)?)?;
    common::notes(&warnings);
    if args.show != Show::Parameters && scene.volume.is_none() {
        return Err(miette!(
            help = "add [volume] and [fusion] to it, or leave out --show",
            "{} shows no acquired volume: there are no {} to compare",
            args.scene.display(),
            args.show
        ));
    }
    let Stage { device, simulator, .. } = common.stage(&mut scene, &Library::embedded())?;
    for mask in scene.masks_off_the_image() {
        output::note(format!("warning: {}", common::unseen(&scene, mask)));
    }
    let mut studio = Studio::new(simulator);
    let pictures = match args.show {
        Show::Parameters => {
            let settle = |scene: &mut Scene| {
                common.settle_simulation(&mut scene.simulation, &device);
            };
            studio.parameters(&scene, &variants, settle)?
        }
        Show::Steps => studio.steps(&scene)?,
        Show::Surroundings => studio.surroundings(&scene)?,
        Show::Blends => studio.blends(&scene)?,
    };
    write(args, &scene, &pictures, &files)?;
    common.validated(&device)
}

/// Paths of the results.
struct Files {
    sheet: PathBuf,
    table: PathBuf,
    /// Folder for the single images.
    folder: Option<PathBuf>,
}

impl Files {
    fn new(args: &Vary) -> Result<Self> {
        let stem = args.scene.file_stem().unwrap_or_default().to_string_lossy();
        let named = || PathBuf::from(format!("{stem}-{}.png", args.show));
        let output = args.output.clone().unwrap_or_else(named);
        let png = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("png");
        let files = if output.extension().is_some_and(png) {
            common::writable(&output)?;
            Self { table: output.with_extension("csv"), sheet: output, folder: None }
        } else {
            common::writable_folder(&output)?;
            let [sheet, table] = ["sheet.png", "sheet.csv"].map(|name| output.join(name));
            Self { sheet, table, folder: Some(output) }
        };
        common::distinct(
            &[("the scene", Some(&args.scene))],
            &[("-o", Some(&files.sheet)), ("the table beside it", Some(&files.table))],
        )?;
        Ok(files)
    }
}

/// Writes contact sheet, table and single images.
fn write(args: &Vary, scene: &Scene, pictures: &[Picture], files: &Files) -> Result<()> {
    let order = match args.shuffle {
        Some(seed) => order(pictures.len(), seed, 0),
        None => (0..pictures.len()).collect(),
    };
    let blind = args.shuffle.is_some();
    let shown: Vec<&Picture> = order.iter().map(|&i| &pictures[i]).collect();
    let mut tiles: Vec<Tile<'_>> = (1..)
        .zip(&shown)
        .map(|(number, picture)| Tile::Image {
            caption: match blind {
                true => format!("{number}"),
                false => format!("{number}  {}", picture.caption),
            },
            image: &picture.image,
        })
        .collect();
    // Beside the first image, so that the values below and above stand side by side.
    let panel = (args.show == Show::Parameters && !blind).then(|| pictures::own_values(scene));
    let shift = usize::from(panel.is_some());
    tiles.splice(1..1, panel.map(Tile::Text));
    let page = Sheet {
        title: title(args, scene),
        columns: args.columns.map_or_else(|| columns(args), |n| n as usize),
        tiles,
    }
    .draw();
    let records: Vec<Record> = (1..)
        .zip(&shown)
        .map(|(number, picture)| {
            let tile = match number {
                1 => 0,
                n => n - 1 + shift,
            };
            let file = files.folder.as_ref().map(|_| single(number, picture, blind));
            Record::new(number, picture, page.places[tile], file)
        })
        .collect();
    if let Some(folder) = &files.folder {
        for (record, picture) in records.iter().zip(&shown) {
            save(&picture.image, &folder.join(&record.file))?;
        }
    }
    save(&page.image, &files.sheet)?;
    record::write(&files.table, &records)?;
    output::line(files.sheet.display());
    output::line(files.table.display());
    Ok(())
}

fn save(image: &image::GrayImage, path: &Path) -> Result<()> {
    let mut png = Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).into_diagnostic()?;
    let written = files::replace(path, png.get_ref());
    written.into_diagnostic().wrap_err_with(|| format!("writing {}", path.display()))
}

/// Name of a single image. In blind rating it does not reveal the content.
fn single(number: usize, picture: &Picture, blind: bool) -> String {
    match blind {
        true => format!("{number:02}.png"),
        false => format!("{number:02}-{}.png", picture.stem),
    }
}

/// Number of columns: below, above, below, above for two parameters in a row.
fn columns(args: &Vary) -> usize {
    match args.show {
        Show::Parameters => 4,
        Show::Steps | Show::Surroundings | Show::Blends => 3,
    }
}

fn title(args: &Vary, scene: &Scene) -> String {
    let name = &scene.name;
    match (args.shuffle, args.show) {
        (Some(_), _) => name.clone(),
        (None, Show::Parameters) => format!("{name}: one parameter at a time"),
        (None, show) => format!("{name}: {show}"),
    }
}
