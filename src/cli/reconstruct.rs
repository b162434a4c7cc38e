//! `insonify reconstruct`: a volume from tracked frames.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::{DAffine3, DVec3};
use insonify::output;
use insonify::volume::{
    Compounding, Config, Fan, Filling, Interpolation, Reconstruction, Sequence, Settings,
    Transforms, reconstruct, transform, write_meta,
};
use miette::{Context, Result};

use super::common::{distinct, notes, writable};

/// Arguments of `insonify reconstruct`. What is given here goes before the configuration.
#[derive(Debug, Args)]
pub struct Reconstruct {
    /// Tracked frames (.mha, .mhd, .nrrd, .nhdr), as PLUS and 3D Slicer write them.
    sequence: PathBuf,
    /// Configuration of PLUS (PlusDeviceSet_*.xml): its CoordinateDefinitions and
    /// VolumeReconstruction.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Calibration from pixels to the probe's tracked frame, mm: 16 numbers, row by row. Replaces the sequence's own
    /// and the configuration's.
    #[arg(long, value_name = "MATRIX", value_parser = matrix, allow_hyphen_values = true)]
    image_to_probe: Option<DAffine3>,
    /// Name of the frame of pixels [default: the configuration's, or Image].
    #[arg(long, value_name = "NAME")]
    image: Option<String>,
    /// Name of the tracked frame that the volume lies in [default: the configuration's, or
    /// Reference].
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// Distance of voxels, mm: one number, or one per axis as 0.5,0.5,1 [default: the
    /// configuration's, or 0.5].
    #[arg(long, value_parser = spacing)]
    spacing: Option<DVec3>,
    /// First voxel and voxels along each axis: x,y,z in mm, then nx,ny,nz [default: what holds all
    /// frames].
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = extent, allow_hyphen_values = true)]
    extent: Option<(DVec3, [usize; 3])>,
    /// Rectangle of the frames to use, pixels: x,y,width,height.
    #[arg(long, value_name = "X,Y,W,H", value_parser = clip)]
    clip: Option<[i32; 4]>,
    /// Voxels that a pixel goes to.
    #[arg(long, value_enum)]
    interpolation: Option<Interpolation>,
    /// Value of a voxel that several pixels reach.
    #[arg(long, value_enum)]
    compounding: Option<Compounding>,
    /// Voxels of the longest line that fills a hole; 0 leaves holes.
    #[arg(long, value_name = "VOXELS", value_parser = clap::value_parser!(u8).range(0..=99))]
    fill: Option<u8>,
    /// Volume to write (.mha).
    #[arg(short, long)]
    output: PathBuf,
}

fn matrix(text: &str) -> Result<DAffine3, String> {
    transform(&text.replace([',', ';'], " ")).map_err(str::to_owned)
}

fn numbers<T: std::str::FromStr>(text: &str) -> Result<Vec<T>, String> {
    let words = text.split(',').map(|w| w.trim().parse());
    let numbers: Result<Vec<T>, _> = words.collect();
    numbers.map_err(|_| format!("'{text}' is no list of such numbers"))
}

/// Value of `--spacing`: one number for all axes, or one for each, mm.
pub fn spacing(text: &str) -> Result<DVec3, String> {
    match numbers::<f64>(text)?.as_slice() {
        [all] => Ok(DVec3::splat(*all)),
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        other => Err(format!("{} numbers, not 1 or 3", other.len())),
    }
}

fn extent(text: &str) -> Result<(DVec3, [usize; 3]), String> {
    let wrong = || format!("'{text}' is not X,Y,Z,NX,NY,NZ");
    let words: Vec<_> = text.split(',').collect();
    let (Some(first), Some(size)) = (words.get(..3), words.get(3..6)) else {
        return Err(wrong());
    };
    let first = numbers::<f64>(&first.join(","))?;
    let size = <[usize; 3]>::try_from(numbers::<usize>(&size.join(","))?);
    match (words.len(), size) {
        (6, Ok(size)) => Ok((DVec3::from_slice(&first), size)),
        _ => Err(wrong()),
    }
}

fn clip(text: &str) -> Result<[i32; 4], String> {
    let numbers = numbers::<i32>(text)?;
    <[i32; 4]>::try_from(numbers).map_err(|_| "four numbers are needed".to_owned())
}

/// Runs the command.
///
/// # Errors
/// Every fault of files and settings, reported once.
pub fn run(args: &Reconstruct) -> Result<()> {
    distinct(
        &[("the tracked frames", Some(&args.sequence)), ("--config", args.config.as_deref())],
        &[("-o", Some(&args.output))],
    )?;
    writable(&args.output)?;
    let (mut sequence, warnings) = Sequence::load(&args.sequence)?;
    notes(&warnings);
    sequence.has_one_pixel_size(&args.sequence)?;
    let config = args.config.as_deref().map(Config::load).transpose()?;
    let mut config = config.unwrap_or_else(|| Config {
        transforms: Transforms::default(),
        settings: Settings::new(DVec3::splat(0.5)),
        image: None,
        reference: None,
    });
    let image = args.image.as_deref().or(config.image.as_deref());
    let image = image.unwrap_or("Image").to_owned();
    let reference = args.reference.as_deref().or(config.reference.as_deref());
    let reference = reference.unwrap_or("Reference").to_owned();
    if let Some(matrix) = args.image_to_probe {
        config.transforms = Transforms::default();
        // What the sequence itself says of its pixels goes before a configuration, and not before this.
        let (from, to) = (format!("{image}To"), format!("To{image}"));
        for frame in &mut sequence.frames {
            frame.poses.retain(|name, _| !name.starts_with(&from) && !name.ends_with(&to));
        }
        config.transforms.add(&image, "Probe", matrix);
    }
    let settings = &mut config.settings;
    settings.spacing = args.spacing.unwrap_or(settings.spacing);
    settings.lattice = args.extent.or(settings.lattice);
    settings.clip = args.clip.or(settings.clip);
    settings.interpolation = args.interpolation.unwrap_or(settings.interpolation);
    settings.compounding = args.compounding.unwrap_or(settings.compounding);
    if let Some(length) = args.fill {
        let stick = Filling::Stick { length: usize::from(length), count: 1 };
        settings.holes = if length > 0 { vec![stick] } else { vec![] };
    }
    let about = || format!("reconstructing {}", args.sequence.display());
    if settings.fan.is_none() {
        let fan = Fan::of(&sequence).map_err(miette::Report::from);
        settings.fan = fan.wrap_err_with(about)?;
    }
    let poses = config.transforms.of_frames(&sequence, &image, &reference);
    let poses = poses.map_err(miette::Report::from).wrap_err_with(about)?;
    let made = reconstruct(&sequence, &poses, &config.settings);
    let made = made.map_err(miette::Report::from).wrap_err_with(about)?;
    write_meta(&args.output, &made.volume)?;
    tell(&args.output, &made, sequence.frames.len());
    Ok(())
}

/// Prints the result for `frames` frames.
pub fn tell(path: &Path, made: &Reconstruction, frames: usize) {
    output::line(path.display());
    output::line(&made.volume);
    let empty = made.volume.voxels.len() - made.reached - made.filled;
    output::line(format!(
        "  {} of {frames} frames; {} voxels reached, {} filled, {empty} empty",
        made.frames, made.reached, made.filled
    ));
}
