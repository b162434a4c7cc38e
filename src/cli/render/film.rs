//! The files that the frames of a render become: an image each, or one file of all.

use std::path::{Path, PathBuf};

use glam::DAffine3;
use miette::{IntoDiagnostic, Result, miette};
use serde_json::{Map, Value, json};

use super::coloured::coloured;
use super::mode::Colours;
use super::moments::Moment;
use super::strained::strained;
use crate::cli::common;
use crate::cli::images::Images;
use insonify::acquire::Recording;
use insonify::doppler;
use insonify::exchange::{self, Format, Frames};
use insonify::output;
use insonify::output::dicom::About;
use insonify::output::lock::Hold;
use insonify::output::mp4::Mp4;
use insonify::output::picture::{colour_png, grey_png};
use insonify::output::{files, film};
use insonify::scene::Scene;
use insonify::sim::Simulator;
use insonify::sim::facts::{self, Area};

/// Name of the transform from the probe to the patient's RAS.
const POSE: &str = "ProbeToReference";

/// The output of a render.
pub struct Film {
    /// Frames per second at which a loop is shown.
    shown: f64,
    /// Time of each frame of a sequence, s.
    times: Vec<f64>,
    /// RAS from the world.
    ras_from_world: DAffine3,
    reel: Reel,
    /// Text beside the pictures and in them: what was imaged, and how.
    sidecar: Map<String, Value>,
    /// What is said of each frame: file, time, pose.
    frames: Vec<Value>,
    /// No other run writes pictures of these names meanwhile.
    _held: Option<Hold>,
}

/// How a frame is coloured.
#[derive(Clone, Copy)]
pub struct Coloured<'p> {
    /// Source of the colours.
    pub colours: Colours,
    /// Time of the scene in the frame, s; frames may be shown at others.
    pub seconds: f64,
    /// File for what they were made of.
    pub packet: Option<&'p Path>,
}

enum Reel {
    Images(Images),
    Loop(film::Film),
    Sequence(Recording),
    Exchange(Box<Frames>, Format),
}

/// Refuses a file that could not be written in the end; makes its folder.
///
/// # Errors
/// Its folder cannot be made or written to; an extension that says no format, a header with its pixels elsewhere.
pub fn check(output: &Path, frames: u32) -> Result<()> {
    if ends(output, ["mhd", "nhdr"]) {
        return Err(miette!(
            help = "end the name in .mha or .nrrd",
            "{} is not written: frames with poses are in one file",
            output.display()
        ));
    }
    let is_picture = ends(output, ["png", ""]);
    let is_known = is_picture || film::Film::is_meant(output) || is_sequence(output);
    if !is_known && Format::of(output).is_none() {
        return Err(miette!(
            help = "end the name in .png (pictures), .gif (an animation), .mp4 (a film), .dcm (a loop in DICOM), .seq.mha or .seq.nrrd, \
                    .uff or .hdf5 (data)",
            "{} is not written: its ending is that of no format that is known here",
            output.display()
        ));
    }
    if Mp4::is_meant(output) {
        Mp4::check().into_diagnostic()?;
    }
    match is_picture {
        true => common::writable(&Images::new(output, frames).path(0)),
        false => common::writable(output),
    }
}

/// Refuses a file that holds no colours.
///
/// # Errors
/// Another file than a picture or a film.
pub fn check_colour(output: &Path) -> Result<()> {
    match ends(output, ["png", ""]) || film::Film::is_meant(output) {
        true => Ok(()),
        false => Err(miette!(
            help = "end the name in .png (several frames are numbered), .gif, .mp4 or .dcm; --packet has the numbers",
            "{} holds grey images, and --mode colours them",
            output.display()
        )),
    }
}

/// Returns whether `path` names frames with poses, by its extension.
fn is_sequence(path: &Path) -> bool {
    ends(path, ["mha", "nrrd"])
}

fn ends(path: &Path, with: [&str; 2]) -> bool {
    let extension = path.extension().unwrap_or_default();
    with.iter().any(|e| extension.eq_ignore_ascii_case(e))
}

impl Film {
    /// Begins the output of frames at these moments, `shown` of them a second, in these colours.
    ///
    /// # Errors
    /// A file that cannot be made; numbered pictures that another run is writing; frames that do not fit into it.
    pub fn new(
        output: &Path,
        simulator: &Simulator,
        scene: &Scene,
        moments: &[Moment],
        shown: f64,
        colours: Option<Colours>,
        sidecar: Map<String, Value>,
    ) -> Result<Self> {
        let about = || about(scene, simulator, colours);
        let film = film::Film::of(output, shown, colours.is_some(), about);
        let reel = if let Some(film) = film.into_diagnostic()? {
            Reel::Loop(film)
        } else if is_sequence(output) {
            let recording = Recording::new(simulator, scene, moments.len());
            Reel::Sequence(recording.map_err(|e| {
                miette!(help = "render fewer, or lower imaging.image_height", "{e}")
            })?)
        } else if let Some(format) = Format::of(output) {
            let about = format!("insonify, `{}`", scene.name);
            let frames =
                Frames::new(about, scene.name.clone(), &scene.probe, simulator.constants());
            Reel::Exchange(Box::new(frames), format)
        } else {
            Reel::Images(Images::new(output, moments.len() as u32))
        };
        let held = match &reel {
            Reel::Images(images) if moments.len() > 1 => Some(held(images)?),
            _ => None,
        };
        // Where time stands still it goes on as the loop is shown: frames are told apart by their times.
        let goes_on = moments.windows(2).all(|pair| pair[0].seconds < pair[1].seconds);
        let times = (0u32..).zip(moments).map(|(index, moment)| match goes_on {
            true => moment.seconds,
            false => f64::from(index) / shown,
        });
        let ras_from_world = scene.tracker.axes.to_ras();
        let times = times.collect();
        Ok(Self { shown, times, ras_from_world, reel, sidecar, frames: Vec::new(), _held: held })
    }

    /// Adds the last frame of the simulator, the one of this number, in colour where it says so.
    ///
    /// # Errors
    /// An error of the device, of the format or of the file system.
    pub fn add(
        &mut self,
        index: u32,
        simulator: &mut Simulator,
        scene: &mut Scene,
        coloured_by: Option<Coloured<'_>>,
    ) -> Result<()> {
        let (width, height, mut rgba) = simulator.pixels().into_diagnostic()?;
        let area = area(simulator);
        let mut said = None;
        if let Some(Coloured { colours, seconds, packet }) = coloured_by {
            let at = (index, seconds);
            let (coloured, facts) = match colours {
                Colours::Doppler(mode) => coloured(simulator, scene, mode, at, packet)?,
                Colours::Strain => strained(simulator, scene, at, packet)?,
            };
            (rgba, said) = (coloured, Some(facts));
        }
        if index == 0 {
            self.sidecar.insert("image".into(), facts::image(&area));
        }
        let mut frame = Map::new();
        if let Reel::Images(images) = &self.reel {
            frame.insert("file".into(), name(&images.path(index)));
        }
        frame.insert("time_s".into(), json!(self.times[index as usize]));
        frame.insert("pose".into(), facts::pose(&scene.world_from_probe));
        let colours = said.is_some();
        frame.extend(said.map(|facts| ("doppler".to_owned(), facts)));
        match &mut self.reel {
            Reel::Images(images) => {
                let mut text = self.sidecar.clone();
                text.extend(frame.clone());
                let text = Value::Object(text).to_string();
                let png = if colours { colour_png } else { grey_png };
                let picture = png([width, height], &rgba, area.pitch, Some(&text));
                let path = images.path(index);
                files::replace(&path, &picture)
                    .map_err(|e| miette!("writing {}: {e}", path.display()))?;
            }
            Reel::Loop(film) => {
                let end = f64::from(index + 1) / self.shown;
                frame.insert("shown_until_s".into(), json!(end));
                film.add([width, height], &rgba, end).into_diagnostic()?;
            }
            Reel::Sequence(recording) => {
                let pose = self.ras_from_world * scene.world_from_probe;
                recording.add(&rgba, self.times[index as usize], [(POSE, pose)]);
            }
            Reel::Exchange(frames, format) => {
                let time = self.times[index as usize];
                frames.add(*format, simulator, scene, time).into_diagnostic()?;
                let all = frames.held() / u64::from(index + 1) * self.times.len() as u64;
                if all > exchange::MOST_BYTES {
                    return Err(miette!(
                        help = "render fewer frames, or lower probe.scanlines, probe.samples or \
                                imaging.image_height",
                        "{} frames are {} GiB: a file of them holds at most {}",
                        self.times.len(),
                        all >> 30,
                        exchange::MOST_BYTES >> 30
                    ));
                }
            }
        }
        self.frames.push(Value::Object(frame));
        Ok(())
    }

    /// Writes what is left to write, and says what was written. Returns what is said of the frames; of pictures and
    /// animations that becomes a file beside them, unless the caller writes it all into that file (`elsewhere`).
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn finish(mut self, output: &Path, elsewhere: Option<&Path>) -> Result<Map<String, Value>> {
        let mut sidecar = None;
        match self.reel {
            Reel::Images(images) => {
                output::line(&images);
                sidecar = Some(images.sidecar());
            }
            Reel::Loop(film) => {
                // A DICOM file says all of it itself.
                let beside = !matches!(film, film::Film::Dicom { .. });
                film.finish().into_diagnostic()?;
                output::line(output.display());
                self.sidecar.insert("file".into(), name(output));
                sidecar = beside.then(|| output.with_extension("json"));
            }
            Reel::Sequence(recording) => {
                recording.finish().write(output)?;
                output::line(output.display());
                self.sidecar.insert("file".into(), name(output));
            }
            Reel::Exchange(frames, format) => {
                files::replace(output, &frames.bytes(format))
                    .map_err(|e| miette!("writing {}: {e}", output.display()))?;
                output::line(output.display());
                self.sidecar.insert("file".into(), name(output));
            }
        }
        self.sidecar.insert("frames".into(), self.frames.into());
        let beside = |path: &PathBuf| elsewhere != Some(path) && !files::is_stream(output);
        if let Some(path) = sidecar.filter(beside) {
            common::write_sidecar(&path, &self.sidecar)?;
        }
        Ok(self.sidecar)
    }
}

/// The right to write these pictures, one after the other.
fn held(images: &Images) -> Result<Hold> {
    let first = images.path(0);
    let path =
        first.with_file_name(format!(".{}.lock", first.file_name().unwrap_or_default().display()));
    let taken = Hold::take(&path).map_err(|e| miette!("writing {}: {e}", path.display()))?;
    taken.ok_or_else(|| {
        miette!(
            help = "wait for its end or stop it, or name other pictures by -o",
            "{images}: another run is writing pictures of these names"
        )
    })
}

/// The last part of a path.
fn name(path: &Path) -> Value {
    path.file_name().unwrap_or_default().to_string_lossy().into()
}

/// Place of the last frame's picture.
fn area(simulator: &Simulator) -> Area {
    let frame = simulator.constants();
    Area {
        size: [frame.image_width, frame.image_height],
        pitch: f64::from(frame.pixel_pitch),
        corner: [frame.image_left, frame.image_top].map(f64::from),
    }
}

/// The facts that a loop in DICOM states beside its frames.
fn about(scene: &Scene, simulator: &Simulator, colours: Option<Colours>) -> About {
    let Area { pitch, corner, .. } = area(simulator);
    let colours = match colours {
        Some(Colours::Doppler(mode)) => {
            Some(doppler::shown(&scene.probe, &mode.doppler(&scene.settings)))
        }
        Some(Colours::Strain) | None => None,
    };
    About {
        name: scene.name.clone(),
        pitch,
        corner,
        frequency: scene.probe.frequency,
        transducer: exchange::transducer(&scene.probe),
        colours,
        study: None,
    }
}
