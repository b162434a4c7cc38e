//! `insonify acquire`: tracked frames of a scene while the probe follows a sweep.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::DVec3;
use insonify::acquire::{self, Station, Sweep};
use insonify::output;
use insonify::output::dicom;
use insonify::scene::Scene;
use insonify::scene::file;
use insonify::settings::units::{ANGLE, DURATION, LENGTH};
use insonify::sim::shaders::Library;
use insonify::volume::{Format, Reconstruction, Sequence, Settings, write_meta};
use miette::{Context, IntoDiagnostic, Result, miette};

use super::common::{self, Common, Progress, Stage};
use super::reconstruct::{spacing, tell};

mod planes;

/// Arguments of `insonify acquire`.
#[derive(Debug, Args)]
pub struct Acquire {
    /// Scene file (.toml). Its pose of the probe is the middle of the sweep.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// Path of the probe: linear:LENGTH along its elevation axis, tilt:ANGLE about its lateral axis,
    /// rotate:ANGLE about its depth axis, from the first frame to the last, e.g. linear:30mm or
    /// tilt:40deg; or a file (.csv, .toml) of its poses in the world: time_s, x_mm, y_mm, z_mm, qw, qx,
    /// qy, qz.
    #[arg(long, value_name = "KIND:EXTENT|FILE", value_parser = way)]
    sweep: Way,
    /// Frames to take, evenly spaced [default: 41; of a file one for each of its rows].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: Option<u32>,
    /// Tracked frames to write (.mha, .nrrd), as PLUS and 3D Slicer read them.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Volume to reconstruct from them (.mha; .dcm: an Enhanced US Volume), along the axes of the probe at its middle
    /// frame.
    #[arg(long, value_name = "FILE")]
    volume: Option<PathBuf>,
    /// Volumes to reconstruct over time, evenly over --period: each from a sweep of its own, while the
    /// anatomy stands still at its time, as a gated acquisition puts them together.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(2..=1000),
        requires_all = ["volume", "period"], conflicts_with_all = ["output", "moving"])]
    volumes: Option<u32>,
    /// Time that --volumes cover, from --time on: seconds or with a unit, e.g. 0.8s.
    #[arg(long, value_name = "TIME", value_parser = period, requires = "volumes")]
    period: Option<f64>,
    /// Distance of the volume's voxels, mm: one number, or lateral,elevation,depth as 0.5,1,0.3.
    #[arg(long, value_parser = spacing, default_value = "0.5", requires = "volume")]
    spacing: DVec3,
    /// Frames per second of the timestamps; a file has times of its own.
    #[arg(long, value_name = "HZ", default_value_t = 20.0, value_parser = common::between(1e-3, 1e4))]
    rate: f64,
    /// Lets the anatomy move on as the timestamps do [default: it stands still].
    #[arg(long)]
    moving: bool,
    #[command(flatten)]
    common: Common,
}

/// Value of `--sweep`.
#[derive(Clone, Debug)]
enum Way {
    /// About the scene's pose.
    Sweep(Sweep),
    /// Poses in a file.
    File(PathBuf),
}

fn way(text: &str) -> Result<Way, String> {
    let Some((kind, extent)) = text.split_once(':') else {
        let path = PathBuf::from(text);
        let extension = path.extension().and_then(|e| e.to_str());
        return match extension.map(str::to_ascii_lowercase).as_deref() {
            Some("csv" | "toml") => Ok(Way::File(path)),
            _ => {
                Err("give linear:LENGTH, tilt:ANGLE, rotate:ANGLE, or a .csv or .toml file".into())
            }
        };
    };
    let bounded = |value: f64, most: f64| match value.abs() <= most {
        true => Ok(value),
        false => Err(format!("`{extent}` is too far")),
    };
    let turn = || bounded(ANGLE.finite(extent)?, std::f64::consts::TAU);
    Ok(Way::Sweep(match kind {
        "linear" => Sweep::Linear(bounded(LENGTH.finite(extent)?, 1e4)?),
        "tilt" => Sweep::Tilt(turn()?),
        "rotate" => Sweep::Rotate(turn()?),
        _ => return Err(format!("`{kind}` is no sweep: linear, tilt and rotate are")),
    }))
}

fn period(text: &str) -> Result<f64, String> {
    let value = DURATION.finite(text)?;
    match (1e-6..=86_400.0).contains(&value) {
        true => Ok(value),
        false => Err("it must lie between 0.000001 and 86400 s".to_owned()),
    }
}

/// Refuses names that cannot be written, before minutes of work for them.
fn writable(args: &Acquire) -> Result<()> {
    let ends = |path: &Path, kinds: &[&str]| {
        let extension = path.extension().unwrap_or_default();
        kinds.iter().any(|kind| extension.eq_ignore_ascii_case(kind))
    };
    if let Some(path) = args.output.as_deref().filter(|path| !ends(path, &["mha", "nrrd"])) {
        return Err(miette!(
            help = match dicom::is_meant(path) {
                true => "write a volume by --volume NAME.dcm; end this name in .mha or .nrrd",
                false => "end the name in .mha or .nrrd",
            },
            "{} is not written: tracked frames are MetaImage or NRRD in one file",
            path.display()
        ));
    }
    if let Some(path) = args.volume.as_deref().filter(|path| !ends(path, &["mha", "dcm"])) {
        return Err(miette!(
            help = "end the name in .mha or .dcm",
            "{} is not written: a volume is MetaImage in one file or DICOM",
            path.display()
        ));
    }
    if let (Some(path), Some(_)) = (&args.volume, args.volumes)
        && dicom::is_meant(path)
    {
        return Err(miette!(
            help = "end the name in .mha",
            "{} is not written: volumes over time are MetaImage",
            path.display()
        ));
    }
    common::distinct(
        &[("the scene", Some(&args.scene))],
        &[("-o", args.output.as_deref()), ("--volume", args.volume.as_deref())],
    )?;
    args.output.iter().chain(&args.volume).try_for_each(|path| common::writable(path))
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once.
pub fn run(args: &Acquire) -> Result<()> {
    if args.output.is_none() && args.volume.is_none() {
        return Err(miette!(
            help = "give -o NAME.igs.mha for the tracked frames, --volume NAME.mha for the volume that they make, or both",
            "nothing would be written"
        ));
    }
    writable(args)?;
    let mut scene = args.common.scene(&args.scene)?;
    let stations = stations(args, &scene)?;
    let mut made: Vec<Reconstruction> = Vec::new();
    let mut single = None;
    simulate(args, &mut scene, &stations, |sequence| {
        match (args.volumes, &args.volume) {
            (Some(count), Some(path)) => {
                made.push(reconstructed(args, path, &sequence)?);
                made[0].volume.fits(count as usize, path)?;
            }
            _ => single = Some(sequence),
        }
        Ok(())
    })?;
    if let (Some(path), Some(sequence)) = (&args.output, &single) {
        sequence.write(path)?;
        output::line(path.display());
        let [width, height] = sequence.size;
        let count = sequence.frames.len();
        output::line(format!("  {count} tracked frames of {width} x {height} pixels"));
    }
    if let (Some(path), Some(sequence)) = (&args.volume, &single) {
        made.push(reconstructed(args, path, sequence)?);
    }
    let mut made = made.into_iter();
    if let (Some(path), Some(mut first)) = (&args.volume, made.next()) {
        let later: Vec<_> = made.map(|own| own.volume).collect();
        if let (Some(count), Some(period)) = (args.volumes, args.period) {
            first.volume = first.volume.followed_by(later, period / f64::from(count));
        }
        match dicom::is_meant(path) {
            true => {
                planes::of(&first.volume, &scene, &stations).write(path).into_diagnostic()?;
                first.volume.format = Format::Dicom;
            }
            false => write_meta(path, &first.volume)?,
        }
        tell(path, &first, stations.len());
    }
    Ok(())
}

fn reconstructed(args: &Acquire, path: &Path, sequence: &Sequence) -> Result<Reconstruction> {
    let made = acquire::volume(sequence, Settings::new(args.spacing));
    let about = || format!("reconstructing {}", path.display());
    made.map_err(miette::Report::from).wrap_err_with(about)
}

fn stations(args: &Acquire, scene: &Scene) -> Result<Vec<Station>> {
    match &args.sweep {
        Way::Sweep(sweep) => Ok(sweep.stations(scene, args.frames.unwrap_or(41), args.rate)),
        Way::File(path) => {
            let track = file::load_trajectory(path)?;
            Ok(acquire::stations_of(&track, scene, args.frames))
        }
    }
}

/// Follows the sweep once, or once for each of the volumes; `taken` gets the frames of each.
fn simulate(
    args: &Acquire,
    scene: &mut Scene,
    stations: &[Station],
    mut taken: impl FnMut(Sequence) -> Result<()>,
) -> Result<()> {
    let Stage { device, mut simulator, .. } = args.common.stage(scene, &Library::embedded())?;
    let count = args.volumes.unwrap_or(1);
    let frames = stations.len() as u32;
    let mut progress = Progress::new(count * frames, "frames");
    let moving = args.moving.then_some(args.common.time);
    let mut follow = || {
        for number in 0..count {
            if let Some(period) = args.period {
                let passed = period * f64::from(number) / f64::from(count);
                scene.set_time(args.common.time + passed);
            }
            let made = acquire::acquire(&mut simulator, scene, stations, moving, |index| {
                progress.done(number * frames + index as u32 + 1);
            });
            taken(made.into_diagnostic()?)?;
        }
        Ok(())
    };
    let followed: Result<()> = follow();
    progress.finish();
    followed?;
    args.common.validated(&device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_have_a_kind_and_an_extent() {
        let sweep = |text: &str| match way(text) {
            Ok(Way::Sweep(sweep)) => sweep,
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(sweep("linear:30"), Sweep::Linear(30.0));
        assert_eq!(sweep("linear:-3 cm"), Sweep::Linear(-30.0));
        assert_eq!(sweep("tilt:180deg"), Sweep::Tilt(std::f64::consts::PI));
        assert_eq!(sweep("rotate:1 rad"), Sweep::Rotate(1.0));
        assert!(matches!(way("a/way.CSV"), Ok(Way::File(_))));
        for (text, cause) in [
            ("linear", "linear:LENGTH"),
            ("tilt:40", "has no unit"),
            ("linear:40deg", "does not fit"),
            ("rotate:400deg", "too far"),
            ("lineal:3", "no sweep"),
            ("way.txt", ".csv or .toml"),
        ] {
            let message = way(text).expect_err(text);
            assert!(message.contains(cause), "{text}: {message}");
        }
    }
}
