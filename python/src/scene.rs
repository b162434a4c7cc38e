//! Scenes of Python: read from a file or made of dictionaries and arrays, changed key by key.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use insonify::scene::file::{self, SceneFile};
use insonify::scene::shipped;
use insonify::sim::contact::PRESS;
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList, PyTuple};

use crate::arrays;
use crate::error::{SceneError, mistaken};
use crate::levels;
use crate::pickle;
use crate::skin;
use crate::state::State;
use crate::toml;
use crate::written::Written;

/// What is imaged: anatomy, tissues, probe and every setting of the manual (docs/scenes.md).
///
/// Scene.load(path) reads a scene file. Scene(...) makes one of dictionaries with the tables of a scene file; a mesh
/// may have `vertices` [N, 3] in mm and `triangles` [M, 3] in place of a file:
///
///     Scene(
///         probe={"preset": "linear", "depth": 40},
///         tissues={"cyst": {"based_on": "water"}},
///         background="liver",
///         mesh={"cyst": {"tissue": "cyst", "vertices": v, "triangles": t}},
///     )
///
/// scene["imaging.gain"] reads a key, scene["imaging.gain"] = "20 dB" sets it, = None takes that back. Quantities are
/// read as numbers in the unit that describe(key) names, angles as text; numbers and text with a unit are taken.
/// Scenes are copied by copy.copy and sent to other processes by pickle.
#[pyclass(frozen, module = "insonify")]
pub struct Scene {
    pub state: Arc<Mutex<State>>,
}

impl Scene {
    /// The state, without the interpreter while somebody else has it.
    fn lock<'s>(&'s self, py: Python<'_>) -> MutexGuard<'s, State> {
        use pyo3::sync::MutexExt;
        self.state.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    pub fn made(state: Result<State, file::SceneError>) -> PyResult<Self> {
        let state = state.map_err(|e| mistaken(&e))?;
        Ok(Self { state: Arc::new(Mutex::new(state)) })
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (*, folder = PathBuf::from("."), **tables))]
    fn new(py: Python<'_>, folder: PathBuf, tables: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let empty = PyDict::new(py);
        let Written { text, given } = Written::new(tables.unwrap_or(&empty))?;
        let file = SceneFile::of(&folder.join("Scene()"), text);
        Self::made(py.detach(|| State::new(file, Vec::new(), given)))
    }

    /// The scene of a file, or one that ships by its name ("abdomen"), with `overrides` as of `--set`. SceneError: a
    /// mistake, with file, line and remedy.
    #[staticmethod]
    #[pyo3(signature = (path, overrides = None))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        overrides: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let overrides = overrides.map_or(Ok(Vec::new()), toml::entries)?;
        let path = shipped::find(&path).map_err(|e| SceneError::new_err(e.to_string()))?;
        let load = || State::new(SceneFile::read(&path)?, overrides, BTreeMap::new());
        Self::made(py.detach(load))
    }

    /// Writes the scene as a scene file: the text that it was made of, everything that was set, its pose, and meshes of arrays
    /// as files beside it. Not its time. SceneError, OSError: a file that cannot be written, and one that ships; ValueError:
    /// a mesh that was placed by place().
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let state = self.lock(py);
        crate::saving::save(&state, &path)
    }

    /// The value of a key; None where it is not set and has no default. KeyError: scene files have no such key.
    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        let facts = file::facts(key).map_err(PyKeyError::new_err)?;
        let state = self.lock(py);
        if let Some(value) = file::value(&state.scene, key) {
            return toml::object(py, &value, facts.form);
        }
        match state.file.stated(&state.entries, key).map_err(|e| mistaken(&e))? {
            Some(text) => toml::stated(py, &text, facts),
            None => Ok(py.None().into_bound(py)),
        }
    }

    /// True for a key that scene files have.
    fn __contains__(&self, key: &Bound<'_, PyAny>) -> bool {
        key.extract::<String>().is_ok_and(|key| file::facts(&key).is_ok())
    }

    /// The keys that were set by hand, in the order in which they were set.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        let keys: Vec<String> = self.lock(py).by_hand().map(str::to_owned).collect();
        PyList::new(py, keys)?.try_iter()
    }

    /// Number of keys that were set by hand.
    fn __len__(&self, py: Python<'_>) -> usize {
        self.lock(py).by_hand().count()
    }

    /// Takes back what was set by hand, as setting to None does.
    fn __delitem__(&self, py: Python<'_>, key: &str) -> PyResult<()> {
        let none = py.None();
        self.__setitem__(py, key, none.bind(py))
    }

    /// Sets a key. Keys of probe, simulation and imaging at once; others read the scene again. SceneError: a value
    /// that the key does not take; the scene is then as it was.
    fn __setitem__(&self, py: Python<'_>, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let text = (!value.is_none()).then(|| toml::text(value)).transpose()?;
        // A key that there is not would be taken back without a word.
        if text.is_none() && file::keys_below(key).is_empty() {
            file::facts(key).map_err(PyKeyError::new_err)?;
        }
        let set = || self.state.lock().unwrap_or_else(PoisonError::into_inner).set(key, text);
        py.detach(set).map_err(|e| mistaken(&e))
    }

    /// The keys that were set by hand, with their values.
    fn items<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
        let keys: Vec<String> = self.lock(py).by_hand().map(str::to_owned).collect();
        let item = |key: String| Ok((key.clone(), self.__getitem__(py, &key)?));
        keys.into_iter().map(item).collect()
    }

    /// The value of a key; `default` where it is not set, or scene files have no such key.
    #[pyo3(signature = (key, default = None))]
    fn get<'py>(
        &self,
        py: Python<'py>,
        key: &str,
        default: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let found = file::facts(key).is_ok().then(|| self.__getitem__(py, key)).transpose()?;
        Ok(found.filter(|value| !value.is_none()).or(default))
    }

    /// Sets several keys, one after the other.
    fn update(&self, py: Python<'_>, settings: &Bound<'_, PyAny>) -> PyResult<()> {
        for item in settings.call_method0("items")?.try_iter()? {
            let (key, value): (String, Bound<'_, PyAny>) = item?.extract()?;
            self.__setitem__(py, &key, &value)?;
        }
        Ok(())
    }

    /// unit, range, words (its choices), meaning and default of a key; default: None where there is none, or where it is
    /// not always the same, as that of a preset.
    fn describe<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let facts = file::facts(key).map_err(PyKeyError::new_err)?;
        let out = PyDict::new(py);
        out.set_item("unit", facts.unit())?;
        out.set_item("range", facts.range)?;
        out.set_item("words", facts.words())?;
        out.set_item("meaning", facts.meaning())?;
        let default = file::default(key).map(|value| toml::object(py, &value, facts.form));
        out.set_item("default", default.transpose()?)?;
        Ok(out)
    }

    /// The settings of level `number` of live quality: 0 is the scene's own, each further one costs two thirds of the one
    /// before, down to about a thirtieth. scene.update(scene.level(5)) sets them. IndexError: no such level.
    fn level<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyDict>> {
        levels::level(py, &self.lock(py).scene, number)
    }

    /// All keys of scene files: `mesh.NAME.tissue` stands for those of every mesh.
    #[staticmethod]
    fn keys() -> Vec<String> {
        file::paths().collect()
    }

    /// The scene's title.
    #[getter]
    fn name(&self, py: Python<'_>) -> String {
        self.lock(py).scene.name.clone()
    }

    /// What is to be said of the scene, its files and its arrays: open edges, triangles that are none, and the like.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        let state = self.lock(py);
        let of_arrays = state.given.values().flat_map(|given| &given.warnings);
        state.warnings.iter().chain(of_arrays).cloned().collect()
    }

    /// Names of the tissues, in the order of their numbers in labels.
    #[getter]
    fn tissues(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scene.tissues.iter().map(|tissue| tissue.name.clone()).collect()
    }

    /// Names of the placed meshes, in the order of their numbers in labels.
    #[getter]
    fn meshes(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scene.instances.iter().map(|instance| instance.name.clone()).collect()
    }

    /// The moment that is shown, s.
    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.lock(py).time
    }

    #[setter]
    pub fn set_time(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let seconds = crate::simulator::seconds(seconds)?;
        let mut state = self.lock(py);
        state.time = seconds;
        state.at(seconds);
        Ok(())
    }

    /// World from probe space [4, 4], mm: x lateral, y elevation, z depth, the origin in the middle of the face. Taken
    /// only if it is a rotation with a shift; what is read is a copy that cannot be written into.
    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pose = self.lock(py).scene.world_from_probe;
        arrays::fixed_rows(py, &pose)
    }

    #[setter]
    pub fn set_pose(&self, py: Python<'_>, pose: &Bound<'_, PyAny>) -> PyResult<()> {
        let pose = arrays::pose(pose)?;
        let mut state = self.lock(py);
        state.pose = Some(pose);
        state.scene.world_from_probe = pose;
        Ok(())
    }

    /// Contact of the probe's face with the skin, at `pose` or where the probe is: `share` of the face that is coupled, 0
    /// to 1, and `depth`, mm, that it is pushed in, the mean over the face. None of a scene without [contact].
    #[pyo3(signature = (pose = None))]
    fn contact<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        let pose = pose.map(arrays::pose).transpose()?;
        let mut state = self.lock(py);
        let pose = pose.unwrap_or(state.scene.world_from_probe);
        let Some(touch) = skin::contact(&mut state, &pose) else { return Ok(None) };
        let out = PyDict::new(py);
        out.set_item("share", touch.share)?;
        out.set_item("depth", touch.depth)?;
        Ok(Some(out))
    }

    /// The pose [4, 4] on the skin that `pose`, or the probe's own, is slid to: by `by` mm along the skin, lateral and
    /// elevation, turned with it as a hand turns; pressed in by `press` mm where it is deepest. upright: turned so that it
    /// looks along the skin's normal. The scene's own pose stays. ValueError: a scene without [contact], no skin there.
    #[pyo3(signature = (pose = None, *, by = [0.0, 0.0], press = PRESS, upright = false), text_signature = "($self, pose=None, *, by=(0, 0), press=1.5, upright=False)")]
    fn pose_on_skin<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'py, PyAny>>,
        by: [f64; 2],
        press: f64,
        upright: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = pose.map(arrays::pose).transpose()?;
        let mut state = self.lock(py);
        let pose = pose.unwrap_or(state.scene.world_from_probe);
        let held = skin::held(&mut state, &pose, by, press, upright)?;
        drop(state);
        arrays::rows(py, &held)
    }

    /// Moves the vertices [N, 3] (mm) of a mesh that was made of arrays; its tissue moves along. The next frame
    /// shows it without reading or building anything anew.
    pub fn set_vertices(
        &self,
        py: Python<'_>,
        mesh: &str,
        vertices: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let positions = arrays::positions(vertices)?;
        py.detach(|| {
            self.state.lock().unwrap_or_else(PoisonError::into_inner).reshape(mesh, &positions)
        })
    }

    /// World from object space [4, 4] of a mesh.
    fn placement<'py>(&self, py: Python<'py>, mesh: &str) -> PyResult<Bound<'py, PyAny>> {
        let state = self.lock(py);
        let placement = state.scene.instances[state.instance(mesh)?].world_from_object;
        drop(state);
        arrays::fixed_rows(py, &placement)
    }

    /// Places a mesh, whatever motions the scene has for it; None gives it back to these.
    pub fn place(
        &self,
        py: Python<'_>,
        mesh: &str,
        world_from_object: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let wanted = match world_from_object.is_none() {
            true => None,
            false => Some(arrays::affine(world_from_object, "the placement")?),
        };
        if wanted.is_some_and(|map| map.matrix3.determinant().abs() < 1e-12) {
            return Err(PyValueError::new_err(
                "a placement that flattens the mesh: its determinant is 0",
            ));
        }
        if wanted.is_some_and(|map| map.matrix3.determinant() < 0.0) {
            return Err(PyValueError::new_err(
                "a placement that mirrors the mesh, whose inside would be outside: its determinant is negative",
            ));
        }
        let mut state = self.lock(py);
        let instance = state.instance(mesh)?;
        let now = state.scene.instances[instance].world_from_object;
        let before = state.placed.remove(&instance).map_or(now, |[_, before]| before);
        match wanted {
            Some(map) => _ = state.placed.insert(instance, [map, before]),
            None => state.scene.instances[instance].world_from_object = before,
        }
        let time = state.time;
        state.at(time);
        Ok(())
    }

    /// A scene of its own with the same anatomy, settings, pose, shapes and time; pickle makes one in another
    /// process, which reads the files again that the scene names.
    fn __copy__(&self, py: Python<'_>) -> Self {
        let state = self.lock(py).clone();
        Self { state: Arc::new(Mutex::new(state)) }
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__(py)
    }

    /// True for the same scene with the same changes, shapes, pose and time.
    fn __eq__(&self, py: Python<'_>, other: &Self) -> bool {
        if Arc::ptr_eq(&self.state, &other.state) {
            return true;
        }
        let other = other.lock(py).clone();
        self.lock(py).is_same(&other)
    }

    /// The scene as `pickle` keeps it.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let state = self.lock(py).clone();
        pickle::kept(py, &state)
    }

    pub fn __repr__(&self, py: Python<'_>) -> String {
        let state = self.lock(py);
        let scene = &state.scene;
        format!(
            "<insonify.Scene '{}': {} meshes, {} triangles, {} tissues>",
            scene.name,
            scene.instances.len(),
            scene.triangles(),
            scene.tissues.len()
        )
    }
}
