//! Settings as entries of a scene file.

use glam::{DAffine3, DVec3};
use toml_edit::Value;

use super::Settings;
use super::settings::ELABORATE;
use crate::register::{Placement, Transformation};
use crate::scene::file::{self, Entry, quoted};
use crate::scene::{Origin, Origins};
use crate::settings::Value::Number;
use crate::settings::{
    self, Display, Exam, Fusion, Group, Live, Member, Probe, Simulation, Surface, Tissue, Visitor,
    plain,
};

/// Path of the edge of a lattice cell, which follows from other settings.
const CELL: &str = "simulation.cell";

/// Relative difference below which two lattices are the same: each has been multiplied by frequencies
/// and divided by them, some hundred times in a long session.
const SAME_LATTICE: f64 = 1e-9;

/// Entries of a scene file that turn `from`, which the file gives now, into `to`. `lattice` is
/// [`lattice`] of the file's own settings, which a quality chosen for the device may have scaled in
/// both. The tracer does not belong to the file.
pub(super) fn changes(
    from: &Settings,
    to: &Settings,
    origins: &Origins,
    lattice: f64,
) -> Vec<Entry> {
    let exam = (from.imaging.exam != to.imaging.exam).then_some(to.imaging.exam);
    let mut out = probe_changes(&from.probe, &to.probe, exam);
    let simulation = file::changes(&from.simulation, &to.simulation, Simulation::TABLE);
    out.extend(simulation.into_iter().filter(|(path, _)| path != CELL));
    out.extend(cell(from, to, lattice));
    out.extend(changes_with(&from.imaging, &to.imaging, exam.map(Exam::imaging)));
    let mut others = Others { from, to, out: &mut out };
    settings::Settings::each(&mut others);
    out.extend(file::changes(&from.live, &to.live, Live::TABLE));
    if let (Some(from), Some(to)) = (&from.fusion, &to.fusion) {
        out.extend(fusion_changes(from, to, origins));
    }
    if let (Some(from), Some(to)) = (&from.volume, &to.volume) {
        out.extend(moved("volume", &from.world_from_lps, &to.world_from_lps));
        out.extend(file::changes(from, to, Display::TABLE));
    }
    out.extend(moved("model", &from.model, &to.model));
    out.extend(tissue_changes(&from.tissues, &to.tissues, &origins.bases));
    // Instances of one table have the same settings: the first stands for all.
    let mut done: Vec<&Origin> = Vec::new();
    for (i, origin) in origins.instances.iter().enumerate() {
        if !done.iter().any(|o| o.mesh == origin.mesh) {
            out.extend(surface_changes(&origin.mesh, &from.surfaces[i], &to.surfaces[i]));
        }
        if from.strategies[i] != to.strategies[i]
            && let Some(strategy) = to.strategies[i]
            && !done.iter().any(|o| switch(o) == switch(origin))
        {
            let path = format!("{}.strategy", switch(origin));
            out.push((path, Some(format!("\"{strategy}\""))));
        }
        done.push(origin);
    }
    out
}

/// Changes of the groups that are no more than their rows.
struct Others<'s> {
    from: &'s settings::Settings,
    to: &'s settings::Settings,
    out: &'s mut Vec<Entry>,
}

impl Visitor for Others<'_> {
    fn visit<T: Group>(&mut self, group: Member<T>) {
        if !ELABORATE.contains(&T::TABLE) {
            let [from, to] = [self.from, self.to].map(group.of);
            self.out.extend(file::changes(from, to, T::TABLE));
        }
    }
}

/// Path of the table with the strategy for an instance's keyframes.
pub(super) fn switch(origin: &Origin) -> String {
    match &origin.selector {
        Some(selector) => format!("selector.{}", quoted(selector)),
        None => format!("mesh.{}", quoted(&origin.mesh)),
    }
}

/// The pose of the probe at the start, to a ten thousandth of a millimetre.
pub(super) fn pose(pose: &DAffine3) -> Vec<Entry> {
    pose_at("probe.pose", pose)
}

/// A pose of the probe in the table `path`, to a ten thousandth of a millimetre.
pub(super) fn pose_at(path: &str, pose: &DAffine3) -> Vec<Entry> {
    let list = |v: DVec3, unit: f64| {
        // Minus zero becomes zero.
        let parts = v.to_array().map(|x| plain((x * unit).round() / unit + 0.0));
        Some(format!("[{}]", parts.join(", ")))
    };
    let (direction, lateral) = (pose.matrix3.z_axis, pose.matrix3.x_axis);
    vec![
        (format!("{path}.position"), list(pose.translation, 1e4)),
        (format!("{path}.direction"), list(direction, 1e7)),
        (format!("{path}.lateral"), list(lateral, 1e7)),
    ]
}

/// Edge of a lattice cell in wavelengths at 1 mm/us, as the file gives it: mm MHz, before its division
/// for scatterers that do not fit into the cells.
pub(super) fn lattice(settings: &Settings) -> f64 {
    let s = &settings.simulation;
    s.cell * s.crowding() * settings.probe.frequency
}

/// Returns whether two lattices, or cells, are equal within rounding.
pub(super) fn is_same_lattice(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME_LATTICE
}

/// The cell's entry. The cell follows frequency and density where the file does not give it, and is divided
/// where there are more scatterers than cells.
fn cell(from: &Settings, to: &Settings, file: f64) -> Option<Entry> {
    let inputs = |s: &Settings| {
        let s = (s.simulation.cell, s.simulation.density_scale, s.probe.frequency);
        [s.0, s.1, s.2]
    };
    if inputs(from) == inputs(to) {
        return None;
    }
    // The scaling by a quality does not belong to the file.
    let value = match is_same_lattice(lattice(from), lattice(to)) {
        true => file / to.probe.frequency,
        false => lattice(to) / to.probe.frequency,
    };
    let default = Simulation::default_cell(to.probe.frequency);
    let text = Simulation::row("cell").map(|row| row.facts.text(&Number(value)));
    Some((CELL.into(), text.flatten().filter(|_| !is_same_lattice(value, default))))
}

/// Entries by which the table of `T`, which gives `from` now, gives `to`. `fresh` is what keys that the file does not
/// state become where another examination is written into it: which they are is not known here.
fn changes_with<T: Group>(from: &T, to: &T, fresh: Option<T>) -> Vec<Entry> {
    let entries = |of: &T| file::entries(of, T::TABLE);
    let mut out = file::changes(from, to, T::TABLE);
    for entry in fresh.map_or(Vec::new(), |fresh| file::differing(entries(&fresh), entries(to))) {
        if !out.contains(&entry) {
            out.push(entry);
        }
    }
    out
}

fn probe_changes(from: &Probe, to: &Probe, exam: Option<Exam>) -> Vec<Entry> {
    if from == to && exam.is_none() {
        return Vec::new();
    }
    let Some((preset, _)) = Probe::PRESETS.iter().find(|(_, make)| make() == *to) else {
        let fresh = exam.map(|exam| exam.probe().unwrap_or_else(Probe::paper_table1));
        return changes_with(from, to, fresh);
    };
    let keys = file::entries(to, Probe::TABLE);
    let mut out: Vec<Entry> = keys.into_iter().map(|(path, _)| (path, None)).collect();
    out.push(("probe.preset".into(), Some(format!("\"{preset}\""))));
    out
}

/// Entries of the fusion's settings and the names of its masks.
fn fusion_changes(from: &Fusion, to: &Fusion, origins: &Origins) -> Vec<Entry> {
    let mut out = file::changes(from, to, Fusion::TABLE);
    if from.masks != to.masks {
        let masks = to.masks.iter().filter_map(|&i| origins.instances.get(i));
        // An animated file has several instances of one name.
        let mut names: Vec<String> =
            masks.map(|o| Value::from(o.mesh.as_str()).to_string()).collect();
        names.dedup();
        out.push(("fusion.mask".into(), Some(format!("[{}]", names.join(", ")))));
    }
    out
}

/// Entries of the `table` that places something and keeps its proportions.
fn moved(table: &str, from: &DAffine3, to: &DAffine3) -> Vec<Entry> {
    let entries = |place| Placement::of(place, Transformation::Similarity).entries(table);
    file::differing(entries(from), entries(to))
}

/// Entries of changed tissues. A tissue based on another states what the other no longer gives as before.
fn tissue_changes(from: &[Tissue], to: &[Tissue], bases: &[Vec<String>]) -> Vec<Entry> {
    let differs: Vec<Vec<bool>> = (from.iter().zip(to))
        .map(|(from, to)| {
            let pairs = tissue(from).into_iter().zip(tissue(to));
            pairs.map(|(a, b)| a.1 != b.1).collect()
        })
        .collect();
    let mut out = Vec::new();
    for (i, to_tissue) in to.iter().enumerate() {
        let on = |other: &Tissue| bases.get(i).is_some_and(|b| b.contains(&other.name));
        let based: Vec<usize> = (0..to.len()).filter(|&j| j == i || on(&to[j])).collect();
        for (key, entry) in tissue(to_tissue).into_iter().enumerate() {
            if based.iter().any(|&j| differs[j][key]) {
                out.push(entry);
            }
        }
        let t = (from[i].impedance(), to_tissue.impedance());
        if t.0 != t.1 {
            // It is derived; a given one would contradict it.
            let path = format!("tissues.{}.impedance", quoted(&to_tissue.name));
            out.push((path, None));
        }
    }
    out
}

fn tissue(t: &Tissue) -> Vec<Entry> {
    file::entries(t, &format!("tissues.{}", quoted(&t.name)))
}

/// Entries of a changed surface; a change of the outside also writes an inside that the file does not give.
fn surface_changes(mesh: &str, from: &[Surface; 2], to: &[Surface; 2]) -> Vec<Entry> {
    let path = format!("mesh.{}", quoted(mesh));
    let [outside, inside] = [(0, path.clone()), (1, format!("{path}.inside"))]
        .map(|(side, path)| (file::entries(&from[side], &path), file::entries(&to[side], &path)));
    let mut out = Vec::new();
    let keys = outside.0.into_iter().zip(outside.1);
    for (out_side, in_side) in keys.zip(inside.0.into_iter().zip(inside.1)) {
        let changed = out_side.0 != out_side.1;
        if changed || in_side.0 != in_side.1 {
            out.push(in_side.1);
        }
        if changed {
            out.push(out_side.1);
        }
    }
    out
}
