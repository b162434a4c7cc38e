use std::path::Path;
use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};

use super::{Axis, Clock, File, Model, Settings, Source, moved};
use crate::scene::Scene;
use crate::sim::Tracer;

pub(super) fn scene() -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    let text = r#"
        background = "liver"
        [probe]
        preset = "linear"
        [probe.pose]
        position = [10, 20, 30]
        direction = [0, 1, 0]
        [[transform]]
        name = "breathing"
        motion = { kind = "sine", period = "4 s", translate = ["8 mm", 0, 0] }
        [[mesh]]
        name = "cyst"
        parent = "breathing"
        shape = { sphere = { radius = "5 mm" } }
        tissue = "cyst_fluid"
    "#;
    std::fs::write(&file, text).unwrap();
    Scene::load(Path::new(&file), &[]).unwrap().0
}

pub(super) fn model(now: Instant) -> Model {
    let scene = scene();
    let file = File::new("scene.toml".into(), Vec::new(), &scene);
    Model::new(&scene, file, Tracer::Bvh, 0.0, now)
}

fn close(a: DVec3, b: DVec3) {
    assert!(a.distance(b) < 1e-12, "{a} {b}");
}

#[test]
fn the_probe_moves_in_its_own_axes() {
    let now = Instant::now();
    let mut model = model(now);
    let home = model.pose;
    model.move_probe(Axis::Depth, 3.0, now);
    close(model.pose.translation, DVec3::new(10.0, 23.0, 30.0));
    model.move_probe(Axis::Lateral, 2.0, now);
    close(model.pose.translation, DVec3::new(12.0, 23.0, 30.0));
    for (axis, fixed) in [(Axis::Rotate, DVec3::Z), (Axis::Rock, DVec3::Y), (Axis::Tilt, DVec3::X)]
    {
        let turned = moved(&home, axis, 0.3);
        close(turned.translation, home.translation);
        close(turned.transform_vector3(fixed), home.transform_vector3(fixed));
        let other = fixed.any_orthonormal_vector();
        let (a, b) = (turned.transform_vector3(other), home.transform_vector3(other));
        assert!((a.angle_between(b) - 0.3).abs() < 1e-12, "{axis:?}");
    }
    for axis in Axis::ALL {
        let back = moved(&moved(&home, axis, 0.7), axis, -0.7);
        assert!(back.abs_diff_eq(home, 1e-12), "{axis:?}");
    }
}

#[test]
fn many_steps_stay_rigid() {
    let mut pose = DAffine3::IDENTITY;
    for step in 0..10_000 {
        pose = moved(&pose, Axis::ALL[step % 6], 0.1);
    }
    let m = pose.matrix3;
    let error = m * m.transpose() - glam::DMat3::IDENTITY;
    assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-12));
}

#[test]
fn time_passes_while_it_plays_and_is_neither_held_nor_frozen() {
    let now = Instant::now();
    let later = |s: f64| now + Duration::from_secs_f64(s);
    let mut clock = Clock::new(1.0, true, now);
    assert_eq!(clock.at(later(2.0)), 3.0);
    clock.set_speed(0.5, later(2.0));
    assert_eq!(clock.at(later(4.0)), 4.0);
    clock.play(false, later(4.0));
    assert_eq!(clock.at(later(9.0)), 4.0);
    clock.play(true, later(10.0));
    clock.hold(true, later(12.0));
    assert_eq!(clock.at(later(20.0)), 5.0);
    clock.hold(false, later(20.0));
    assert_eq!(clock.at(later(22.0)), 6.0);
    clock.seek(0.25, later(22.0));
    assert_eq!(clock.at(later(22.0)), 0.25);

    let mut model = model(now);
    assert!(model.animated && model.clock.runs());
    model.freeze(true, later(1.0));
    assert!(!model.clock.runs() && model.clock.is_playing());
    model.freeze(false, later(5.0));
    assert_eq!(model.clock.at(later(6.0)), 2.0);
}

/// A volume that changes makes time pass as moving anatomy does; paused, there is nothing to do.
#[test]
fn time_passes_for_a_volume_that_changes() {
    let now = Instant::now();
    let folder = tempfile::tempdir().unwrap();
    let volume = "NDims = 4\nDimSize = 2 2 2 2\nElementSpacing = 1 1 1 0.5\n\
        ElementType = MET_UCHAR\nElementDataFile = LOCAL\n0123456789abcdef";
    std::fs::write(folder.path().join("two.mha"), volume).unwrap();
    let single = volume.replacen("4\nDimSize = 2 2 2 2", "3\nDimSize = 2 2 2", 1);
    let single = single.replacen("1 1 1 0.5", "1 1 1", 1);
    std::fs::write(folder.path().join("one.mha"), &single[..single.len() - 8]).unwrap();
    for (file, changes) in [("two.mha", true), ("one.mha", false)] {
        let text = format!(
            "[volume]\nfile = \"{file}\"\n[fusion]\nmask = [\"cyst\"]\n[[mesh]]\nname = \"cyst\"\n\
             shape = {{ sphere = {{ radius = 5 }} }}\ntissue = \"cyst_fluid\"\n"
        );
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, text).unwrap();
        let (scene, _) = Scene::load(&path, &[]).unwrap();
        let file = File::new(path, Vec::new(), &scene);
        let mut model = Model::new(&scene, file, Tracer::Bvh, 0.0, now);
        assert_eq!((model.animated, model.order().runs(now)), (changes, changes));
        model.clock.play(false, now);
        assert!(!model.order().runs(now));
    }
}

#[test]
fn settings_go_into_the_scene_and_come_back() {
    let mut scene = scene();
    let mut settings = Settings::of(&scene, Tracer::Bvh);
    settings.imaging.gain = 3.0;
    settings.probe.depth = 77.0;
    settings.tissues[1].speed = 1.6;
    settings.surfaces[0][1].gain = -6.0;
    settings.simulation.paths = 5;
    assert_ne!(settings, Settings::of(&scene, Tracer::Bvh));
    settings.apply(&mut scene);
    assert_eq!(settings, Settings::of(&scene, Tracer::Bvh));
}

#[test]
fn a_gesture_is_undone_at_once_and_can_be_done_again() {
    let now = Instant::now();
    let later = |ms| now + Duration::from_millis(ms);
    let mut model = model(now);
    let first = model.settings.clone();
    for (ms, gain) in [(0, 20.0), (50, 21.0), (100, 22.0), (5000, 30.0)] {
        let before = model.settings.clone();
        model.settings.imaging.gain = gain;
        model.note(&before, later(ms));
    }
    assert_eq!(model.undoable(), [true, false]);
    // Another setting is another change, however soon after.
    let before = model.settings.clone();
    model.settings.imaging.dynamic_range += 1.0;
    model.note(&before, later(5100));
    model.undo(later(5200));
    assert_eq!(model.settings, before);
    model.undo(later(6000));
    assert_eq!(model.settings.imaging.gain, 22.0);
    model.undo(later(6000));
    assert_eq!(model.settings, first);
    model.undo(later(6000));
    assert_eq!(model.settings, first, "there is nothing before");
    model.redo(later(6000));
    model.redo(later(6000));
    assert_eq!(model.settings.imaging.gain, 30.0);
    model.undo(later(7000));
    let before = model.settings.clone();
    model.settings.imaging.gain = 1.0;
    model.note(&before, later(8000));
    assert_eq!(model.undoable(), [true, false], "what was undone is gone");
}

#[test]
fn every_change_is_a_new_revision_and_nothing_else_is() {
    let now = Instant::now();
    let mut model = model(now);
    let mut last = model.revision();
    let mut changed = |model: &Model| {
        let is_new = model.revision() != last;
        last = model.revision();
        is_new
    };
    model.place_probe(Source::Keyboard, model.pose, now);
    let same = model.settings.clone();
    model.note(&same, now);
    model.undo(now);
    assert!(!changed(&model));
    model.move_probe(Axis::Rock, 0.1, now);
    assert!(changed(&model));
    model.freeze(true, now);
    assert!(changed(&model));
    let before = model.settings.clone();
    model.settings.imaging.gain += 1.0;
    model.note(&before, now);
    assert!(changed(&model));
    assert_eq!(model.order().revision, model.revision());
}

#[test]
fn marks_leave_an_image_that_goes_live_and_named_ones_stay_for_the_worksheet() {
    use super::calipers::CaliperKind;
    use super::sheet::Tool;
    let now = Instant::now();
    let mut model = model(now);
    let measure = |model: &mut Model, name: &str| {
        let moment = super::sheet::Moment { pose: model.pose, seconds: 0.0 };
        model.sheet.take(Some(Tool::Measure(CaliperKind::Distance)));
        // Away from the marks that are there, which the pointer would take.
        let depth = 10.0 * (1 + model.sheet.all().iter().count()) as f64;
        model.sheet.press(glam::dvec2(0.0, depth), 1.0, moment);
        model.sheet.release(glam::dvec2(30.0, depth), 1.0);
        model.sheet.set_text(model.sheet.marks().len() - 1, name.into());
        model.note_marks(now);
    };
    model.freeze(true, now);
    measure(&mut model, "BPD");
    measure(&mut model, "");
    model.freeze(false, now);
    model.note_marks(now);
    let counts = |model: &Model| [model.sheet.marks().len(), model.sheet.all().kept.len()];
    assert_eq!(counts(&model), [0, 1], "the image is clear, BPD is on the worksheet");
    model.undo(now);
    assert_eq!(counts(&model), [2, 0]);
    model.redo(now);
    // The next freeze adds to it, and what is removed comes back.
    model.freeze(true, now);
    measure(&mut model, "AC");
    assert_eq!(counts(&model), [1, 1]);
    model.sheet.strike(0);
    assert_eq!(counts(&model), [1, 0]);
    model.note_marks(now);
    model.undo(now);
    model.sheet.strike(1);
    assert_eq!(counts(&model), [0, 1]);
    model.note_marks(now);
    model.undo(now);
    model.sheet.clear();
    assert_eq!(counts(&model), [0, 1], "the bin clears the image alone");
    model.note_marks(now);
    model.undo(now);
    model.sheet.strike_all();
    assert_eq!(counts(&model), [0, 0]);
    model.note_marks(now);
    // Freezing again, and a live image that is told to stay live, take nothing away.
    measure(&mut model, "FL");
    model.freeze(true, now);
    assert_eq!(counts(&model), [1, 0]);
    model.freeze(false, now);
    measure(&mut model, "HL");
    model.freeze(false, now);
    assert_eq!(counts(&model), [1, 1]);
}

#[test]
fn in_an_examination_neither_home_nor_undo_leads_the_probe() {
    let now = Instant::now();
    let mut model = model(now);
    let home = model.pose;
    model.move_by(Source::Keyboard, Axis::Lateral, 5.0, now);
    let there = model.pose;
    assert_ne!(there, home);
    model.examined = true;
    model.undo(now);
    model.go_home(Source::Keyboard, now);
    assert_eq!(model.pose, there);
    model.examined = false;
    model.undo(now);
    assert_eq!(model.pose, home);
    model.examined = true;
    model.redo(now);
    assert_eq!(model.pose, home);
    // Where an attempt is under way that is none, the way home counts as help.
    model.examined = false;
    model.redo(now);
    model.looked_up = false;
    model.go_home(Source::Keyboard, now);
    assert!(model.pose == home && model.looked_up);
}
