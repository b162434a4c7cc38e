//! Errors of an import: place, cause, remedy.

use std::path::{Path, PathBuf};

use miette::Diagnostic;
use thiserror::Error;

use crate::volume::VolumeError;

/// A mistake in the imported data. Nothing is written.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{message}", self.place())]
#[diagnostic(help("{remedy}"))]
pub struct ImportError {
    /// The file or folder.
    pub file: PathBuf,
    /// Line of a text, from 1; 0 where there is none.
    pub line: usize,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: String,
}

impl ImportError {
    /// An error of a whole file or folder.
    pub fn file(file: &Path, message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::line(file, 0, message, remedy)
    }

    /// An error on a line of a text, from 1.
    pub fn line(
        file: &Path,
        line: usize,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let (message, remedy) = (message.into(), remedy.into());
        Self { file: file.to_owned(), line, message, remedy }
    }

    fn place(&self) -> String {
        match self.line {
            0 => format!("{}: ", self.file.display()),
            line => format!("{}:{line}: ", self.file.display()),
        }
    }
}

impl From<VolumeError> for ImportError {
    fn from(error: VolumeError) -> Self {
        use crate::volume::Place;
        let (line, message) = match error.place {
            Place::File => (0, error.message),
            Place::Line(line) => (line, error.message),
            Place::Byte(byte) => (0, format!("byte {byte}: {}", error.message)),
        };
        Self { file: error.file, line, message, remedy: error.remedy }
    }
}
