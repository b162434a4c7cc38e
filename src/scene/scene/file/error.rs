//! Errors of scene files, with place, cause and remedy.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Diagnostic, NamedSource, SourceSpan};
use thiserror::Error;

use crate::issue::FileError;
use crate::settings::suggest;

/// A mistake in a scene file or in what it names. Nothing is loaded.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{message}", self.place())]
pub struct SceneError {
    /// Cause.
    pub message: String,
    /// Remedy.
    #[help]
    pub remedy: Option<String>,
    /// The scene file, or `setting` where an override is at fault.
    pub file: PathBuf,
    /// Line, from 1; 0 where there is none.
    pub line: usize,
    /// Column in characters, from 1; 0 where there is none.
    pub column: usize,
    #[source_code]
    source_text: Option<Arc<NamedSource<String>>>,
    #[label]
    span: Option<SourceSpan>,
}

impl SceneError {
    /// An error without a place inside the file.
    pub fn file(file: &Path, message: String, remedy: &str) -> Self {
        Self {
            message,
            remedy: Some(remedy.to_owned()),
            file: file.to_owned(),
            line: 0,
            column: 0,
            source_text: None,
            span: None,
        }
    }

    /// An error at `span` (bytes) of `text`.
    pub(super) fn at(
        file: &Path,
        text: &str,
        span: Range<usize>,
        message: String,
        remedy: Option<String>,
    ) -> Self {
        let before = text.get(..span.start).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        let named = NamedSource::new(file.to_string_lossy(), text.to_owned());
        Self {
            message,
            remedy,
            file: file.to_owned(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            source_text: Some(Arc::new(named.with_language("TOML"))),
            span: Some(span.into()),
        }
    }

    fn place(&self) -> String {
        match self.line {
            0 => format!("{}: ", self.file.display()),
            line => format!("{}:{line}:{}: ", self.file.display(), self.column),
        }
    }
}

impl From<FileError> for SceneError {
    fn from(error: FileError) -> Self {
        Self::file(&error.file, error.message, &error.remedy)
    }
}

/// Advice for the deserializer's "unknown field `x`, expected one of `a`, `b`" and "missing field `x`"; `manual` is the page
/// that describes the file.
pub(super) fn advice(message: &str, manual: &str) -> Option<String> {
    if let Some(missing) = message.strip_prefix("missing field `") {
        let key = missing.split('`').next()?;
        return Some(format!("give `{key}`; {manual} says what it takes"));
    }
    if !message.starts_with("unknown field") && !message.starts_with("unknown variant") {
        return None;
    }
    let mut quoted = message.split('`').skip(1).step_by(2);
    let wrong = quoted.next()?;
    Some(suggest::among(wrong, quoted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_lines_and_characters() {
        let text = "a = 1\nb = \"\u{e4}\" # c\nd = 2";
        let at = text.find("# c").expect("there");
        let error = SceneError::at(Path::new("s.toml"), text, at..at + 1, "bad".to_owned(), None);
        assert_eq!((error.line, error.column), (2, 9));
        assert_eq!(error.to_string(), "s.toml:2:9: bad");
    }

    #[test]
    fn advice_names_the_nearest_key() {
        let advice = advice("unknown field `pathz`, expected one of `paths`, `seed`", "docs/a.md");
        assert_eq!(advice.as_deref(), Some("did you mean `paths`?"));
    }

    #[test]
    fn advice_names_the_missing_key() {
        let advice = advice("missing field `axis`", "docs/a.md");
        assert_eq!(advice.as_deref(), Some("give `axis`; docs/a.md says what it takes"));
    }
}
