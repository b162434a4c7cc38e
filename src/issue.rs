//! A finding of a check on a file: severity, place, count, cause, and remedy.

use std::fmt;
use std::path::{Path, PathBuf};

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
