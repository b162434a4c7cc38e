//! What a check has to say about a file: severity, where, how many, why, and what to do.

use std::fmt;
use std::path::{Path, PathBuf};

/// Whether loading goes on.
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
    /// Whether loading goes on.
    pub severity: Severity,
    /// File that it is about.
    pub file: PathBuf,
    /// Mesh, node or place inside the file; empty for the whole file.
    pub mesh: String,
    /// How many edges, triangles, values are concerned.
    pub count: usize,
    /// Cause.
    pub message: String,
    /// What to do about it.
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

    /// Names the mesh, unless it is named already.
    pub fn of(mut self, mesh: &str) -> Self {
        if self.mesh.is_empty() {
            mesh.clone_into(&mut self.mesh);
        }
        self
    }

    /// Whether both say the same but for the numbers in it.
    pub fn is_like(&self, other: &Self) -> bool {
        let words = |issue: &Self| {
            let number = |c: char| c.is_ascii_digit() || c == '.';
            issue.message.replace(number, "")
        };
        words(self) == words(other)
    }

    /// Whether loading stops.
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
