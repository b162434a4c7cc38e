//! DICOM files: images (Ultrasound), loops (Ultrasound Multi-frame) and volumes (Enhanced US Volume), uncompressed,
//! explicit little endian.
//!
//! Written with `dicom-object`, which knows types, paddings and lengths. Volumes are read by our own bounded
//! reader, which never allocates what a file only declares.

use std::path::{Path, PathBuf};

mod cine;
mod data;
mod regions;
mod study;
mod volume;

pub use cine::{About, Loop, spectra, still};
pub use regions::{ColourBox, SpectralScale};
pub use study::{Patient, Study};
pub use volume::{Motion, Volume};

/// Reason for which a file was not written.
#[derive(Debug, thiserror::Error)]
#[error("writing {}: {cause}", path.display())]
pub struct DicomError {
    /// The file.
    pub path: PathBuf,
    /// Message of the system, or what is wrong with the pixels.
    pub cause: String,
}

impl DicomError {
    fn new(path: &Path, cause: impl ToString) -> Self {
        Self { path: path.to_owned(), cause: cause.to_string() }
    }
}

/// Returns whether `path` names a file of this format, by its extension.
pub fn is_meant(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dcm"))
}

/// Shape of a transducer, and how it steers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transducer {
    /// Elements on an arc.
    Curved,
    /// Elements on a line.
    Linear,
    /// Elements on a line, from whose middle all lines start.
    Phased,
}

impl Transducer {
    /// Term of `TransducerType` (PS3.3, C.8.5.6.1.13).
    fn term(self) -> &'static str {
        match self {
            Self::Curved => "CURVED LINEAR",
            Self::Linear => "LINEAR",
            Self::Phased => "SECTOR_PHASED",
        }
    }

    /// Codes and meanings of geometry (PS3.16, CID 12033) and steering (CID 12034), all of DCM.
    fn codes(self) -> [[&'static str; 2]; 2] {
        let fixed = ["125257", "Fixed beam direction"];
        match self {
            Self::Curved => [["125253", "Curved linear ultrasound transducer geometry"], fixed],
            Self::Linear => [["125252", "Linear ultrasound transducer geometry"], fixed],
            Self::Phased => [
                ["125254", "Sector ultrasound transducer geometry"],
                ["125259", "Phased beam steering"],
            ],
        }
    }
}
