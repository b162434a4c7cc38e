use std::path::Path;
use std::time::Instant;

use super::{File, Model};
use crate::model::{Axis, Settings};
use crate::probe::Probe;
use crate::scene::Scene;
use crate::sim::Tracer;
use changes::{changes, values};

mod changes;

/// A scene file with everything that a setting can depend on: keys of a preset, a stated impedance, a
/// tissue on another one, shapes that one selector switches, surfaces with and without an inside.
const SCENE: &str = r#"
# Two cubes.
background = "liver"

[probe]
preset = "linear"
width = "40 mm" # wider

[tissues.soft]
based_on = "fat"
speed = "1500 m/s"
impedance = "1.38 MRayl"

[tissues."very soft"]
based_on = "soft"
density = 0.9

[fusion]
mask = ["still"]
surroundings = "none"

[[selector]]
name = "beat"
period = 1

[[mesh]]
name = "a.b"
parent = "beat"
tissue = "soft"
keyframes = ["cube.obj", "cube.obj"]

[[mesh]]
name = "other"
parent = "beat"
tissue = "fat"
keyframes = ["cube.obj", "cube.obj"]

[[mesh]]
name = "still"
file = "cube.obj"
tissue = "very soft"
inside = { roughness = 3 }
"#;

const CUBE: &str = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 0 0 10\nv 10 0 10\nv 10 10 10\n\
    v 0 10 10\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A folder with the scene.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
        let desk = Self { folder };
        desk.write("scene.toml", SCENE);
        desk
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("written");
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("there")
    }

    fn scene(&self, name: &str, overrides: &[(String, String)]) -> Scene {
        let loaded = Scene::load(&self.folder.path().join(name), overrides);
        loaded.unwrap_or_else(|e| panic!("{e}\n{}", self.text(name))).0
    }

    fn model(&self, overrides: &[(&str, &str)]) -> Model {
        let owned = |&(path, value): &(&str, &str)| (path.to_owned(), value.to_owned());
        let overrides: Vec<_> = overrides.iter().map(owned).collect();
        let scene = self.scene("scene.toml", &overrides);
        let file = File::new(self.folder.path().join("scene.toml"), overrides, &scene);
        Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now())
    }

    /// The settings that the saved file gives.
    fn saved(&self) -> Settings {
        Settings::of(&self.scene("scene.toml", &[]), Tracer::Bvh)
    }
}

/// Compares the saved settings with those of the session. Sources of changed tissues say that they have
/// been changed; cells have been multiplied by a frequency and a cube root and divided by them, each
/// rounded to 1.1e-16; all else has to be the same to the last bit.
fn hold(desk: &Desk, mut wanted: Settings, what: &str) {
    let mut found = desk.saved();
    for (wanted, found) in wanted.tissues.iter_mut().zip(&found.tissues) {
        if wanted.source != found.source {
            assert!(found.source.starts_with("changed by the scene file"), "{what}");
            wanted.source.clone_from(&found.source);
        }
    }
    let cells = (wanted.simulation.cell, found.simulation.cell);
    assert!((cells.0 / cells.1 - 1.0).abs() < 1e-14, "{what}: {cells:?}");
    found.simulation.cell = cells.0;
    assert!(found == wanted, "{what}\n{found:#?}\n{wanted:#?}\n{}", desk.text("scene.toml"));
}

#[test]
fn every_setting_is_saved_and_loaded() {
    for change in changes() {
        for seed in 0..4 {
            let desk = Desk::new();
            let mut model = desk.model(&[]);
            let before = model.settings.clone();
            (change.apply)(&mut model.settings, &mut values(seed));
            model.note(&before, Instant::now());
            let what = &change.path;
            model.save(None, false).unwrap_or_else(|e| panic!("{what}: {e}"));
            hold(&desk, model.settings.clone(), what);
            assert!(!model.is_modified(true));
        }
    }
}

#[test]
fn a_scene_file_that_was_deleted_while_it_was_open_is_written_again() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    let path = desk.folder.path().join("scene.toml");
    let change = |model: &mut Model, gain: f64| {
        let before = model.settings.clone();
        model.settings.imaging.gain = gain;
        model.note(&before, Instant::now());
    };
    change(&mut model, 3.0);
    std::fs::remove_file(&path).expect("there");
    model.save(None, false).expect("saved");
    hold(&desk, model.settings.clone(), "gone");
    // The text that was saved counts from now on, elsewhere too; and where nothing was changed.
    change(&mut model, 4.0);
    model.save(None, false).expect("saved");
    std::fs::remove_file(&path).expect("there");
    let other = desk.folder.path().join("other.toml");
    model.save(Some(&other), false).expect("saved");
    assert!(desk.text("other.toml").contains("\"4 dB\"") && !path.exists());
    std::fs::remove_file(&other).expect("there");
    model.save(None, false).expect("saved");
    assert!(desk.text("other.toml").contains("\"4 dB\""));
}

#[test]
fn all_settings_at_once_are_saved_and_loaded_again_and_again() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    for seed in 10..40 {
        let before = model.settings.clone();
        for (at, change) in (0..).zip(changes()) {
            // Every other one, so that earlier changes have to stay.
            if (seed + at) % 2 == 0 || change.path == "surroundings" {
                (change.apply)(&mut model.settings, &mut values(seed * 1000 + at));
            }
        }
        // A lattice far from the wavelength leaves the range of its key.
        model.settings.simulation.cell = 0.1;
        model.note(&before, Instant::now());
        model.save(None, false).expect("saved");
        hold(&desk, model.settings.clone(), &format!("round {seed}"));
    }
    assert!(desk.text("scene.toml").contains("# Two cubes."));
}

#[test]
fn a_setting_that_is_not_written_is_noticed() {
    let desk = Desk::new();
    let mut wanted = desk.saved();
    wanted.imaging.tgc_sliders[7] = 1e-9;
    let held = std::panic::catch_unwind(|| hold(&desk, wanted, "planted"));
    assert!(held.is_err());
}

#[test]
fn only_changed_settings_are_written() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.save(None, false).expect("saved");
    assert_eq!(desk.text("scene.toml"), SCENE, "nothing has changed");
    model.settings.imaging.gain = 7.5;
    model.settings.tracer = Tracer::RayQuery;
    assert!(model.is_modified(false));
    model.save(None, false).expect("saved");
    let expected = format!("{SCENE}\n[imaging]\ngain = \"7.5 dB\"\n");
    assert_eq!(desk.text("scene.toml"), expected);
    model.settings.tracer = Tracer::Bvh;
    assert!(!model.is_modified(false), "the tracer is no matter of the file");
}

#[test]
fn a_preset_is_written_as_one() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.settings.probe = Probe::abdominal();
    model.settings.simulation.cell = 1.05 / model.settings.probe.frequency;
    model.save(None, false).expect("saved");
    let text = desk.text("scene.toml");
    assert!(text.contains("preset = \"abdominal\"\n\n[tissues"), "{text}");
    hold(&desk, model.settings.clone(), "preset");
}

#[test]
fn counts_that_a_quality_chose_stay_out_of_the_file() {
    use crate::settings::{Machine, Quality};
    let desk = Desk::new();
    let mut scene = desk.scene("scene.toml", &[]);
    let file = File::new(desk.folder.path().join("scene.toml"), Vec::new(), &scene);
    scene.simulation.set_quality(Quality::Draft, Machine::Software);
    let mut model = Model::new(&scene, file, Tracer::Bvh, 0.0, Instant::now());
    // The lattice follows the wavelength, in the session and in the file.
    let before = model.settings.probe.frequency;
    model.settings.probe.frequency = 5.0;
    model.settings.simulation.cell *= before / 5.0;
    model.save(None, false).expect("saved");
    let text = desk.text("scene.toml");
    assert!(text.contains("frequency = \"5 MHz\"") && !text.contains("cell"), "{text}");
    assert_eq!(desk.saved().simulation.paths, 8);
    // A value set by hand stays.
    model.settings.simulation.cell = 0.3;
    model.settings.simulation.paths = 5;
    model.save(None, false).expect("saved");
    let saved = desk.saved().imaged.simulation;
    assert!((saved.cell - 0.3).abs() < 1e-15, "{}", saved.cell);
    assert_eq!(saved.paths, 5);
}

#[test]
fn settings_of_the_command_line_are_written() {
    let desk = Desk::new();
    let mut model = desk.model(&[("mesh.still.tissue", "fat"), ("imaging.gain", "3 dB")]);
    model.settings.imaging.dynamic_range = 70.0;
    model.save(None, false).expect("saved");
    hold(&desk, model.settings.clone(), "overrides");
    assert!(desk.text("scene.toml").contains("gain = \"3 dB\""));
}

#[test]
fn the_pose_is_written_where_it_is_wanted() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    let now = Instant::now();
    for (axis, amount) in [(Axis::Rock, 0.3), (Axis::Lateral, 12.3), (Axis::Rotate, -0.7)] {
        model.move_probe(axis, amount, now);
    }
    assert!(model.is_modified(true) && !model.is_modified(false));
    model.save(None, false).expect("saved");
    assert_eq!(desk.text("scene.toml"), SCENE);
    model.save(None, true).expect("saved");
    assert!(!model.is_modified(true));
    let found = desk.scene("scene.toml", &[]).world_from_probe;
    // Half a unit of the last digit written: 1e-4 mm, and 1e-7 of each of two axes.
    assert!(found.translation.distance(model.pose.translation) < 1e-4);
    assert!(found.matrix3.abs_diff_eq(model.pose.matrix3, 2e-7));
    assert_eq!(model.home, model.pose);
}

#[test]
fn a_file_that_cannot_be_written_changes_nothing() {
    let desk = Desk::new();
    let mut model = desk.model(&[]);
    model.settings.imaging.gain = 7.5;
    let nowhere = desk.folder.path().join("gone/scene.toml");
    let error = model.save(Some(&nowhere), false).expect_err("no folder");
    assert!(error.remedy.is_some(), "{error}");
    assert!(model.is_modified(false));
    assert_eq!(model.file.path, desk.folder.path().join("scene.toml"));
    // Another file becomes the session's.
    let copy = desk.folder.path().join("copy.toml");
    model.save(Some(&copy), false).expect("saved");
    assert_eq!((&model.file.path, model.is_modified(false)), (&copy, false));
    assert_eq!(desk.text("scene.toml"), SCENE);
    assert!(desk.text("copy.toml").contains("7.5 dB"));
}

#[test]
fn settings_of_another_file_are_taken_and_undone() {
    let desk = Desk::new();
    let now = Instant::now();
    let mut model = desk.model(&[]);
    let gain = |model: &mut Model, gain| {
        let before = model.settings.clone();
        model.settings.imaging.gain = gain;
        model.note(&before, now);
    };
    gain(&mut model, 1.0);
    let before = model.settings.clone();
    desk.write("other.toml", "[probe]\npreset = \"phased\"\n[probe.pose]\nposition = [9, 9, 9]\n");
    let pose = model.pose;
    model.load_settings(&desk.folder.path().join("other.toml"), now).expect("taken");
    assert_eq!(model.settings.probe, Probe::phased());
    assert_eq!((model.settings.imaging.gain, model.pose), (1.0, pose), "not spoken of");
    let cell = 1.05 / Probe::phased().frequency;
    assert!((model.settings.simulation.cell / cell - 1.0).abs() < 1e-14);
    gain(&mut model, 2.0);
    model.undo(now);
    assert_eq!(model.settings.imaging.gain, 1.0);
    model.undo(now);
    assert_eq!(model.settings, before, "one step, whatever came before at the same moment");

    desk.write("other.toml", "[imaging]\ngain = \"5 mm\"\n");
    let error = model.load_settings(Path::new(&desk.folder.path().join("other.toml")), now);
    let error = error.expect_err("no level");
    assert_eq!(error.line, 2);
    assert_eq!(model.settings, before);
}

/// What a file does not state follows its examination: another one, saved, must not move what was set since.
#[test]
fn another_examination_is_saved_with_what_was_set_since() {
    use crate::settings::{Exam, GreyMap};
    let folder = tempfile::tempdir().expect("a folder");
    let (path, now) = (folder.path().join("scene.toml"), Instant::now());
    let load = || {
        let (scene, _) = Scene::load(&path, &[]).expect("sound");
        Model::new(&scene, File::new(path.clone(), Vec::new(), &scene), Tracer::Bvh, 0.0, now)
    };
    let begun =
        ["", "[probe]\npreset = \"linear\"\n", "[imaging]\nexam = \"obstetric\"\ngain = 3\n"];
    for text in begun {
        for exam in [Exam::Cardiac, Exam::Vascular, Exam::General] {
            std::fs::write(&path, format!("name = \"a\"\n{text}")).expect("written");
            let mut model = load();
            exam.apply(&mut model.settings);
            // As they were before, or as they are by default: neither is what the examination has.
            model.settings.imaging.dynamic_range = model.loaded.imaging.dynamic_range;
            model.settings.imaging.grey_map = GreyMap::Linear;
            model.settings.probe.frequency = model.loaded.probe.frequency;
            model.save(None, false).expect("saved");
            let again = load();
            assert_eq!(again.settings.imaging, model.settings.imaging, "{exam}: {text}");
            assert_eq!(again.settings.probe, model.settings.probe, "{exam}: {text}");
        }
    }
}
