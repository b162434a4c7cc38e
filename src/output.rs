//! What the program writes: lines to standard output, whose reader may leave at any time, and files. Knows
//! nothing of what it writes.

pub mod files;
pub mod movie;
pub mod npy;
pub mod plot;
pub mod sheet;

use std::fmt::Display;
use std::io::{ErrorKind, Write, stdout};
use std::sync::OnceLock;

/// Why standard output took no more lines, if it did not.
static FAILURE: OnceLock<String> = OnceLock::new();

/// Writes a line to standard output. Where nobody reads any more (`insonify info | head -1`) it is
/// dropped, and the program goes on: its files and its exit code are wanted all the same. So it does where the line
/// cannot be written for another reason, as on a full disk; [`failure`] tells of it then.
pub fn line(text: impl Display) {
    if let Err(error) = writeln!(stdout(), "{text}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        FAILURE.get_or_init(|| error.to_string());
    }
}

/// Why lines are missing in standard output, if some are.
pub fn failure() -> Option<&'static str> {
    FAILURE.get().map(String::as_str)
}
