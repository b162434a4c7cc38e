//! The program, run as by a user.

use std::path::Path;
use std::process::Command;

/// Runs `insonify` in a folder; returns whether it succeeded, and all its output in one line of text, since errors
/// are wrapped to the terminal's width.
pub fn insonify(folder: &Path, args: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    let out = command.current_dir(folder).args(args).output();
    let out = out.expect("the program starts");
    let text = [out.stdout, out.stderr].concat();
    let text = String::from_utf8_lossy(&text).split_whitespace().collect::<Vec<_>>().join(" ");
    (out.status.success(), text.replace("│ ", ""))
}
