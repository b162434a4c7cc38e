//! The program as a user runs it.

use std::path::Path;
use std::process::Command;

/// Runs `insonify` in a folder: whether it went well, and all that it said, in one line, since errors
/// are wrapped to the terminal's width.
pub fn insonify(folder: &Path, args: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    let out = command.current_dir(folder).args(args).output();
    let out = out.expect("the program starts");
    let text = [out.stdout, out.stderr].concat();
    let text = String::from_utf8_lossy(&text).split_whitespace().collect::<Vec<_>>().join(" ");
    (out.status.success(), text.replace("│ ", ""))
}
