//! Films: images one after the other in one file, which shows them as a loop.

use std::path::Path;

use super::dicom::{self, About, DicomError, Loop};
use super::movie::{Movie, MovieError};
use super::mp4::{Mp4, Mp4Error};

/// A film being written.
pub enum Film {
    /// An animated GIF.
    Gif(Movie),
    /// An MP4 film, by `ffmpeg`.
    Mp4(Mp4),
    /// A loop in DICOM.
    Dicom {
        /// The images.
        images: Box<Loop>,
        /// The time that each is shown, ms, where that is the same for all.
        each: Option<f64>,
        /// Else the time until which each is shown, ms from the beginning.
        ends: Vec<f64>,
    },
}

/// The reason why a film cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// That of a GIF.
    #[error(transparent)]
    Gif(#[from] MovieError),
    /// That of an MP4 film.
    #[error(transparent)]
    Mp4(#[from] Mp4Error),
    /// That of a DICOM file.
    #[error(transparent)]
    Dicom(#[from] DicomError),
}

impl Film {
    /// Returns whether `path` names a film, by its extension.
    pub fn is_meant(path: &Path) -> bool {
        Movie::is_meant(path) || Mp4::is_meant(path) || dicom::is_meant(path)
    }

    /// The film that `path` names by its extension, `rate` images a second, with colours or grey; `about` is the head of a
    /// DICOM file. None for other files.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn of(
        path: &Path,
        rate: f64,
        colours: bool,
        about: impl FnOnce() -> About,
    ) -> Result<Option<Self>, FilmError> {
        Ok(Some(match path {
            path if Movie::is_meant(path) && colours => Self::Gif(Movie::coloured(path)?),
            path if Movie::is_meant(path) => Self::Gif(Movie::new(path)?),
            path if Mp4::is_meant(path) => Self::Mp4(Mp4::new(path, rate)),
            path if dicom::is_meant(path) => Self::dicom(path, about(), Some(1e3 / rate)),
            _ => return Ok(None),
        }))
    }

    /// A loop in DICOM; `each` is the time that each image is shown, ms, where that is the same for all.
    pub fn dicom(path: &Path, about: About, each: Option<f64>) -> Self {
        Self::Dicom { images: Box::new(Loop::new(path, about)), each, ends: Vec::new() }
    }

    /// Adds an image of this width and height, RGBA; it is shown until `end`, s from the beginning.
    ///
    /// # Errors
    /// Errors of the file system and of the format.
    pub fn add(&mut self, size: [u32; 2], rgba: &[u8], end: f64) -> Result<(), FilmError> {
        let [width, height] = size;
        match self {
            Self::Gif(movie) => movie.add(width, height, rgba, end)?,
            Self::Mp4(film) => film.add(width, height, rgba, end)?,
            Self::Dicom { images, ends, .. } => {
                images.add(width, height, rgba)?;
                ends.push(1e3 * end);
            }
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// Errors of the file system; more images than a DICOM file can time one by one.
    ///
    /// # Panics
    /// A loop in DICOM without an image.
    pub fn finish(self) -> Result<(), FilmError> {
        match self {
            Self::Gif(movie) => movie.finish()?,
            Self::Mp4(film) => film.finish()?,
            Self::Dicom { images, each: Some(each), .. } => images.finish(each)?,
            Self::Dicom { images, each: None, ends } => images.finish_at(&ends)?,
        }
        Ok(())
    }
}
