//! Python with packages, where they can be had.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// A Python that has `packages`, as `pip install` names them, in the folder `name` of the build, and in which the line
/// `import` works; none where it cannot be had.
pub fn with(name: &str, import: &str, packages: &[&str]) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let python = folder.join("bin/python");
    let runs = |command: &mut Command| command.output().is_ok_and(|out| out.status.success());
    let ready = || runs(Command::new(&python).args(["-c", import]));
    if !ready() {
        let made = runs(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        let install = ["-m", "pip", "install", "--quiet"];
        if !(made && runs(Command::new(&python).args(install).args(packages)) && ready()) {
            return None;
        }
    }
    Some(python)
}

/// The JSON that a script prints, and what it says on standard error. Not that something of a package will not be in a
/// later version of Python or numpy.
pub fn run(python: &Path, script: &str, args: &[&str]) -> (Value, String) {
    let mut command = Command::new(python);
    for warning in ["DeprecationWarning", "PendingDeprecationWarning", "FutureWarning"] {
        command.args(["-W", &format!("ignore::{warning}")]);
    }
    let out = command.args(["-c", script]).args(args).output().expect("Python starts");
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{said}");
    (serde_json::from_slice(&out.stdout).expect("JSON"), said)
}
