//! Standard output, which its reader may close at any time.

use std::fmt::Display;
use std::io::{ErrorKind, Write, stdout};

/// Writes a line to standard output. Where nobody reads any more (`insonify info | head -1`) it is
/// dropped, and the program goes on: its files and its exit code are wanted all the same.
///
/// # Panics
/// When the line cannot be written for another reason, as on a full disk.
pub fn line(text: impl Display) {
    if let Err(error) = writeln!(stdout(), "{text}") {
        assert!(
            error.kind() == ErrorKind::BrokenPipe,
            "writing to standard output: {error}"
        );
    }
}
