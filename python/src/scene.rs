//! Scenes of Python: read from a file or made of dictionaries and arrays, changed key by key.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DAffine3;
use insonify::scene::file::{self, SceneFile, quoted};
use insonify::scene::mesh::Surface;
use insonify::scene::{self, Warning};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays;
use crate::error::{mistaken, unusable};
use crate::toml;

/// A scene with everything that a program has changed in it.
pub struct State {
    file: SceneFile,
    /// What was put in place of the file's entries.
    entries: Vec<(String, String)>,
    pub scene: scene::Scene,
    warnings: Vec<String>,
    /// How many times the anatomy was read; simulators upload it again when it has grown.
    pub generation: u64,
    surfaces: HashMap<String, Surface>,
    /// Placements that a program gave, by instance, each with the one before: the graph of the scene has no say in them.
    placed: BTreeMap<usize, [DAffine3; 2]>,
    /// The pose that a program gave.
    pose: Option<DAffine3>,
    pub time: f64,
}

impl State {
    fn new(
        file: SceneFile,
        entries: Vec<(String, String)>,
        surfaces: HashMap<String, Surface>,
    ) -> Result<Self, file::SceneError> {
        let (scene, warnings) = file.load(&entries)?;
        Ok(Self {
            file,
            entries,
            scene,
            warnings: texts(&warnings),
            generation: 0,
            surfaces,
            placed: BTreeMap::new(),
            pose: None,
            time: 0.0,
        })
    }

    /// Puts a value at a path; none takes back what was put there.
    fn set(&mut self, path: &str, value: Option<String>) -> Result<(), file::SceneError> {
        let mut entries = self.entries.clone();
        entries.retain(|(put, _)| put != path);
        entries.extend(value.map(|value| (path.to_owned(), value)));
        if SceneFile::is_light(path) {
            self.file.put(&entries, &mut self.scene)?;
        } else {
            let (scene, warnings) = self.file.load(&entries)?;
            self.scene = scene;
            self.warnings = texts(&warnings);
            self.generation += 1;
        }
        self.entries = entries;
        if path.starts_with("probe.pose") {
            self.pose = None;
        }
        if let Some(pose) = self.pose {
            self.scene.world_from_probe = pose;
        }
        self.at(self.time);
        Ok(())
    }

    /// Sets everything to its state at `seconds`.
    pub fn at(&mut self, seconds: f64) {
        self.scene.set_time(seconds);
        for (&instance, &[placement, _]) in &self.placed {
            self.scene.instances[instance].world_from_object = placement;
        }
    }

    /// Paths of the keys that were set by hand.
    pub fn by_hand(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|(path, _)| path.as_str())
    }

    fn reshape(&mut self, name: &str, positions: &[[f32; 3]]) -> PyResult<()> {
        let instance = self.instance(name)?;
        let surface = self.surfaces.get(name).ok_or_else(|| {
            PyValueError::new_err(format!(
                "mesh `{name}` is that of a file; only meshes made of arrays take other vertices"
            ))
        })?;
        if positions.len() != surface.vertices() {
            let (given, own) = (positions.len(), surface.vertices());
            return Err(PyValueError::new_err(format!(
                "mesh `{name}` has {own} vertices, not {given}"
            )));
        }
        let shape = Arc::new(surface.shape(positions));
        self.file.give(name, Arc::clone(&shape));
        self.scene.reshape(instance, shape);
        Ok(())
    }

    fn instance(&self, name: &str) -> PyResult<usize> {
        let found = self.scene.instances.iter().position(|i| i.name == name);
        found.ok_or_else(|| {
            let names = self.scene.instances.iter().map(|i| i.name.as_str());
            let remedy = insonify::settings::suggest::among(name, names);
            PyKeyError::new_err(format!("the scene has no mesh `{name}`; {remedy}"))
        })
    }
}

fn texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(Warning::to_string).collect()
}

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

    fn made(state: Result<State, file::SceneError>) -> PyResult<Self> {
        let state = state.map_err(|e| mistaken(&e))?;
        Ok(Self { state: Arc::new(Mutex::new(state)) })
    }
}

/// The text of a scene file for keyword arguments, and the surfaces among them.
struct Written {
    text: String,
    surfaces: Vec<(String, Surface, scene::Mesh)>,
}

impl Written {
    fn new(tables: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut out = Self { text: String::new(), surfaces: Vec::new() };
        let lists = ["mesh", "wire", "group", "transform", "selector"];
        let mut behind = String::new();
        for (key, value) in tables {
            let key: String = key.extract()?;
            if !lists.contains(&key.as_str()) {
                out.text += &format!("{} = {}\n", quoted(&key), toml::text(&value)?);
                continue;
            }
            for table in out.elements(&key, &value)? {
                behind += &format!("[[{key}]]\n");
                for (key, value) in toml::entries(&table)? {
                    behind += &format!("{} = {value}\n", quoted(&key));
                }
            }
        }
        out.text += &behind;
        Ok(out)
    }

    /// The elements of a list of tables: given as a list, or as a dictionary by name. Arrays of meshes are taken out.
    fn elements<'py>(
        &mut self,
        key: &str,
        value: &Bound<'py, PyAny>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let wrong = |_| {
            PyTypeError::new_err(format!("{key} is a dict of dicts by name, or a list of dicts"))
        };
        let mut out = Vec::new();
        if let Ok(by_name) = value.cast::<PyDict>() {
            for (name, table) in by_name {
                let table =
                    table.cast_into::<PyDict>().map_err(|e| wrong(e.into_inner()))?.copy()?;
                table.set_item("name", name)?;
                out.push(table);
            }
        } else {
            let list = value.cast::<PyList>().map_err(|_| wrong(value.clone()))?;
            for table in list {
                out.push(table.cast_into::<PyDict>().map_err(|e| wrong(e.into_inner()))?.copy()?);
            }
        }
        if key == "mesh" {
            out.iter().try_for_each(|table| self.surface(table))?;
        }
        Ok(out)
    }

    fn surface(&mut self, table: &Bound<'_, PyDict>) -> PyResult<()> {
        let take = |key: &str| {
            let value = table.get_item(key)?;
            if value.is_some() {
                table.del_item(key)?;
            }
            PyResult::Ok(value)
        };
        let (vertices, triangles) = match (take("vertices")?, take("triangles")?) {
            (None, None) => return Ok(()),
            (Some(vertices), Some(triangles)) => (vertices, triangles),
            _ => {
                return Err(PyValueError::new_err(
                    "a mesh has both `vertices` and `triangles`, or neither",
                ));
            }
        };
        let capped = take("cap_openings")?.map_or(Ok(false), |flag| flag.extract())?;
        let name: String = match table.get_item("name")? {
            Some(name) => name.extract()?,
            None => return Err(PyValueError::new_err("a mesh needs a `name`")),
        };
        let positions = arrays::positions(&vertices)?;
        let triangles = arrays::triangles(&triangles)?;
        let made = table.py().detach(|| Surface::new(&name, positions, triangles, capped));
        let (surface, mesh, _) = made.map_err(|issues| unusable(&name, &issues))?;
        self.surfaces.push((name, surface, mesh));
        Ok(())
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (*, folder = PathBuf::from("."), **tables))]
    fn new(py: Python<'_>, folder: PathBuf, tables: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let empty = PyDict::new(py);
        let Written { text, surfaces } = Written::new(tables.unwrap_or(&empty))?;
        let mut file = SceneFile::of(&folder.join("Scene()"), text);
        let mut kept = HashMap::new();
        for (name, surface, mesh) in surfaces {
            file.give(&name, mesh.into());
            kept.insert(name, surface);
        }
        Self::made(py.detach(|| State::new(file, Vec::new(), kept)))
    }

    #[staticmethod]
    #[pyo3(signature = (path, overrides = None))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        overrides: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let overrides = overrides.map_or(Ok(Vec::new()), toml::entries)?;
        let load = || State::new(SceneFile::read(&path)?, overrides, HashMap::new());
        Self::made(py.detach(load))
    }

    fn __getitem__<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        let facts = file::facts(key).map_err(PyKeyError::new_err)?;
        let state = self.lock(py);
        if let Some(value) = file::value(&state.scene, key) {
            return toml::object(py, &value, facts.form);
        }
        let stated = state.file.stated(&state.entries, key).map_err(|e| mistaken(&e))?;
        stated.map(|text| text.trim_matches('"').to_owned()).into_bound_py_any(py)
    }

    fn __setitem__(&self, py: Python<'_>, key: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let text = (!value.is_none()).then(|| toml::text(value)).transpose()?;
        let set = || self.state.lock().unwrap_or_else(PoisonError::into_inner).set(key, text);
        py.detach(set).map_err(|e| mistaken(&e))
    }

    /// The facts about a key: unit, range, default, meaning.
    fn describe<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let facts = file::facts(key).map_err(PyKeyError::new_err)?;
        let out = PyDict::new(py);
        out.set_item("unit", facts.unit())?;
        out.set_item("range", facts.range)?;
        out.set_item("words", facts.words())?;
        out.set_item("meaning", facts.meaning())?;
        Ok(out)
    }

    /// Paths of all keys, as the manual's tables have them.
    #[staticmethod]
    fn keys() -> Vec<String> {
        file::paths().collect()
    }

    #[getter]
    fn name(&self, py: Python<'_>) -> String {
        self.lock(py).scene.name.clone()
    }

    #[getter]
    fn warnings(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).warnings.clone()
    }

    #[getter]
    fn tissues(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scene.tissues.iter().map(|tissue| tissue.name.clone()).collect()
    }

    #[getter]
    fn meshes(&self, py: Python<'_>) -> Vec<String> {
        self.lock(py).scene.instances.iter().map(|instance| instance.name.clone()).collect()
    }

    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.lock(py).time
    }

    #[setter]
    fn set_time(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let seconds = crate::simulator::seconds(seconds)?;
        let mut state = self.lock(py);
        state.time = seconds;
        state.at(seconds);
        Ok(())
    }

    #[getter]
    fn pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pose = self.lock(py).scene.world_from_probe;
        arrays::rows(py, &pose)
    }

    #[setter]
    fn set_pose(&self, py: Python<'_>, pose: &Bound<'_, PyAny>) -> PyResult<()> {
        let pose = arrays::pose(pose)?;
        let mut state = self.lock(py);
        state.pose = Some(pose);
        state.scene.world_from_probe = pose;
        Ok(())
    }

    /// Gives a mesh that was made of arrays other positions of its vertices, [N, 3] in mm.
    fn set_vertices(
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

    /// World from object space of a mesh.
    fn placement<'py>(&self, py: Python<'py>, mesh: &str) -> PyResult<Bound<'py, PyAny>> {
        let state = self.lock(py);
        let placement = state.scene.instances[state.instance(mesh)?].world_from_object;
        drop(state);
        arrays::rows(py, &placement)
    }

    /// Places a mesh by a matrix, whatever the scene's graph says; None gives it back to that.
    fn place(
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

    fn __repr__(&self, py: Python<'_>) -> String {
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
