//! A scene with everything that a program has changed in it.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;
use insonify::scene::file::{self, SceneFile};
use insonify::scene::mesh::Surface;
use insonify::scene::{self, Warning};
use insonify::sim::contact::Skins;
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;

use crate::error::unusable;

/// A mesh that a program has given as arrays.
pub struct Given {
    surface: Surface,
    mesh: Arc<scene::Mesh>,
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub cap_openings: bool,
    /// Warnings about it.
    pub warnings: Vec<String>,
}

impl Given {
    pub fn new(
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
    pub file: SceneFile,
    /// What was put in place of the file's entries.
    pub entries: Vec<(String, String)>,
    pub scene: scene::Scene,
    pub warnings: Vec<String>,
    /// How many times the anatomy was read; simulators upload it again when it has grown.
    pub generation: u64,
    pub given: BTreeMap<String, Arc<Given>>,
    /// Where the vertices of given meshes are, where that is not as they were given.
    pub moved: BTreeMap<String, Vec<[f32; 3]>>,
    /// Placements that a program gave, by instance, each with the one before: the graph of the scene has no say in them.
    pub placed: BTreeMap<usize, [DAffine3; 2]>,
    /// The pose that a program gave.
    pub pose: Option<DAffine3>,
    pub time: f64,
    /// Trees over the skin, for questions about contact.
    pub skins: Skins,
}

impl State {
    pub fn new(
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
            skins: Skins::default(),
        })
    }

    /// Returns whether both are made of the same, file and changes alike.
    pub fn is_same(&self, other: &Self) -> bool {
        let given = |(a, b): (&Arc<Given>, &Arc<Given>)| {
            a.positions == b.positions
                && a.triangles == b.triangles
                && a.cap_openings == b.cap_openings
        };
        let whole = |state: &Self| std::path::absolute(state.file.path()).ok();
        whole(self) == whole(other)
            && self.file.text() == other.file.text()
            && self.entries == other.entries
            && self.given.keys().eq(other.given.keys())
            && self.given.values().zip(other.given.values()).all(given)
            && self.moved == other.moved
            && self.placed == other.placed
            && self.pose == other.pose
            && self.time == other.time
    }

    /// Puts a value at a path; none takes back what was put there.
    pub fn set(&mut self, path: &str, value: Option<String>) -> Result<(), file::SceneError> {
        let mut entries = self.entries.clone();
        entries.retain(|(put, _)| put != path);
        entries.extend(value.map(|value| (path.to_owned(), value)));
        if SceneFile::is_light(path) {
            self.file.put(&entries, &mut self.scene)?;
        } else {
            let (scene, warnings) = self.file.load(&entries)?;
            self.scene = scene;
            self.warnings = texts(&warnings);
            self.skins = Skins::default();
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

    pub fn reshape(&mut self, name: &str, positions: &[[f32; 3]]) -> PyResult<()> {
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

    pub fn instance(&self, name: &str) -> PyResult<usize> {
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
