//! Clips: the images of a loop in one file, or in a folder.

use std::path::{Path, PathBuf};

use super::files::{self, Claim, scaled};
use super::{CaptureError, Outcome, Progress, SavedStrip, Sidecar};
use crate::output::dicom::About;
use crate::output::film::Film;
use crate::output::movie::Movie;
use crate::output::mp4::{self, Mp4};
use crate::picture::Frame;

/// File format of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// One animated GIF.
    Gif,
    /// One MP4 film, by `ffmpeg`.
    Mp4,
    /// A folder of PNG files.
    Sequence,
    /// One DICOM file; of stills, too.
    Dicom,
}

/// Images one after the other, to be saved.
pub(crate) struct Clip {
    /// Images, each with the time until which it is shown, s from the beginning.
    pub(crate) frames: Vec<(Frame, f64)>,
    /// The text written beside them.
    pub(crate) sidecar: Sidecar,
    /// File format.
    pub(crate) format: Format,
    /// Head of its DICOM file.
    pub(crate) about: About,
    /// The strips that are drawn.
    pub(crate) strips: Vec<SavedStrip>,
}

/// A clip being written.
enum Reel {
    Film(Film),
    Sequence(PathBuf),
}

/// The largest of a clip's images, whose size all get.
pub(crate) fn largest(frames: &[(Frame, f64)]) -> Option<&Frame> {
    frames.iter().map(|(frame, _)| frame).max_by_key(|frame| frame.image.extent())
}

impl Clip {
    /// Writes all images under a free number in a folder, which is made where it does not exist.
    pub(super) fn write(self, folder: &Path, stem: &str, progress: &Progress) -> Outcome {
        let mut claim = Claim::new(folder, stem)?;
        let target = match self.format {
            Format::Gif => claim.add(".gif"),
            Format::Mp4 => claim.add(".mp4"),
            Format::Sequence => claim.add_folder()?,
            Format::Dicom => claim.add(".dcm"),
        };
        let mut reel = match self.format {
            Format::Gif => {
                let colours = self.frames.iter().any(|(frame, _)| frame.coloured.is_some());
                let movie = if colours { Movie::coloured(&target) } else { Movie::new(&target) };
                Reel::Film(Film::Gif(movie?))
            }
            Format::Mp4 => {
                let ends = self.frames.iter().map(|(_, end)| *end);
                Reel::Film(Film::Mp4(Mp4::new(&target, mp4::rate(ends))))
            }
            Format::Sequence => Reel::Sequence(target.clone()),
            Format::Dicom => Reel::Film(Film::dicom(&target, self.about, None)),
        };
        let [width, height, _] =
            largest(&self.frames).map_or_else(Default::default, |frame| frame.image.extent());
        for (index, (frame, end)) in self.frames.into_iter().enumerate() {
            if progress.is_cancelled() {
                return Ok(None);
            }
            reel.add(index, end, &frame, [width, height])?;
            progress.step();
        }
        if let Reel::Film(film) = reel {
            film.finish()?;
        }
        let mut sidecar = self.sidecar;
        sidecar.insert("file".into(), files::name(&target));
        for strip in self.strips {
            strip.write(&mut claim, &mut sidecar)?;
        }
        claim.keep(&sidecar)?;
        Ok(Some(target))
    }
}

impl Reel {
    /// Adds an image at the size of the clip; `end` is the time until which it is shown, s from the beginning.
    fn add(
        &mut self,
        index: usize,
        end: f64,
        frame: &Frame,
        size: [u32; 2],
    ) -> Result<(), CaptureError> {
        let rgba = frame.saved().read_back()?;
        let [across, down, _] = frame.image.extent();
        let rgba = scaled(rgba, [across, down], size);
        match self {
            Self::Film(film) => film.add(size, &rgba, end)?,
            Self::Sequence(folder) => {
                let pitch = frame.sector.pitch * f64::from(down) / f64::from(size[1]);
                let file = folder.join(format!("{index:04}.png"));
                files::write_new(&file, &files::image_png(size, &rgba, pitch, None, frame))?;
            }
        }
        Ok(())
    }
}
