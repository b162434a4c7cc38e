//! Errors of volume files: place, cause, and remedy.

use std::path::{Path, PathBuf};

use miette::Diagnostic;
use thiserror::Error;

/// Place of a mistake in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// Line of a text header, from 1.
    Line(usize),
    /// Byte of the file, or of its decompressed content, from 0.
    Byte(u64),
}

/// A mistake in a volume file. Nothing is loaded.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{message}", self.prefix())]
#[diagnostic(help("{remedy}"))]
pub struct VolumeError {
    /// The faulty file: the header, or the data file that it names.
    pub file: PathBuf,
    /// Place in it.
    pub place: Place,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: String,
}

impl VolumeError {
    /// An error of the whole file.
    pub(super) fn file(file: &Path, message: impl Into<String>, remedy: &str) -> Self {
        Self {
            file: file.to_owned(),
            place: Place::File,
            message: message.into(),
            remedy: remedy.to_owned(),
        }
    }

    /// An error on a line of a text header, from 1.
    pub(super) fn line(file: &Path, line: usize, message: impl Into<String>, remedy: &str) -> Self {
        Self { place: Place::Line(line), ..Self::file(file, message, remedy) }
    }

    /// An error at a byte, from 0.
    pub(super) fn byte(file: &Path, byte: u64, message: impl Into<String>, remedy: &str) -> Self {
        Self { place: Place::Byte(byte), ..Self::file(file, message, remedy) }
    }

    fn prefix(&self) -> String {
        match self.place {
            Place::File => format!("{}: ", self.file.display()),
            Place::Line(line) => format!("{}:{line}: ", self.file.display()),
            Place::Byte(byte) => format!("{}: byte {byte}: ", self.file.display()),
        }
    }
}
