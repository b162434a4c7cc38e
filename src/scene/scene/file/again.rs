//! A scene file from whose text the scene is made again with other entries.

use std::path::Path;
use std::sync::Arc;

use super::document::{Source, segments};
use super::error::SceneError;
use super::schema::File;
use super::shelf::MeshKeys;
use super::table::Table;
use super::tissues::Tissues;
use super::{anatomy, probe, settings};
use crate::scene::{Mesh, Origin, Scene, Warning};
use crate::settings::Settings;

/// The text of a scene file.
#[derive(Clone)]
pub struct SceneFile {
    source: Source,
}

impl SceneFile {
    /// Reads the file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        Ok(Self { source: Source::read(path, &[])? })
    }

    /// A file of this text that need not exist. Messages call it `path`, and what it names lies in the folder of that.
    pub fn of(path: &Path, text: String) -> Self {
        Self { source: Source::of(path, text) }
    }

    /// The shape of the mesh that the text calls `name`, whose table then says no `file`.
    pub fn give(&mut self, name: &str, mesh: Arc<Mesh>) {
        self.source.given.insert(name.to_owned(), mesh);
    }

    /// The value that text or entries state at a path, as TOML writes it; none where they state none.
    ///
    /// # Errors
    /// A text that is no TOML, an entry that does not fit into it.
    pub fn stated(
        &self,
        entries: &[(String, String)],
        path: &str,
    ) -> Result<Option<String>, SceneError> {
        Ok(self.source.with(entries).document()?.stated(path))
    }

    /// The file, whether it exists or not.
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// The text.
    pub fn text(&self) -> &str {
        self.source.text()
    }

    /// The scene with `entries` put in, like [`Scene::load`]: reads the files that it names.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn load(&self, entries: &[(String, String)]) -> Result<(Scene, Vec<Warning>), SceneError> {
        let source = self.source.with(entries);
        Scene::of_source(&source, false).map(|(scene, _, warnings)| (scene, warnings))
    }

    /// True if a change of the entry at `path` needs no file that the scene names, so that [`Self::put`] makes it.
    pub fn is_light(path: &str) -> bool {
        let is_light =
            |table: &String| Settings::TABLES.contains(&table.as_str()) || table == "tissues";
        segments(path).first().is_some_and(is_light)
    }

    /// Gives `scene`, which was loaded from this file, the settings, tissues and pose of the probe that the file gives
    /// with `entries`, whatever they are now.
    ///
    /// # Errors
    /// The first entry that does not fit; `scene` is then unchanged.
    pub fn put(&self, entries: &[(String, String)], scene: &mut Scene) -> Result<(), SceneError> {
        let source = self.source.with(entries);
        let document = source.document()?;
        let file = File::of(&document)?;
        let mut tissues = Tissues::new(&document, &file.tissues)?;
        for tissue in &scene.tissues {
            tissues.index("tissues", &tissue.name)?;
        }
        let settings = settings::settings(&document, &file, None)?;
        let pose = probe::pose(&document, "probe", &file.probe.stated)?;
        settings::presentable(&document, &settings)?;
        let mut surfaces = Vec::new();
        for (instance, Origin { mesh, .. }) in scene.instances.iter().zip(&scene.origins.instances)
        {
            let named = |table: &&Table<MeshKeys>| table.stated.text("name") == Some(mesh);
            let table = file.mesh.iter().find(named).expect("the scene was loaded from this file");
            surfaces.push(anatomy::surfaces(&table.stated, tissues.get(instance.tissue)));
        }
        for (instance, surface) in scene.instances.iter_mut().zip(surfaces) {
            instance.surface = surface;
        }
        scene.tissues = tissues.used();
        scene.settings = settings;
        scene.world_from_probe = pose;
        Ok(())
    }

    /// Fails at the first of `entries` that the file cannot have or whose value is out of its range, as far as the
    /// text alone says it.
    ///
    /// # Errors
    /// The fault of the entry.
    pub fn check(&self, entries: &[(String, String)]) -> Result<(), SceneError> {
        let source = self.source.with(entries);
        File::of(&source.document()?).map(drop)
    }
}
