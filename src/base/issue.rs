//! Findings of checks on files, and mistakes that end the work: place, cause, and remedy.

mod explanation;
mod teller;

use std::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use thiserror::Error;

pub use explanation::explanation;
pub use teller::tell_errors;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The scene loads; the picture may be wrong in the way described.
    Warning,
    /// Nothing is loaded.
    Error,
}

/// One finding. Findings of a kind are counted, not repeated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issue {
    /// Severity: an error stops loading.
    pub severity: Severity,
    /// The file.
    pub file: PathBuf,
    /// Mesh, node or place inside the file; empty for the whole file.
    pub mesh: String,
    /// Number of edges, triangles or values.
    pub count: usize,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: String,
}

/// A finding beside something that could be loaded all the same.
pub type Warning = Issue;

impl Issue {
    /// A finding that stops loading.
    pub fn error(
        file: &Path,
        count: usize,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            severity: Severity::Error,
            file: file.to_owned(),
            mesh: String::new(),
            count,
            message: message.into(),
            remedy: remedy.into(),
        }
    }

    /// A finding that does not stop loading.
    pub fn warning(
        file: &Path,
        count: usize,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { severity: Severity::Warning, ..Self::error(file, count, message, remedy) }
    }

    /// Sets the mesh's name, unless there is one.
    pub fn of(mut self, mesh: &str) -> Self {
        if self.mesh.is_empty() {
            mesh.clone_into(&mut self.mesh);
        }
        self
    }

    /// Returns whether both messages agree except for numbers in them.
    pub fn is_like(&self, other: &Self) -> bool {
        let words = |issue: &Self| {
            let number = |c: char| c.is_ascii_digit() || c == '.';
            issue.message.replace(number, "")
        };
        words(self) == words(other)
    }

    /// Returns whether it stops loading.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

impl fmt::Display for Issue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        write!(f, "{kind}: {}: ", self.file.display())?;
        if !self.mesh.is_empty() {
            write!(f, "{}: ", self.mesh)?;
        }
        write!(f, "{}", self.message)?;
        if !self.remedy.is_empty() {
            write!(f, "; {}", self.remedy)?;
        }
        Ok(())
    }
}

/// Place of a mistake in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// Line of a text, from 1.
    Line(usize),
    /// Byte of the file, or of its decompressed content, from 0.
    Byte(u64),
}

/// A mistake in a file, or in data as a whole. Nothing is loaded, made or changed.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{message}", self.prefix())]
#[diagnostic(help("{remedy}"))]
pub struct FileError {
    /// The faulty file or folder; empty where it is the data as a whole.
    pub file: PathBuf,
    /// Place in it.
    pub place: Place,
    /// Cause.
    pub message: String,
    /// Remedy.
    pub remedy: String,
}

impl FileError {
    /// An error of a whole file.
    pub fn file(file: &Path, message: impl Into<String>, remedy: impl Into<String>) -> Self {
        let (message, remedy) = (message.into(), remedy.into());
        Self { file: file.to_owned(), place: Place::File, message, remedy }
    }

    /// An error on a line of a text, from 1; 0 for the whole file.
    pub fn line(
        file: &Path,
        line: usize,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let place = if line == 0 { Place::File } else { Place::Line(line) };
        Self { place, ..Self::file(file, message, remedy) }
    }

    /// An error at a byte, from 0.
    pub fn byte(
        file: &Path,
        byte: u64,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self { place: Place::Byte(byte), ..Self::file(file, message, remedy) }
    }

    /// An error of data, whatever files they come from.
    pub fn data(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::file(Path::new(""), message, remedy)
    }

    fn prefix(&self) -> String {
        let file = self.file.display();
        match self.place {
            Place::File if self.file.as_os_str().is_empty() => String::new(),
            Place::File => format!("{file}: "),
            Place::Line(line) => format!("{file}:{line}: "),
            Place::Byte(byte) => format!("{file}: byte {byte}: "),
        }
    }
}

impl From<FileError> for Issue {
    fn from(error: FileError) -> Self {
        Self::error(&error.file, 1, error.message, error.remedy)
    }
}

/// The bytes of a regular file of at most `most` bytes; `smaller` is the remedy where it has more. Pipes and devices,
/// which may never end, are refused.
///
/// # Errors
/// The fault of the file.
pub fn read(path: &Path, most: u64, smaller: &str) -> Result<Vec<u8>, FileError> {
    let fail = |cause: String, remedy: &str| FileError::file(path, cause, remedy);
    let unread = |e: std::io::Error| {
        fail(format!("cannot be read: {e}"), "check the path and the permissions")
    };
    let info = std::fs::metadata(path).map_err(unread)?;
    if !info.is_file() {
        return Err(fail("is not a regular file".to_owned(), "name a file"));
    }
    if info.len() > most {
        let cause = format!("is {} MB, the limit is {} MB", info.len() >> 20, most >> 20);
        return Err(fail(cause, smaller));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(unread)?;
    file.take(most).read_to_end(&mut bytes).map_err(unread)?;
    Ok(bytes)
}

/// The text of a regular file in UTF-8, like [`read`]; without the mark of its encoding.
///
/// # Errors
/// The fault of the file.
pub fn read_text(path: &Path, most: u64, smaller: &str) -> Result<String, FileError> {
    let text = String::from_utf8(read(path, most, smaller)?).map_err(|e| {
        let cause = format!("is not text in UTF-8: {}", e.utf8_error());
        FileError::file(path, cause, "save it as UTF-8 in a text editor")
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}
