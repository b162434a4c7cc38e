//! The files that the frames of a render become: an image each, or one file of all.

use std::path::Path;

use glam::DAffine3;
use miette::{IntoDiagnostic, Result, miette};

use super::Moment;
use crate::cli::common;
use crate::cli::images::Images;
use insonify::acquire::Recording;
use insonify::output;
use insonify::output::dicom::{self, About, Loop};
use insonify::output::movie::Movie;
use insonify::scene::Scene;
use insonify::sim::Simulator;
use insonify::sim::dump;

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
}

enum Reel {
    Images(Images),
    Movie(Movie),
    Dicom(Loop),
    Sequence(Recording),
}

/// Refuses a file that could not be written in the end.
///
/// # Errors
/// Its folder does not exist; a header with its pixels elsewhere.
pub fn check(output: &Path) -> Result<()> {
    if ends(output, ["mhd", "nhdr"]) {
        return Err(miette!(
            help = "end the name in .mha or .nrrd",
            "{} is not written: frames with poses are in one file",
            output.display()
        ));
    }
    match dicom::is_meant(output) || is_sequence(output) {
        true => common::in_folder(output),
        false => Ok(()),
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
    /// Begins the output of frames at these moments, `shown` of them a second.
    ///
    /// # Errors
    /// A file that cannot be made; frames that do not fit into it.
    pub fn new(
        output: &Path,
        simulator: &Simulator,
        scene: &Scene,
        moments: &[Moment],
        shown: f64,
    ) -> Result<Self> {
        let reel = if Movie::is_meant(output) {
            Reel::Movie(Movie::new(output).into_diagnostic()?)
        } else if dicom::is_meant(output) {
            Reel::Dicom(Loop::new(output, about(scene, simulator)))
        } else if is_sequence(output) {
            let recording = Recording::new(simulator, scene, moments.len());
            Reel::Sequence(recording.map_err(|e| {
                miette!(help = "render fewer, or lower imaging.image_height", "{e}")
            })?)
        } else {
            Reel::Images(Images::new(output, moments.len() as u32))
        };
        // Where time stands still it goes on as the loop is shown: frames are told apart by their times.
        let goes_on = moments.windows(2).all(|pair| pair[0].seconds < pair[1].seconds);
        let times = (0u32..).zip(moments).map(|(index, moment)| match goes_on {
            true => moment.seconds,
            false => f64::from(index) / shown,
        });
        let ras_from_world = scene.tracker.axes.to_ras();
        Ok(Self { shown, times: times.collect(), ras_from_world, reel })
    }

    /// Adds the last frame of the simulator, the one of this number.
    ///
    /// # Errors
    /// An error of the device, of the format or of the file system.
    pub fn add(&mut self, index: u32, simulator: &mut Simulator, scene: &Scene) -> Result<()> {
        let (width, height, rgba) = simulator.pixels().into_diagnostic()?;
        match &mut self.reel {
            Reel::Images(images) => {
                dump::png(&images.path(index), width, height, &rgba).into_diagnostic()
            }
            Reel::Movie(movie) => {
                let end = f64::from(index + 1) / self.shown;
                movie.add(width, height, &rgba, end).into_diagnostic()
            }
            Reel::Dicom(film) => film.add(width, height, &rgba).into_diagnostic(),
            Reel::Sequence(recording) => {
                let pose = self.ras_from_world * scene.world_from_probe;
                recording.add(&rgba, self.times[index as usize], [(POSE, pose)]);
                Ok(())
            }
        }
    }

    /// Writes what is left to write, and says what was written.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn finish(self, output: &Path) -> Result<()> {
        match self.reel {
            Reel::Images(images) => output::line(&images),
            Reel::Movie(_) => output::line(output.display()),
            Reel::Dicom(film) => {
                film.finish(1e3 / self.shown).into_diagnostic()?;
                output::line(output.display());
            }
            Reel::Sequence(recording) => {
                recording.finish().write(output)?;
                output::line(output.display());
            }
        }
        Ok(())
    }
}

/// The facts that a loop in DICOM states beside its frames.
fn about(scene: &Scene, simulator: &Simulator) -> About {
    let frame = simulator.constants();
    About {
        name: scene.name.clone(),
        pitch: f64::from(frame.pixel_pitch),
        corner: [frame.image_left, frame.image_top].map(f64::from),
        frequency: scene.probe.frequency,
        transducer: common::transducer(&scene.probe),
    }
}
