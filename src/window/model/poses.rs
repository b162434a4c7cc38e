//! Named poses of the probe: gone to, added, renamed, removed, and saved with the scene file.

use std::time::Instant;

use toml_edit::Value;

use super::history::Step;
use super::{Model, Source, entries};
use crate::scene::NamedPose;
use crate::scene::file::{Entry, quoted};

/// A named pose, and its name in the scene file, if it is there.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownPose {
    /// Name and pose.
    pub pose: NamedPose,
    /// Its name in the file.
    pub filed_as: Option<String>,
}

impl KnownPose {
    /// The named poses of a scene, which its file has.
    pub(super) fn of(poses: &[NamedPose]) -> Vec<Self> {
        let filed =
            |pose: &NamedPose| Self { pose: pose.clone(), filed_as: Some(pose.name.clone()) };
        poses.iter().map(filed).collect()
    }
}

impl Model {
    /// The named poses.
    pub fn poses(&self) -> &[KnownPose] {
        &self.poses
    }

    /// Adds the present pose of the probe under a name; returns whether the name is free and not empty.
    pub fn add_pose(&mut self, name: &str, now: Instant) -> bool {
        let name = name.trim();
        if !self.is_free(name) {
            return false;
        }
        let mut poses = self.poses.clone();
        let pose = NamedPose { name: name.to_owned(), world_from_probe: self.pose };
        poses.push(KnownPose { pose, filed_as: None });
        self.set_poses(poses, now);
        true
    }

    /// Gives a pose another name; returns whether that is free and not empty.
    pub fn rename_pose(&mut self, index: usize, name: &str, now: Instant) -> bool {
        let name = name.trim();
        if self.poses[index].pose.name == name {
            return true;
        }
        if !self.is_free(name) {
            return false;
        }
        let mut poses = self.poses.clone();
        poses[index].pose.name = name.to_owned();
        self.set_poses(poses, now);
        true
    }

    /// Removes a pose.
    pub fn remove_pose(&mut self, index: usize, now: Instant) {
        let mut poses = self.poses.clone();
        poses.remove(index);
        self.set_poses(poses, now);
    }

    /// Puts the probe to a named pose.
    pub fn go_to_pose(&mut self, index: usize, now: Instant) {
        self.looked_up = true;
        self.place_probe(Source::Pointer, self.poses[index].pose.world_from_probe, now);
    }

    /// A name for the next pose that no pose has: `view 1`.
    pub fn next_pose_name(&self) -> String {
        let mut names = (self.poses.len() + 1..).map(|number| format!("view {number}"));
        names.find(|name| self.is_free(name)).expect("there is no last number")
    }

    fn is_free(&self, name: &str) -> bool {
        !name.is_empty() && self.poses.iter().all(|known| known.pose.name != name)
    }

    pub(super) fn set_poses(&mut self, poses: Vec<KnownPose>, now: Instant) {
        let before = std::mem::replace(&mut self.poses, poses);
        self.history.push(Step::Poses(before), Vec::new(), now);
    }

    /// Returns whether the named poses differ from those of the file.
    pub(super) fn has_other_poses(&self) -> bool {
        self.poses != KnownPose::of(&self.filed_poses)
    }

    /// Entries that make the file give the named poses: what is gone is removed, then names change, then poses are
    /// added.
    pub(super) fn pose_entries(&self) -> Vec<Entry> {
        let mut out = Vec::new();
        let path = |name: &str| format!("pose.{}", quoted(name));
        let still = |filed: &&NamedPose| {
            !self.poses.iter().any(|known| known.filed_as.as_ref() == Some(&filed.name))
        };
        out.extend(self.filed_poses.iter().filter(still).map(|gone| (path(&gone.name), None)));
        let renamed = self.poses.iter().filter_map(|known| {
            let old = known.filed_as.as_ref().filter(|old| **old != known.pose.name)?;
            Some((old, known.pose.name.as_str()))
        });
        // Two poses may have changed their names with each other: by way of names that none has.
        let between = |old: &str| format!("{old} (renamed)");
        let named = |from: &str, to: &str| {
            (format!("{}.name", path(from)), Some(Value::from(to).to_string()))
        };
        let renamed: Vec<_> = renamed.collect();
        out.extend(renamed.iter().map(|(old, _)| named(old, &between(old))));
        out.extend(renamed.iter().map(|(old, new)| named(&between(old), new)));
        for known in self.poses.iter().filter(|known| known.filed_as.is_none()) {
            out.extend(entries::pose_at(&path(&known.pose.name), &known.pose.world_from_probe));
        }
        out
    }

    /// Notes that the file has the named poses now.
    pub(super) fn poses_are_filed(&mut self) {
        self.filed_poses = self.poses.iter().map(|known| known.pose.clone()).collect();
        self.poses = KnownPose::of(&self.filed_poses);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::super::tests::model;
    use super::super::{Axis, Model};
    use crate::scene::Scene;

    const FILE: &str = "# A scene.\n[[pose]] # the first\nname = \"a\"\nposition = [1, 2, 3]\n\n\
        [[pose]]\nname = \"b.c\" # dotted\ndirection = [0, 1, 0]\n\n[imaging]\ngain = 3\n";

    fn of(text: &str) -> (tempfile::TempDir, Model) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text).expect("written");
        let (scene, _) = Scene::load(&path, &[]).expect("sound");
        let file = super::super::File::new(path, Vec::new(), &scene);
        let model = Model::new(&scene, file, crate::sim::Tracer::Bvh, 0.0, Instant::now());
        (folder, model)
    }

    fn names(model: &Model) -> Vec<&str> {
        model.poses().iter().map(|known| known.pose.name.as_str()).collect()
    }

    #[test]
    fn poses_are_added_renamed_removed_saved_and_read_again() {
        let now = Instant::now();
        let (folder, mut model) = of(FILE);
        assert_eq!(names(&model), ["a", "b.c"]);
        assert!(!model.is_modified(false));
        model.move_probe(Axis::Lateral, 7.0, now);
        assert!(model.add_pose(" long axis ", now));
        assert!(!model.add_pose("a", now) && !model.add_pose(" ", now));
        // Names change places.
        assert!(model.rename_pose(0, "x", now) && model.rename_pose(1, "a", now));
        assert!(model.rename_pose(0, "b.c", now) && !model.rename_pose(0, "a", now));
        assert!(model.is_modified(false));
        model.save(None, false).expect("saved");
        assert!(!model.is_modified(false));
        let text = std::fs::read_to_string(folder.path().join("scene.toml")).expect("there");
        let wanted = FILE.replace("\"a\"", "\"?\"").replace("\"b.c\"", "\"a\"");
        let wanted = wanted.replace("\"?\"", "\"b.c\"");
        // The new one comes behind the others.
        let (first, rest) = wanted.split_once("\n[imaging]").expect("it has one");
        assert!(text.starts_with(first) && text.ends_with(rest), "{text}");
        let (_again, saved) = of(&text);
        assert_eq!(names(&saved), ["b.c", "a", "long axis"]);
        let at = |i: usize| saved.poses()[i].pose.world_from_probe;
        assert!(at(2).abs_diff_eq(model.pose, 1e-6), "{} {}", at(2), model.pose);
        assert_eq!(at(0).translation.to_array(), [1.0, 2.0, 3.0]);
        // Removed, with what is written about it.
        model.remove_pose(0, now);
        model.remove_pose(0, now);
        model.save(None, false).expect("saved");
        let text = std::fs::read_to_string(folder.path().join("scene.toml")).expect("there");
        assert_eq!(names(&of(&text).1), ["long axis"]);
        assert!(text.contains("gain = 3") && !text.contains("the first"), "{text}");
    }

    #[test]
    fn a_scene_without_poses_gets_its_first() {
        let (folder, mut model) = of("[imaging]\ngain = 3\n");
        assert!(model.add_pose("1", Instant::now()));
        assert!(model.add_pose("0", Instant::now()));
        model.save(None, false).expect("saved");
        let text = std::fs::read_to_string(folder.path().join("scene.toml")).expect("there");
        assert_eq!(names(&of(&text).1), ["1", "0"], "{text}");
    }

    #[test]
    fn the_probe_goes_to_a_pose_and_undo_takes_all_of_it_back() {
        let now = Instant::now();
        let mut model = model(now);
        let home = model.pose;
        model.move_probe(Axis::Lateral, 5.0, now);
        let there = model.pose;
        assert_eq!(model.next_pose_name(), "view 1");
        assert!(model.add_pose("there", now));
        model.place_probe(super::Source::Keyboard, home, now);
        model.go_to_pose(0, now);
        assert_eq!(model.pose, there);
        model.undo(now);
        assert_eq!(model.pose, home);
        model.undo(now);
        assert_eq!((model.pose, names(&model)), (there, vec!["there"]));
        model.undo(now);
        assert_eq!(names(&model), [""; 0]);
        model.undo(now);
        assert_eq!((model.pose, model.undoable()), (home, [false, true]));
        (0..4).for_each(|_| model.redo(now));
        assert_eq!((model.pose, names(&model)), (there, vec!["there"]));
    }
}
