//! Device, driver and commit of a measurement.

use std::fmt;
use std::process::Command;

use insonify::gpu::Device;
use serde::Serialize;

/// Origin of a table's figures.
#[derive(Serialize)]
pub struct Provenance {
    pub device: String,
    pub driver: String,
    /// Commit of this repository, with a mark where the tree differs from it.
    pub commit: String,
}

impl Provenance {
    /// Returns the origin of a measurement made now, on `device`.
    pub fn of(device: &Device) -> Self {
        Self {
            device: device.name().to_owned(),
            driver: device.driver().to_owned(),
            commit: commit(),
        }
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { device, driver, commit } = self;
        write!(f, "{device}, {driver}, commit {commit}")
    }
}

/// Returns the commit that this was built in, as git gives it.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(crate::root()).args(arguments).output();
        let output = output.ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    match (git(&["rev-parse", "--short=12", "HEAD"]), git(&["status", "--porcelain"])) {
        (Some(commit), Some(changes)) if changes.is_empty() => commit,
        (Some(commit), _) => format!("{commit}, with changes"),
        _ => "unknown (no git)".into(),
    }
}
