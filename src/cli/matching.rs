//! `insonify match`: image formation fitted to the acquired volume around the mask.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use insonify::matching::{self, Adjusted, MatchError, Matching, Options};
use insonify::output;
use insonify::scene::Imaging;
use insonify::scene::file::{self, Entry, save};
use insonify::settings::Group;
use insonify::sim::shaders::Library;
use miette::{Result, miette};

use super::common::{self, Common, Stage};

mod table;

/// Arguments of `insonify match`. What --set and --seed change holds while fitting; what is not fitted of
/// it is not written.
#[derive(Debug, Args)]
pub struct Match {
    /// Scene file (.toml) with [volume] and [fusion]; its [imaging] is fitted.
    #[arg(value_parser = common::scene_file())]
    scene: PathBuf,
    /// Scene file to write [default: none; what would be set is printed].
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes into SCENE itself.
    #[arg(long, conflicts_with = "output")]
    in_place: bool,
    /// Width of the band around the mask that is compared, mm.
    #[arg(long, default_value_t = 4.0, value_parser = band)]
    band: f64,
    /// Settings to be fitted.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "gain,tgc,range,size")]
    fit: Vec<Fitted>,
    /// Realisations of the speckle that are simulated per round: more are surer.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    frames: u32,
    #[command(flatten)]
    common: Common,
}

/// Value of `--fit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Fitted {
    /// Gain.
    Gain,
    /// The sliders of the time-gain compensation.
    Tgc,
    /// Dynamic range.
    Range,
    /// Axial and lateral scale of the point-spread function.
    Size,
}

fn band(text: &str) -> Result<f64, String> {
    let number = text.trim().trim_end_matches("mm").trim_end();
    match number.parse() {
        Ok(width) if (0.5..=100.0).contains(&width) => Ok(width),
        Ok(_) => Err("it must lie between 0.5 and 100 mm".to_owned()),
        Err(_) => Err("a width in mm is needed".to_owned()),
    }
}

/// Runs the command.
///
/// # Errors
/// Every mistake of the user and every error of the device, reported once; settings that no scanner would have. The
/// scene file is then untouched.
pub fn run(args: &Match) -> Result<()> {
    if let Some(output) = &args.output {
        common::writable(output)?;
    }
    let mut scene = args.common.scene(&args.scene)?;
    let stage = args.common.stage(&mut scene, &Library::embedded())?;
    let Stage { device, mut simulator, .. } = stage;
    let fits = |what| args.fit.contains(&what);
    let options = Options {
        band: args.band,
        frames: args.frames,
        adjusted: Adjusted {
            gain: fits(Fitted::Gain),
            tgc: fits(Fitted::Tgc),
            range: fits(Fitted::Range),
            size: fits(Fitted::Size),
        },
    };
    let progress = |round: usize, imaging: &Imaging| {
        let [axial, lateral, _] = imaging.psf_scale;
        output::note(format!(
            "round {round}: gain {:.1} dB, dynamic range {:.1} dB, psf_scale {axial} {lateral}",
            imaging.gain, imaging.dynamic_range
        ));
    };
    let made = matching::fit(&mut simulator, &mut scene, &options, progress);
    let made = made.map_err(|error| match error {
        MatchError::Nothing { cause, remedy } => {
            miette!(help = remedy, "{} cannot be matched: {cause}", args.scene.display())
        }
        MatchError::Sim(error) => miette!(error),
    })?;
    args.common.validated(&device)?;
    table::print(&scene.probe, &made);
    for note in &made.notes {
        output::note(format!("warning: {note}"));
    }
    if !made.faults.is_empty() {
        return Err(miette!(
            help = "nothing is set. Does the scene have the tissue around the mask that the volume shows there? \
                    Else fit less (--fit gain), widen --band, or start from other settings (--set imaging.gain=...)",
            "{} is not matched by plausible settings of a scanner: {}",
            args.scene.display(),
            made.faults.join("; ")
        ));
    }
    write(args, &made)
}

/// Prints the changes, and writes them where that is asked for.
fn write(args: &Match, made: &Matching) -> Result<()> {
    let settings = settings(made, &args.common.overrides);
    for (path, value) in settings.iter().filter_map(|(p, v)| Some((p, v.as_ref()?))) {
        output::line(format!("{path} = {value}"));
    }
    if settings.is_empty() {
        output::line("matched already: nothing to set");
    }
    let output = match (&args.output, args.in_place) {
        (Some(output), _) => output,
        (None, true) if settings.is_empty() => return Ok(()),
        (None, true) => &args.scene,
        (None, false) => {
            output::note(
                "nothing is written; -o FILE writes a scene file with these settings, --in-place this one",
            );
            return Ok(());
        }
    };
    save(&args.scene, output, &settings)?;
    output::line(output.display());
    Ok(())
}

/// Entries of the scene file that have changed, as `--set` takes them; overridden ones count as changed,
/// since the file may give another value.
fn settings(made: &Matching, overrides: &[(String, String)]) -> Vec<Entry> {
    let after = file::entries(&made.after.imaging, Imaging::TABLE);
    let changed = file::changes(&made.before.imaging, &made.after.imaging, Imaging::TABLE);
    let overridden = |path: &str| overrides.iter().any(|(set, _)| set.starts_with(path));
    let out = after.into_iter();
    out.filter(|entry| changed.contains(entry) || overridden(&entry.0)).collect()
}
