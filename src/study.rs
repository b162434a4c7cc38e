//! User studies: images rated blind by people who know ultrasound, as in section III-B of Starkov et al. 2019.
//! Cases of many images go into a form ([`form`]), their identities into a key ([`key`]) that the assessor
//! does not see; answers ([`answers`]) and key make tables ([`results`]).

pub mod answers;
pub mod form;
pub mod key;
pub mod results;

use miette::Diagnostic;
use thiserror::Error;

/// An error in a key or in answers, with a remedy.
#[derive(Debug, Error, Diagnostic)]
#[error("{file}: {message}")]
pub struct StudyError {
    /// The file.
    pub file: String,
    /// Cause.
    pub message: String,
    /// Remedy.
    #[help]
    pub remedy: String,
}

impl StudyError {
    fn new(file: &std::path::Path, message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { file: file.display().to_string(), message: message.into(), remedy: remedy.into() }
    }
}

/// Text of a file of at most `most` bytes, or the reason why there is none.
fn text_of(file: &std::path::Path, most: u64, remedy: &str) -> Result<String, StudyError> {
    let fail = |cause: String| StudyError::new(file, cause, remedy);
    let info = std::fs::metadata(file).map_err(|e| fail(format!("cannot be read: {e}")))?;
    if !info.is_file() || info.len() > most {
        return Err(fail(format!(
            "is no such file: it is {} bytes long, the limit is {most}",
            info.len()
        )));
    }
    std::fs::read_to_string(file).map_err(|e| fail(format!("cannot be read: {e}")))
}
