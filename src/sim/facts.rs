//! Facts about a frame for reports and for the texts beside pictures.

use glam::DAffine3;
use serde_json::{Map, Value, json};

use crate::settings::{Group, Member, Settings, Visitor};

/// Place of a picture in the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Edge of a pixel, mm.
    pub pitch: f64,
    /// Lateral place of the left edge and depth of the upper edge, mm.
    pub corner: [f64; 2],
}

/// Size and place of a picture.
pub fn image(area: &Area) -> Value {
    json!({
        "width": area.size[0],
        "height": area.size[1],
        "pixel_pitch_mm": area.pitch,
        "left_mm": area.corner[0],
        "top_mm": area.corner[1],
    })
}

/// The probe's axes and the centre of its face in the world.
pub fn pose(world_from_probe: &DAffine3) -> Value {
    let m = world_from_probe.matrix3;
    let place = world_from_probe.translation;
    json!({
        "position_mm": place.to_array(),
        "lateral": m.x_axis.to_array(),
        "elevation": m.y_axis.to_array(),
        "depth": m.z_axis.to_array(),
    })
}

/// Settings of a frame by the keys of scene files, `units` of those that have one, and the counts that follow from
/// them.
pub fn settings(settings: &Settings) -> Value {
    let Settings { probe, simulation, .. } = settings;
    let lines = probe.scanlines * probe.elevation_layers;
    let counts = json!({
        "lines": lines,
        "samples": probe.samples,
        "paths_per_line": simulation.paths,
        "paths": u64::from(lines) * u64::from(simulation.paths),
        "cell_mm": simulation.cell,
        "scatterer_cells_per_mm3": simulation.cell.powi(-3),
        "scatterers_per_resolution_cell": simulation.scatterers_per_resolution_cell,
        "volume_floor_db": simulation.volume_floor,
        "branch_floor_db": simulation.branch_floor,
    });
    let mut tables = Tables { settings, tables: Map::new(), units: Map::new() };
    Settings::each(&mut tables);
    let mut out = Map::new();
    out.insert("counts".into(), counts);
    out.extend(tables.tables);
    out.insert("units".into(), tables.units.into());
    out.into()
}

/// The tables of all groups, and the units of their keys.
struct Tables<'s> {
    settings: &'s Settings,
    tables: Map<String, Value>,
    units: Map<String, Value>,
}

impl Visitor for Tables<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        let table = table((group.of)(self.settings), &mut self.units);
        self.tables.insert(T::TABLE.into(), table);
    }
}

/// The table of a group, with tables for keys that have dots; adds the units of its keys.
fn table<T: Group>(settings: &T, units: &mut Map<String, Value>) -> Value {
    let mut out = json!({});
    for row in T::rows() {
        let value = row.facts.json(&(row.get)(settings));
        let place = row.facts.key.split('.').fold(&mut out, |table, part| &mut table[part]);
        *place = value;
        if let Some(measure) = row.facts.measure() {
            units.insert(format!("{}.{}", T::TABLE, row.facts.key), measure.unit().into());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::Probe;
    use crate::scene::file::SceneFile;
    use crate::settings::{Imaging, Simulation};

    #[test]
    fn a_scene_file_takes_the_settings_that_are_said() {
        let mut stated = Settings::of(Probe::abdominal());
        stated.probe.depth = 123.25;
        stated.imaging = Imaging { gain: 7.5, psf_scale: [1.5, 0.75, 1.0], ..Imaging::default() };
        stated.simulation =
            Simulation { paths: 3, volume_floor: f64::NEG_INFINITY, ..stated.simulation };
        let json = settings(&stated);
        assert_eq!(json["probe"]["depth"], 123.25);
        assert_eq!(json["units"]["probe.depth"], "mm");
        let mut entries = Vec::new();
        for name in Settings::TABLES {
            for (key, value) in json[name].as_object().expect("a table") {
                let path = format!("{name}.{key}");
                let text = match (json["units"][&path].as_str(), value) {
                    (_, Value::Null) => continue,
                    (Some(unit), Value::Number(number)) => format!("\"{number} {unit}\""),
                    (_, Value::String(text)) if text.parse::<f64>().is_ok() => text.clone(),
                    _ => value.to_string(),
                };
                entries.push((path, text));
            }
        }
        let (scene, _) =
            SceneFile::of("a.toml".as_ref(), String::new()).load(&entries).expect("sound");
        assert_eq!(scene.settings, stated);
    }
}
