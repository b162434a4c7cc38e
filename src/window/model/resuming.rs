//! A session that goes on: with its scene read again, or with what an earlier one has left unsaved.

use std::time::Instant;

use super::sheet::Marks;
use super::trajectory::Recording;
use super::{KnownPose, Model, Settings, Source, StoredTrajectory};
use crate::settings::{self, Group, Member, Visitor};

/// What an earlier session has left unsaved beside its settings and poses.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Leftover {
    /// Measurements and texts.
    pub marks: Marks,
    /// The trajectory that was recorded.
    pub recording: Option<Recording>,
}

impl Leftover {
    /// What of a session is in no file; `marks` are those of no saved image.
    pub fn of(model: &Model, marks: Marks, now: Instant) -> Self {
        let under_way = model.trajectory.recorder.clone().map(|recorder| recorder.finish(now));
        let ended = model.unsaved_trajectory().and_then(|stored| stored.unsaved.clone());
        Self { marks, recording: under_way.or(ended) }
    }
}

impl Model {
    /// Takes over what `old`, the session before the scene was read again, has that the file does not say: changes
    /// that are not saved, the probe's pose, time, views and marks. Where the probe was at the file's pose, it goes to
    /// the one that the file has now.
    pub fn resume(&mut self, old: &Self) {
        self.settings = self.loaded.clone();
        self.settings
            .carry(&old.loaded, &old.settings, |a, b| old.meshes[a].name == self.meshes[b].name);
        if old.pose != old.home {
            self.pose = old.pose;
        }
        if old.has_other_poses() {
            self.poses.clone_from(&old.poses);
            let filed = |name: &String| self.filed_poses.iter().any(|pose| pose.name == *name);
            for known in &mut self.poses {
                known.filed_as = known.filed_as.take().filter(filed);
            }
        }
        self.devices = old.devices;
        self.trajectory.clone_from(&old.trajectory);
        (self.clock, self.frozen) = (old.clock, old.frozen);
        self.real = old.real;
        self.layer = old.layer;
        self.colour = old.colour;
        self.view3d.resume(&old.view3d);
        if let (Some(hold), Some(before)) = (&mut self.hold, &old.hold) {
            (hold.stays, hold.press) = (before.stays, before.press);
        }
        self.revision = old.revision + 1;
    }

    /// Takes over, at last, what cannot be in two sessions.
    pub fn succeed(&mut self, old: &mut Self) {
        self.resume(old);
        self.sheet = std::mem::take(&mut old.sheet);
        self.noted_marks = std::mem::take(&mut old.noted_marks);
        self.body = old.body;
        self.mmode = old.mmode.take();
        self.spectrum = old.spectrum.take();
        self.history = std::mem::take(&mut old.history);
        let names = |model: &Self| -> Vec<_> {
            let tissues = model.settings.tissues.iter().map(|tissue| tissue.name.clone());
            tissues.chain(model.meshes.iter().map(|mesh| mesh.name.clone())).collect()
        };
        if names(self) != names(old) {
            self.history.forget_settings();
        }
    }

    /// Takes over what an earlier session of the same scene has left unsaved: `from` is its state, `left` what no
    /// scene file holds. Undo takes it back. Returns false, without a change, where the anatomy is another.
    pub fn restore(&mut self, from: &Self, left: Leftover, now: Instant) -> bool {
        let names = |s: &Settings| -> Vec<_> { s.tissues.iter().map(|t| t.name.clone()).collect() };
        let (mine, theirs) = (&self.settings, &from.settings);
        let sizes = |s: &Settings| (s.surfaces.len(), s.fusion.is_some(), s.volume.is_some());
        if names(mine) != names(theirs) || sizes(mine) != sizes(theirs) {
            return false;
        }
        let before = self.settings.clone();
        self.settings = Settings { tracer: before.tracer, ..from.settings.clone() };
        self.history.end_gesture();
        self.note(&before, now);
        let filed = |name: &str| self.filed_poses.iter().any(|pose| pose.name == name);
        let known = |known: &KnownPose| KnownPose {
            filed_as: Some(known.pose.name.clone()).filter(|name| filed(name)),
            ..known.clone()
        };
        let poses: Vec<_> = from.poses.iter().map(known).collect();
        if poses != self.poses {
            self.set_poses(poses, now);
        }
        self.place_probe(Source::Keyboard, from.home, now);
        if left.marks != Marks::default() {
            self.sheet.put(left.marks);
            self.note_marks(now);
        }
        if let Some(recording) = left.recording {
            self.keep_trajectory(StoredTrajectory::recorded(recording), now);
        }
        true
    }
}

/// Puts what differs between `loaded` and `changed` into `out`, key by key.
fn carry<T: Group>(loaded: &T, changed: &T, out: &mut T) {
    for row in T::rows() {
        let value = (row.get)(changed);
        if (row.get)(loaded) != value {
            (row.set)(out, &value);
        }
    }
}

impl Settings {
    /// Makes the changes from `loaded` to `changed` in these settings of a scene that may have other tissues and
    /// meshes; `same` says whether a mesh there is the one here.
    fn carry(&mut self, loaded: &Self, changed: &Self, same: impl Fn(usize, usize) -> bool) {
        struct Carrying<'s>([&'s settings::Settings; 2], &'s mut settings::Settings);
        impl Visitor for Carrying<'_> {
            fn visit<T: Group>(&mut self, group: Member<T>) {
                let [loaded, changed] = self.0.map(group.of);
                carry(loaded, changed, (group.of_mut)(self.1));
            }
        }
        settings::Settings::each(&mut Carrying([loaded, changed], &mut self.imaged));
        carry(&loaded.live, &changed.live, &mut self.live);
        if let (Some(loaded), Some(changed), Some(own)) =
            (&loaded.fusion, &changed.fusion, &mut self.fusion)
        {
            carry(loaded, changed, own);
        }
        if let (Some(loaded), Some(changed), Some(own)) =
            (&loaded.volume, &changed.volume, &mut self.volume)
        {
            carry(loaded, changed, own);
            if loaded.world_from_lps != changed.world_from_lps {
                own.world_from_lps = changed.world_from_lps;
            }
        }
        if loaded.model != changed.model {
            self.model = changed.model;
        }
        self.tracer = changed.tracer;
        for (loaded, changed) in loaded.tissues.iter().zip(&changed.tissues) {
            if let Some(own) = self.tissues.iter_mut().find(|own| own.name == changed.name) {
                carry(loaded, changed, own);
            }
        }
        for mesh in 0..changed.surfaces.len() {
            let mut own = 0..self.surfaces.len();
            // Meshes of one animated file have one name, and one surface.
            let Some(here) = own.find(|own| same(mesh, *own)) else {
                continue;
            };
            for side in 0..2 {
                let (from, to) = (&loaded.surfaces[mesh][side], &changed.surfaces[mesh][side]);
                carry(from, to, &mut self.surfaces[here][side]);
            }
            let new = changed.strategies[mesh];
            if loaded.strategies[mesh] != new && self.strategies[here].is_some() && new.is_some() {
                self.strategies[here] = new;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::time::Instant;

    use super::super::{Axis, File};
    use super::*;
    use crate::scene::Scene;
    use crate::sim::Tracer;

    const TEXT: &str = "[probe]\npreset = \"linear\"\n[[pose]]\nname = \"a\"\n[[mesh]]\nname = \"ball\"\n\
        shape = { sphere = { radius = 5 } }\ntissue = \"liver\"\n[tissues.liver]\nechogenicity = -9\n";

    fn of(path: &Path, text: &str) -> Model {
        std::fs::write(path, text).expect("written");
        let (scene, _) = Scene::load(path, &[]).expect("sound");
        let file = File::new(path.to_owned(), Vec::new(), &scene);
        Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now())
    }

    fn change(model: &mut Model, now: Instant) {
        let before = model.settings.clone();
        model.settings.probe.depth = 77.0;
        model.settings.surfaces[0][0].roughness += 0.25;
        model.note(&before, now);
    }

    #[test]
    fn a_scene_read_again_keeps_pose_time_and_changes_and_takes_what_the_file_says_now() {
        let (folder, now) = (tempfile::tempdir().expect("a folder"), Instant::now());
        let path = folder.path().join("scene.toml");
        let mut old = of(&path, TEXT);
        let liver = |m: &Model| m.settings.tissues.iter().position(|t| t.name == "liver").unwrap();
        change(&mut old, now);
        let more = "[imaging]\ngain = 3\n[[mesh]]\nname = \"first\"\npriority = 2\n\
            shape = { sphere = { radius = 2 } }\ntissue = \"bile\"\n";
        let edited = TEXT.replace("[[mesh]]", &format!("{more}[[mesh]]")).replace("-9", "6");
        let edited = edited.replace("[[pose]]", "[probe.pose]\nposition = [4, 0, 0]\n[[pose]]");
        // At the file's pose, the probe goes to the file's new one.
        let mut new = of(&path, &edited);
        new.resume(&old);
        assert_eq!(new.pose.translation.x, 4.0);
        old.move_probe(Axis::Lateral, 9.0, now);
        old.add_pose("b", now);
        old.view3d.camera.zoom(3.0);
        let pose = old.pose;
        let mut new = of(&path, &edited);
        new.succeed(&mut old);
        assert_eq!((new.pose, new.settings.probe.depth), (pose, 77.0));
        assert_eq!(
            (new.settings.imaging.gain, new.settings.tissues[liver(&new)].echogenicity),
            (3.0, 6.0)
        );
        assert_eq!(new.view3d.camera, old.view3d.camera);
        assert_eq!(new.poses().len(), 2);
        let rough = |m: &Model, i: usize| {
            m.settings.surfaces[i][0].roughness - m.loaded.surfaces[i][0].roughness
        };
        assert_eq!((rough(&new, 0), rough(&new, 1)), (0.0, 0.25));
        // Undo goes on with the probe and the poses; settings of another anatomy are forgotten.
        (0..9).for_each(|_| new.undo(now));
        assert_eq!((new.pose.translation.x, new.poses().len()), (0.0, 1));
        assert_eq!(new.settings.probe.depth, 77.0);
    }

    #[test]
    fn what_a_session_has_left_is_taken_up_and_undone() {
        let (folder, now) = (tempfile::tempdir().expect("a folder"), Instant::now());
        let path = folder.path().join("scene.toml");
        let mut left = of(&path, TEXT);
        change(&mut left, now);
        left.move_probe(Axis::Lateral, 9.0, now);
        left.add_pose("b", now);
        left.record(now);
        left.move_probe(Axis::Rock, 0.1, now);
        let text =
            serde_json::to_string(&Leftover::of(&left, Marks::default(), now)).expect("written");
        let draft = folder.path().join("draft.toml");
        crate::scene::file::save(&path, &draft, &left.changes(true)).expect("saved");
        let text_of = std::fs::read_to_string(&draft).expect("there");
        let from = of(&draft, &text_of);
        let mut model = of(&path, TEXT);
        let again: Leftover = serde_json::from_str(&text).expect("read");
        assert!(model.restore(&from, again, now));
        assert_eq!(model.settings, left.settings);
        assert!(model.pose.abs_diff_eq(left.pose, 1e-4));
        assert_eq!(model.poses().len(), 2);
        assert!(model.unsaved_trajectory().is_some() && model.is_modified(false));
        (0..9).for_each(|_| model.undo(now));
        assert!(!model.is_modified(false) && model.unsaved_trajectory().is_none());
        let other = of(&path, &TEXT.replace("\"liver\"\n[", "\"fat\"\n["));
        let left = Leftover { marks: Marks::default(), recording: None };
        assert!(!model.restore(&other, left, now));
    }
}
