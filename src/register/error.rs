//! The reason why nothing can be registered: place, cause, and remedy.

use std::path::{Path, PathBuf};

use miette::Diagnostic;
use thiserror::Error;

/// A mistake in the data to be registered, or too little data. Nothing is changed.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{cause}", self.place())]
#[diagnostic(help("{remedy}"))]
pub struct RegisterError {
    /// The faulty file; none where it is the data as a whole.
    pub file: Option<PathBuf>,
    /// Line of its text, from 1; 0 for the whole file.
    pub line: u64,
    /// Cause.
    pub cause: String,
    /// Remedy.
    pub remedy: String,
}

impl RegisterError {
    /// An error of the data.
    pub(super) fn data(cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { file: None, line: 0, cause: cause.into(), remedy: remedy.into() }
    }

    /// An error of a file as a whole.
    pub(super) fn file(file: &Path, cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::line(file, 0, cause, remedy)
    }

    /// An error on a text line, from 1.
    pub(super) fn line(
        file: &Path,
        line: u64,
        cause: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { file: Some(file.to_owned()), line, ..Self::data(cause, remedy) }
    }

    fn place(&self) -> String {
        match (&self.file, self.line) {
            (None, _) => String::new(),
            (Some(file), 0) => format!("{}: ", file.display()),
            (Some(file), line) => format!("{}:{line}: ", file.display()),
        }
    }
}
