//! Output of the program: lines to standard output and standard error, whose readers may leave at any time, and
//! files. Independent of their content.

pub mod files;
pub mod indexed;
pub mod lock;
pub mod npy;
pub mod npz;
pub mod picture;
pub mod sheet;

use std::collections::BTreeSet;
use std::fmt::Display;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Mutex, OnceLock, PoisonError};

/// The first error that kept a line from standard output, if there was one.
static FAILURE: OnceLock<String> = OnceLock::new();

/// Writes a line to standard output. Where its reader is gone (`insonify info | head -1`) the line is
/// dropped, and the program goes on: its files and its exit code are wanted all the same. It goes on too where the
/// line cannot be written for another reason, as on a full disk; [`failure`] then returns that reason.
pub fn line(text: impl Display) {
    if let Err(error) = writeln!(stdout(), "{text}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        FAILURE.get_or_init(|| error.to_string());
    }
}

/// Writes a line to standard error. Where nobody reads it, or it cannot be written, it is dropped: there is nowhere
/// left to say so, and the work and the exit code are wanted all the same.
pub fn note(text: impl Display) {
    let _ = writeln!(stderr(), "{text}");
}

/// As [`note`], but a text that this process has written before is not written again.
pub fn note_once(text: String) {
    static WRITTEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut written = WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
    if !written.contains(&text) {
        note(&text);
        written.insert(text);
    }
}

/// The sentence that says that a program's own files cannot be kept: `what` is not, because of the `cause` at `place`, none where
/// the system names no folder. `variable` is the variable of the environment that names another one.
pub fn not_kept(what: &str, place: Option<&Path>, cause: &str, variable: &str) -> String {
    match place {
        Some(place) => format!(
            "{what}: {} cannot be written ({cause}); make its folder writable, or name another one by the variable {variable}",
            place.display()
        ),
        None => format!("{what}: {cause}; set the variable HOME or {variable} to a folder"),
    }
}

/// The cause where the system names no folder for a user's files.
pub const NO_FOLDER: &str = "the system names no folder for it";

/// A value as the text of a JSON file.
///
/// # Panics
/// A value that JSON cannot have: keys that are no texts.
pub fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain values") + "\n"
}

/// Returns the exit code of a program that ended so, and tells the error, or that lines of its output are missing.
pub fn exit(ended: miette::Result<ExitCode>) -> ExitCode {
    match ended {
        Ok(code) => match failure() {
            None => code,
            Some(cause) => {
                note(format!(
                    "standard output could not be written: {cause}\n\
                     Files are complete, lines are missing: run it again where there is room for them."
                ));
                ExitCode::FAILURE
            }
        },
        Err(report) => {
            note(format!("{report:?}"));
            ExitCode::FAILURE
        }
    }
}

/// The same without the end of the line, for progress that is written over.
pub fn progress(text: impl Display) {
    let _ = write!(stderr(), "{text}");
}

/// Returns the reason for which lines are missing in standard output, if some are.
fn failure() -> Option<&'static str> {
    FAILURE.get().map(String::as_str)
}
