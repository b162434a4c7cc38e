//! A scene of Python as a scene file, with the meshes that were given as arrays beside it.

use std::collections::BTreeSet;
use std::path::Path;

use insonify::output::{files, naming, obj};
use insonify::scene::file::{self, Entry, quoted, stated_pose};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::error::mistaken;
use crate::state::State;

/// Writes the scene as the file `to`: the text that it was made of, with everything that was set, its pose, and its meshes of
/// arrays as files beside it.
pub fn save(state: &State, to: &Path) -> PyResult<()> {
    if let Some(&instance) = state.placed.keys().next() {
        let name = &state.scene.instances[instance].name;
        return Err(PyValueError::new_err(format!(
            "mesh `{name}` was placed by place(), which scene files do not know: set mesh.{name}.translate, rotate and scale, \
             or give it its vertices there"
        )));
    }
    let pose = state.pose.map(|pose| stated_pose(pose).1);
    let set = state.entries.iter().cloned().chain(pose);
    let set: Vec<Entry> = set.map(|(path, value)| (path, Some(value))).collect();
    let (text, from) = (state.file.text(), state.file.path());
    file::save_text(text, from, to, &set).map_err(|e| mistaken(&e))?;
    let mut meshes: Vec<Entry> = Vec::new();
    let mut names = BTreeSet::new();
    for (name, given) in &state.given {
        let file = free(to, name, &mut names);
        let positions = state.moved.get(name).unwrap_or(&given.positions);
        let path = to.with_file_name(&file);
        files::replace(&path, obj::text("mm", positions, &given.triangles).as_bytes())
            .map_err(|e| PyOSError::new_err(format!("{}: {e}", path.display())))?;
        let of = |key: &str| format!("mesh.{}.{key}", quoted(name));
        meshes.push((of("file"), Some(format!("\"{file}\""))));
        if given.cap_openings {
            meshes.push((of("cap_openings"), Some("true".to_owned())));
        }
    }
    match meshes.is_empty() {
        true => Ok(()),
        false => file::save(to, to, &meshes).map_err(|e| mistaken(&e)),
    }
}

/// The name of a mesh's file beside the scene's, of letters and digits that every system takes.
fn free(scene: &Path, mesh: &str, names: &mut BTreeSet<String>) -> String {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |text: &str| -> String {
        text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
    };
    let stem = format!("{}-{}", plain(&stem), plain(mesh));
    let name = naming::free(&stem, "obj", |name| names.contains(name));
    names.insert(name.clone());
    name
}
