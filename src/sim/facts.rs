//! Facts about a frame for reports.

use serde_json::{Value, json};

use crate::settings::Settings;

/// Settings of a frame, and the counts that follow from them.
pub fn settings(Settings { probe, simulation, imaging }: &Settings) -> Value {
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
