//! Scenes in pickles: text, changes and arrays. Files that the text names are read again where a scene is unpickled.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use insonify::scene::file::SceneFile;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::arrays;
use crate::scene::Scene;
use crate::state::{Given, State};

/// The function that makes a scene again, and its argument: what `pickle` keeps.
pub fn kept<'py>(
    py: Python<'py>,
    state: &State,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
    let meshes = PyList::empty(py);
    for (name, given) in &state.given {
        let vertices = arrays::triples(py, &given.positions)?;
        let triangles = arrays::triples(py, &given.triangles)?;
        let moved = state.moved.get(name).map(|now| arrays::triples(py, now)).transpose()?;
        meshes.append((name, vertices, triangles, given.cap_openings, moved))?;
    }
    let placed = PyList::empty(py);
    for (&instance, [placement, _]) in &state.placed {
        let name = &state.scene.instances[instance].name;
        placed.append((name, arrays::rows(py, placement)?))?;
    }
    let pose = state.pose.map(|pose| arrays::rows(py, &pose)).transpose()?;
    let path = std::path::absolute(state.file.path())?;
    let kept = (path, state.file.text(), &state.entries, meshes, placed, pose, state.time);
    let again = py.import("insonify._insonify")?.getattr("again")?;
    Ok((again, PyTuple::new(py, [kept.into_pyobject(py)?])?))
}

/// A mesh in a pickle: name, vertices, triangles, whether openings are capped, and vertices where they were moved to.
type Kept<'py> = (String, Bound<'py, PyAny>, Bound<'py, PyAny>, bool, Option<Bound<'py, PyAny>>);

/// The scene that `pickle` has kept.
#[pyfunction]
#[allow(clippy::type_complexity, reason = "what `__reduce__` keeps, in its order")]
pub fn again(
    py: Python<'_>,
    kept: (
        PathBuf,
        String,
        Vec<(String, String)>,
        Vec<Kept<'_>>,
        Vec<(String, Bound<'_, PyAny>)>,
        Option<Bound<'_, PyAny>>,
        f64,
    ),
) -> PyResult<Scene> {
    let (path, text, entries, meshes, placed, pose, time) = kept;
    let mut given = BTreeMap::new();
    let mut moved = Vec::new();
    for (name, vertices, triangles, capped, now) in meshes {
        let (vertices, triangles) = (arrays::positions(&vertices)?, arrays::triangles(&triangles)?);
        given.insert(name.clone(), Arc::new(Given::new(&name, vertices, triangles, capped)?));
        moved.extend(now.map(|now| (name, now)));
    }
    let file = SceneFile::of(&path, text);
    let scene = Scene::made(py.detach(|| State::new(file, entries, given)))?;
    for (name, vertices) in moved {
        scene.set_vertices(py, &name, &vertices)?;
    }
    for (name, placement) in placed {
        scene.place(py, &name, &placement)?;
    }
    if let Some(pose) = pose {
        scene.set_pose(py, &pose)?;
    }
    scene.set_time(py, time)?;
    Ok(scene)
}
