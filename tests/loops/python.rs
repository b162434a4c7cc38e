//! pydicom and dciodvfy, where they can be had.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::Value;

use crate::common::python as common;
use crate::common::python::with;
use crate::common::skip::{Lacking, skip};

/// A Python that has pydicom, in a folder of the build; none where it cannot be had. Made once, whoever asks first.
pub fn python() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(make).clone();
    if made.is_none() {
        // From the network, like data.
        skip(Lacking::Data, "no pydicom");
    }
    made
}

fn make() -> Option<PathBuf> {
    with("pydicom", "import numpy, pydicom", &["pydicom==3.0.1", "numpy"])
}

/// The JSON that a script prints.
pub fn run(python: &Path, script: &str, args: &[&str]) -> Value {
    let (value, said) = common::run(python, script, args);
    // Warnings of pydicom are faults of ours.
    assert_eq!(said, "");
    value
}

/// The errors that dicom3tools' validator finds in a file of a kind; none where there is no validator.
pub fn errors(file: &Path, kind: &str) -> Option<Vec<String>> {
    let Ok(out) = Command::new("dciodvfy").arg(file).output() else {
        skip(Lacking::Data, "no dciodvfy (Debian's dicom3tools)");
        return None;
    };
    let text = String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned();
    assert!(text.contains(kind), "{text}");
    Some(text.lines().filter(|l| l.starts_with("Error")).map(str::to_owned).collect())
}

/// A list of numbers.
pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}
