//! The program on one file at a time, in a process of its own that may use 1 GB of address space
//! (more than it can ever hold in memory) and 10 s of the processor.

use std::path::{Path, PathBuf};
use std::time::Duration;

use assert_cmd::Command;

const SECONDS: u32 = 10;
/// Longest wait for a program that does nothing, or on a busy machine.
const PATIENCE: Duration = Duration::from_secs(240);
const KILOBYTES: u32 = 1 << 20;

/// Exit code (none: killed or out of time) and printed text.
pub struct Outcome {
    pub code: Option<i32>,
    pub text: String,
}

/// `insonify check` on a file.
pub fn check(path: &Path) -> Outcome {
    limited("exec \"$0\" check \"$1\"", path)
}

/// A shell script with the program as `$0` and the file as `$1`.
pub fn limited(script: &str, path: &Path) -> Outcome {
    limited_to(SECONDS, script, path)
}

/// Like [`limited`], with so many seconds of the processor.
pub fn limited_to(seconds: u32, script: &str, path: &Path) -> Outcome {
    let output = Command::new("sh")
        .arg("-c")
        .arg(format!("ulimit -v {KILOBYTES}; ulimit -t {seconds}; {script}"))
        .arg(env!("CARGO_BIN_EXE_insonify"))
        .arg(path)
        .timeout(PATIENCE)
        .output()
        .expect("started");
    let text = [output.stdout, output.stderr].concat();
    Outcome { code: output.status.code(), text: String::from_utf8_lossy(&text).into_owned() }
}

/// Files below a folder that `wanted` accepts, in a fixed order.
pub fn files(folder: &Path, wanted: impl Fn(&Path) -> bool) -> Vec<PathBuf> {
    let (mut out, mut todo) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = todo.pop() {
        for entry in std::fs::read_dir(folder).expect("readable folder") {
            let path = entry.expect("readable entry").path();
            if path.is_dir() {
                todo.push(path);
            } else if wanted(&path) {
                out.push(path);
            }
        }
    }
    out.sort();
    out
}
