//! The tables `simulation`, `imaging` and `live`.

use super::document::Document;
use super::error::SceneError;
use super::schema::{ImagingTable, LiveTable, SimulationTable};
use super::within;
use crate::scene::{Imaging, Live, Simulation};

/// Copies the keys that are present: plain ones, then quantities.
macro_rules! overlay {
    ($table:ident => $out:ident: $($plain:ident),*; $($quantity:ident),*) => {
        $(if let Some(value) = $table.$plain { $out.$plain = value; })*
        $(if let Some(value) = $table.$quantity { $out.$quantity = value.0; })*
    };
}
pub(super) use overlay;

const INF: f64 = f64::INFINITY;
/// Levels may be switched off (minus infinity) but not boundless.
const LEVEL: (f64, f64) = (-INF, 200.0);
/// A hundred times as many scatterers take a hundred times as long.
const DENSITY: (f64, f64) = (0.001, 100.0);

pub(super) fn simulation(
    document: &Document<'_>,
    table: SimulationTable,
    frequency: f64,
) -> Result<Simulation, SceneError> {
    let mut out = Simulation { cell: Simulation::default_cell(frequency), ..Simulation::default() };
    overlay!(table => out:
        paths, sampling, sequence, max_interactions, max_reflections, min_weight, coherence,
        rough_transmission, face_reflection, beam_footprint, emission_lobe, scatter_mode, scatterers_per_resolution_cell,
        texture_space, density_scale, roughness_scale, thickness_scale, seed;
        origin_jitter, beam_width, cell, volume_floor, branch_floor, speckle_gain, surface_gain);
    for (key, value, (least, most), unit) in [
        ("paths", f64::from(out.paths), (1.0, 65_535.0), ""),
        ("max_interactions", f64::from(out.max_interactions), (1.0, 256.0), ""),
        ("max_reflections", f64::from(out.max_reflections), (0.0, 256.0), ""),
        ("min_weight", out.min_weight, (0.0, 1.0), ""),
        ("origin_jitter", out.origin_jitter, (0.0, 100.0), "mm"),
        ("emission_lobe", out.emission_lobe, (1.0, INF), ""),
        ("beam_width", out.beam_width, (0.01, INF), "mm"),
        ("cell", out.cell, (0.01, 10.0), "mm"),
        ("scatterers_per_resolution_cell", out.scatterers_per_resolution_cell, (0.0, 1000.0), ""),
        ("volume_floor", out.volume_floor, LEVEL, "dB"),
        ("branch_floor", out.branch_floor, LEVEL, "dB"),
        ("speckle_gain", out.speckle_gain, LEVEL, "dB"),
        ("surface_gain", out.surface_gain, LEVEL, "dB"),
        ("density_scale", out.density_scale, DENSITY, ""),
        ("roughness_scale", out.roughness_scale, (1e-6, 1e6), ""),
        ("thickness_scale", out.thickness_scale, (0.0, 100.0), ""),
    ] {
        within(document, &format!("simulation.{key}"), value, least, most, unit)?;
    }
    out.cell /= out.crowding();
    Ok(out)
}

pub(super) fn imaging(document: &Document<'_>, table: ImagingTable) -> Result<Imaging, SceneError> {
    let mut out = Imaging::default();
    overlay!(table => out:
        grey_gamma, psf_scale, image_height;
        gain, dynamic_range, tgc_attenuation, tgc_limit, noise);
    if let Some(sliders) = table.tgc_sliders {
        out.tgc_sliders = sliders.map(|level| level.0);
    }
    for (key, value, (least, most), unit) in [
        ("gain", out.gain, (-200.0, 200.0), "dB"),
        ("dynamic_range", out.dynamic_range, (1.0, 200.0), "dB"),
        ("tgc_attenuation", out.tgc_attenuation, (0.0, 100.0), "dB/(cm MHz)"),
        ("tgc_limit", out.tgc_limit, (0.0, 200.0), "dB"),
        ("noise", out.noise, LEVEL, "dB"),
        ("grey_gamma", out.grey_gamma, (0.01, 100.0), ""),
        ("image_height", f64::from(out.image_height), (16.0, 8192.0), "pixels"),
    ] {
        within(document, &format!("imaging.{key}"), value, least, most, unit)?;
    }
    for (i, &level) in out.tgc_sliders.iter().enumerate() {
        within(document, &format!("imaging.tgc_sliders.{i}"), level, -100.0, 100.0, "dB")?;
    }
    for (i, &scale) in out.psf_scale.iter().enumerate() {
        within(document, &format!("imaging.psf_scale.{i}"), scale, 0.01, 100.0, "")?;
    }
    Ok(out)
}

pub(super) fn live(document: &Document<'_>, table: &LiveTable) -> Result<Live, SceneError> {
    let budget = table.budget.map(|budget| budget.0);
    if let Some(budget) = budget {
        within(document, "live.budget", budget, 0.001, 10.0, "s")?;
    }
    Ok(Live { budget })
}
