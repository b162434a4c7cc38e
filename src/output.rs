//! What is said of a frame, and standard output, which its reader may close at any time.

use std::fmt::Display;
use std::io::{ErrorKind, Write, stdout};
use std::sync::OnceLock;

use serde_json::{Value, json};

use crate::probe::Probe;
use crate::scene::{Imaging, Simulation};

/// Settings of a frame, and the counts that follow from them.
pub fn settings(probe: &Probe, simulation: &Simulation, imaging: &Imaging) -> Value {
    let lines = probe.scanlines * probe.elevation_layers;
    json!({
        "counts": {
            "lines": lines,
            "samples": probe.samples,
            "paths_per_line": simulation.paths,
            "paths": u64::from(lines) * u64::from(simulation.paths),
            "cell_mm": simulation.cell,
            "scatterer_cells_per_mm3": simulation.cell.powi(-3),
            "scatterers_per_resolution_cell": simulation.scatterers_per_resolution_cell,
            "volume_floor_db": simulation.volume_floor,
            "branch_floor_db": simulation.branch_floor,
        },
        "probe": format!("{probe:?}"),
        "simulation": format!("{simulation:?}"),
        "imaging": format!("{imaging:?}"),
    })
}

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
