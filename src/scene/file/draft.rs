//! Scenes that a program writes or changes: a text, what replaces parts of it, and meshes that are in no file.

use std::path::Path;
use std::sync::Arc;

use super::document::{LISTS, Source, segments};
use super::error::SceneError;
use super::{schema, settings};
use crate::scene::{Mesh, Scene, Warning};
use crate::settings::{Facts, Group, Imaging, Probe, Settings, Simulation, Value};

/// A scene that is not read yet: the text of a scene file, overrides as those of [`Scene::load`], and meshes.
#[derive(Clone)]
pub struct Draft {
    source: Source,
    overrides: Vec<(String, String)>,
}

impl Draft {
    /// Reads the text of a scene file.
    ///
    /// # Errors
    /// A file that is no text, or too large.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Ok(Self { source: Source::read(path, &[])?, overrides: Vec::new() })
    }

    /// A draft of this text. Messages call it `path`, and the files that it names are in the folder of that.
    pub fn of(path: &Path, text: String) -> Self {
        Self { source: Source::of(path, text), overrides: Vec::new() }
    }

    /// The shape of the mesh that the text calls `name`; its table then has no `file`.
    pub fn give(&mut self, name: &str, mesh: Mesh) {
        self.source.given.insert(name.to_owned(), Arc::new(mesh));
    }

    /// Puts a value, as TOML writes it, at a path, as `--set` does; none takes back what was put there.
    ///
    /// # Errors
    /// A path that is none, a value that does not fit: the first mistake of the settings, without reading files. The
    /// draft is then as it was.
    pub fn set(&mut self, path: &str, value: Option<String>) -> Result<(), SceneError> {
        let mut tried = self.overrides.clone();
        tried.retain(|(put, _)| segments(put) != segments(path));
        tried.extend(value.map(|value| (path.to_owned(), value)));
        let before = std::mem::replace(&mut self.overrides, tried);
        let checked = self.settings();
        if checked.is_err() {
            self.overrides = before;
        }
        checked.map(|_| ())
    }

    /// Paths of the overrides.
    pub fn overridden(&self) -> impl Iterator<Item = &str> {
        self.overrides.iter().map(|(path, _)| path.as_str())
    }

    /// Returns whether nothing but [`Self::settings`] depends on what is at this path.
    pub fn is_setting(path: &str) -> bool {
        let parts = segments(path);
        let tables = [Probe::TABLE, Simulation::TABLE, Imaging::TABLE];
        tables.contains(&parts[0].as_str()) && parts.get(1).is_none_or(|key| key != "pose")
    }

    /// The settings of probe, simulation and imaging; reads no file.
    ///
    /// # Errors
    /// Those of [`Scene::load`] that the text itself has.
    pub fn settings(&self) -> Result<Settings, SceneError> {
        let source = self.whole();
        let document = source.document()?;
        let settings = settings::settings(&document, &document.parse()?, None)?;
        super::presentable(&document, &settings)?;
        Ok(settings)
    }

    /// Reads the scene, with the files that it names.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn scene(&self) -> Result<(Scene, Vec<Warning>), SceneError> {
        let (scene, _, warnings) = Scene::of_source(&self.whole(), false)?;
        Ok((scene, warnings))
    }

    /// The value that text or overrides state at a path, as TOML writes it; none where they state none.
    ///
    /// # Errors
    /// A text that is no TOML.
    pub fn stated(&self, path: &str) -> Result<Option<String>, SceneError> {
        let source = self.whole();
        let document = source.document()?;
        Ok(document.stated(path))
    }

    fn whole(&self) -> Source {
        self.source.with(&self.overrides)
    }
}

/// A key that scene files know, with its value in a scene.
pub struct Known {
    /// The facts about the key.
    pub facts: &'static Facts,
    /// Its value; none for keys that a scene holds in another form, as those of geometry.
    pub value: Option<Value>,
}

/// The key at a path of `scene`; none where scene files have no such key.
pub fn known(scene: &Scene, path: &str) -> Option<Known> {
    fn of<T: Group>(settings: Option<&T>, key: &str) -> Option<Known> {
        let row = T::row(key)?;
        Some(Known { facts: &row.facts, value: settings.map(row.get) })
    }
    let parts = segments(path);
    let key = |at: usize| parts[at..].join(".");
    let found = match parts[0].as_str() {
        "probe" => of(Some(&scene.probe), &key(1)),
        "simulation" => of(Some(&scene.simulation), &key(1)),
        "imaging" => of(Some(&scene.imaging), &key(1)),
        "live" => of(Some(&scene.live), &key(1)),
        "tissues" if parts.len() > 2 => {
            of(scene.tissues.iter().find(|t| t.name == parts[1]), &key(2))
        }
        _ => None,
    };
    found.or_else(|| {
        let named = LISTS.contains(&parts[0].as_str()) && parts.len() > 2;
        let (table, key) = match parts.len() {
            1 => (String::new(), key(0)),
            _ if parts[0] == "tissues" && parts.len() > 2 => ("tissues.NAME".to_owned(), key(2)),
            _ => (parts[0].clone(), key(1 + usize::from(named))),
        };
        let tables = schema::reference();
        let (_, keys) = tables.into_iter().find(|(name, _)| *name == table)?;
        let found = keys.into_iter().find(|known| known.path == key)?;
        Some(Known { facts: found.facts, value: None })
    })
}

/// Paths of all keys of scene files; `NAME` stands for the name of a tissue, a mesh or another element of a list.
pub fn paths() -> impl Iterator<Item = String> {
    schema::reference().into_iter().flat_map(|(table, keys)| {
        let before = match table {
            "" => String::new(),
            _ if LISTS.contains(&table) => format!("{table}.NAME."),
            _ => format!("{table}."),
        };
        keys.into_iter().map(move |key| format!("{before}{}", key.path))
    })
}
