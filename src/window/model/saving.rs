//! A session's settings in scene files: saved, and loaded from others.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DAffine3;

use super::{Model, Settings, entries};
use crate::scene::file::{Entry, load_settings, save, save_text};
use crate::scene::{Origins, SceneError};

/// The scene file of a session.
#[derive(Clone, Debug)]
pub struct File {
    /// Path of the file.
    pub path: PathBuf,
    /// Settings of the command line, which replace those of the file.
    pub overrides: Vec<(String, String)>,
    /// Edge of its lattice cell times its frequency, mm MHz, before the quality for the device is applied.
    pub lattice: f64,
    pub(super) origins: Origins,
    /// Its text as it was last read or written: where the file is gone, it is saved from this.
    text: Option<String>,
}

#[cfg(test)]
mod tests;

impl File {
    /// The file at `path` with `overrides`, loaded as `scene`.
    pub fn new(
        path: PathBuf,
        overrides: Vec<(String, String)>,
        scene: &crate::scene::Scene,
    ) -> Self {
        Self {
            text: std::fs::read_to_string(&path).ok(),
            path,
            overrides,
            lattice: entries::lattice(&Settings::of(scene, crate::sim::Tracer::Bvh)),
            origins: scene.origins.clone(),
        }
    }
}

impl Model {
    /// Returns whether settings or named poses differ from those of the file; `with_pose`: or the pose does.
    pub fn is_modified(&self, with_pose: bool) -> bool {
        let as_now = |tracer| Settings { tracer, ..self.loaded.clone() };
        as_now(self.settings.tracer) != self.settings
            || self.has_other_poses()
            || (with_pose && self.pose != self.home)
    }

    /// Entries that make the file give the settings and the named poses, `with_pose` also the pose of the probe.
    pub fn changes(&self, with_pose: bool) -> Vec<Entry> {
        let mut out = self.entries(&self.settings, with_pose.then_some(&self.pose));
        out.extend(self.pose_entries());
        out
    }

    /// Entries that make the file give `settings`, which this session once had, and a pose of the probe:
    /// paths and values of its keys; no value where the file must not have the key.
    pub fn entries(&self, settings: &Settings, pose: Option<&DAffine3>) -> Vec<Entry> {
        let file = &self.file;
        let overrides = file.overrides.iter().cloned();
        let mut out: Vec<Entry> = overrides.map(|(path, value)| (path, Some(value))).collect();
        let from = &self.loaded;
        out.extend(entries::changes(from, settings, &file.origins, file.lattice));
        if let Some(pose) = pose {
            out.extend(entries::pose(pose));
        }
        out
    }

    /// Writes the settings, `with_pose` also the pose of the probe, into the session's file, or into
    /// another one, which becomes the session's.
    ///
    /// # Errors
    /// The file cannot be written. File and session are then unchanged.
    pub fn save(&mut self, to: Option<&Path>, with_pose: bool) -> Result<(), SceneError> {
        let to = to.unwrap_or(&self.file.path).to_owned();
        let changes = self.changes(with_pose);
        let from = &self.file.path;
        match &self.file.text {
            Some(text) if !from.exists() => save_text(text, from, &to, &changes)?,
            _ if !changes.is_empty() || to != *from => save(from, &to, &changes)?,
            _ => {}
        }
        self.file.text = std::fs::read_to_string(&to).ok().or(self.file.text.take());
        let (before, now) = (entries::lattice(&self.loaded), entries::lattice(&self.settings));
        if !entries::is_same_lattice(before, now) {
            self.file.lattice = now;
        }
        self.file.path = to;
        self.file.overrides.clear();
        self.saves += 1;
        self.loaded = self.settings.clone();
        self.poses_are_filed();
        if with_pose {
            self.home = self.pose;
        }
        Ok(())
    }

    /// Takes probe, simulation and image formation from another scene file, as far as it gives
    /// them. Anatomy and pose stay; one step back undoes it.
    ///
    /// # Errors
    /// The file cannot be used. Then nothing has changed.
    pub fn load_settings(&mut self, path: &Path, now: Instant) -> Result<(), SceneError> {
        let before = self.settings.clone();
        load_settings(path, &mut self.settings)?;
        self.history.end_gesture();
        self.note(&before, now);
        self.history.end_gesture();
        Ok(())
    }

    /// Copies a mesh's changes since `before` to all meshes that share its place in the file.
    pub(super) fn unite(&mut self, before: &Settings) {
        let (settings, origins) = (&mut self.settings, &self.file.origins.instances);
        for (i, origin) in origins.iter().enumerate() {
            let surface = settings.surfaces[i];
            let strategy = settings.strategies[i];
            let is_new = [surface != before.surfaces[i], strategy != before.strategies[i]];
            for (j, other) in origins.iter().enumerate() {
                if is_new[0] && other.mesh == origin.mesh {
                    settings.surfaces[j] = surface;
                }
                let together = settings.strategies[j].is_some();
                if is_new[1] && together && entries::switch(other) == entries::switch(origin) {
                    settings.strategies[j] = strategy;
                }
            }
        }
    }
}
