//! Scenes of Python: read from a file or made of dictionaries and arrays, changed key by key.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DAffine3;
use insonify::scene::file::{self, SceneFile, quoted};
use insonify::scene::mesh::Surface;
use insonify::scene::{self, Warning, shipped};
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList, PyTuple};

use crate::arrays;
use crate::error::{SceneError, mistaken, unusable};
use crate::toml;

/// A mesh that a program has given as arrays.
struct Given {
    surface: Surface,
    mesh: Arc<scene::Mesh>,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    cap_openings: bool,
    /// What is to be said of it.
    warnings: Vec<String>,
}

impl Given {
    fn new(
        name: &str,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        cap_openings: bool,
    ) -> PyResult<Self> {
        let made = Surface::new(name, positions.clone(), triangles.clone(), cap_openings);
        let (surface, mesh, issues) = made.map_err(|issues| unusable(name, &issues))?;
        let warnings = texts(&issues);
        Ok(Self { surface, mesh: mesh.into(), positions, triangles, cap_openings, warnings })
    }
}

/// A scene with everything that a program has changed in it.
#[derive(Clone)]
pub struct State {
    file: SceneFile,
    /// What was put in place of the file's entries.
    entries: Vec<(String, String)>,
    pub scene: scene::Scene,
    warnings: Vec<String>,
    /// How many times the anatomy was read; simulators upload it again when it has grown.
    pub generation: u64,
    given: BTreeMap<String, Arc<Given>>,
    /// Where the vertices of given meshes are, where that is not as they were given.
    moved: BTreeMap<String, Vec<[f32; 3]>>,
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
        given: BTreeMap<String, Arc<Given>>,
    ) -> Result<Self, file::SceneError> {
        let mut file = file;
        given.iter().for_each(|(name, mesh)| file.give(name, Arc::clone(&mesh.mesh)));
        let (scene, warnings) = file.load(&entries)?;
        Ok(Self {
            file,
            entries,
            scene,
            warnings: texts(&warnings),
            generation: 0,
            given,
            moved: BTreeMap::new(),
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
        let given = self.given.get(name).ok_or_else(|| {
            PyValueError::new_err(format!(
                "mesh `{name}` is that of a file; only meshes made of arrays take other vertices"
            ))
        })?;
        if positions.len() != given.positions.len() {
            let (wanted, own) = (positions.len(), given.positions.len());
            return Err(PyValueError::new_err(format!(
                "mesh `{name}` has {own} vertices, not {wanted}"
            )));
        }
        let shape = Arc::new(given.surface.shape(positions));
        self.moved.insert(name.to_owned(), positions.to_vec());
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

    fn made(state: Result<State, file::SceneError>) -> PyResult<Self> {
        let state = state.map_err(|e| mistaken(&e))?;
        Ok(Self { state: Arc::new(Mutex::new(state)) })
    }
}

/// The text of a scene file for keyword arguments, and the meshes among them that are arrays.
struct Written {
    text: String,
    given: BTreeMap<String, Arc<Given>>,
}

impl Written {
    fn new(tables: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut out = Self { text: String::new(), given: BTreeMap::new() };
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
        if take("units")?.is_some() {
            return Err(PyValueError::new_err(format!(
                "mesh `{name}` has `units` beside `vertices`, which are in mm: multiply them"
            )));
        }
        let given = table.py().detach(|| Given::new(&name, positions, triangles, capped))?;
        self.given.insert(name, Arc::new(given));
        Ok(())
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

    /// unit, range, words (its choices) and meaning of a key.
    fn describe<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let facts = file::facts(key).map_err(PyKeyError::new_err)?;
        let out = PyDict::new(py);
        out.set_item("unit", facts.unit())?;
        out.set_item("range", facts.range)?;
        out.set_item("words", facts.words())?;
        out.set_item("meaning", facts.meaning())?;
        Ok(out)
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
    fn set_time(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
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
    fn set_pose(&self, py: Python<'_>, pose: &Bound<'_, PyAny>) -> PyResult<()> {
        let pose = arrays::pose(pose)?;
        let mut state = self.lock(py);
        state.pose = Some(pose);
        state.scene.world_from_probe = pose;
        Ok(())
    }

    /// Moves the vertices [N, 3] (mm) of a mesh that was made of arrays; its tissue moves along. The next frame
    /// shows it without reading or building anything anew.
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

    /// World from object space [4, 4] of a mesh.
    fn placement<'py>(&self, py: Python<'py>, mesh: &str) -> PyResult<Bound<'py, PyAny>> {
        let state = self.lock(py);
        let placement = state.scene.instances[state.instance(mesh)?].world_from_object;
        drop(state);
        arrays::fixed_rows(py, &placement)
    }

    /// Places a mesh, whatever motions the scene has for it; None gives it back to these.
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

    /// A scene of its own with the same anatomy, settings, pose, shapes and time; pickle makes one in another
    /// process, which reads the files again that the scene names.
    fn __copy__(&self, py: Python<'_>) -> Self {
        let state = self.lock(py).clone();
        Self { state: Arc::new(Mutex::new(state)) }
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__(py)
    }

    /// What `pickle` keeps: the text of the scene, what was changed in it, and its arrays. Files that the text names are
    /// read again where it is unpickled.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let state = self.lock(py).clone();
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
