use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3};

use super::super::tests::model;
use super::super::{Axis, Model, Source};

fn after(began: Instant, ms: u64) -> Instant {
    began + Duration::from_millis(ms)
}

/// A recorded second of sliding by 20 mm, with the probe home again; the time is then 2 s.
fn recorded(began: Instant) -> Model {
    let mut model = model(began);
    model.record(began);
    for i in 1..=50 {
        model.move_probe(Axis::Lateral, 0.4, after(began, 20 * i));
    }
    model.record(after(began, 1000));
    model.place_probe(Source::Keyboard, model.home, after(began, 1500));
    model
}

fn slid(model: &Model, pose: &DAffine3) -> f64 {
    (model.home.inverse() * *pose).translation.x
}

#[test]
fn a_replay_goes_where_was_recorded_and_leaves_the_probe_at_its_end() {
    let began = Instant::now();
    let mut model = recorded(began);
    model.replay(after(began, 2000));
    let order = model.order();
    for (ms, x) in [(2000, 0.0), (2500, 10.0), (2750, 15.0), (4000, 20.0)] {
        let found = slid(&model, &order.pose(after(began, ms)));
        assert!((found - x).abs() < 1e-9, "{ms}: {found}");
    }
    assert!(order.runs(after(began, 2999)));
    // The scene's time goes on, so that the order does not end with the replay.
    model.follow(after(began, 2500));
    assert!((slid(&model, &model.pose) - 10.0).abs() < 1e-9);
    assert_eq!(model.devices.holder(), Some(Source::Replay));
    let revision = model.revision();
    model.follow(after(began, 3100));
    assert!(model.trajectory.replay.is_none());
    assert!((slid(&model, &model.pose) - 20.0).abs() < 1e-9);
    assert_eq!(model.revision(), revision, "the simulation has seen to it by itself");
}

#[test]
fn a_key_takes_the_probe_where_the_replay_has_brought_it() {
    let began = Instant::now();
    let mut model = recorded(began);
    model.replay(after(began, 2000));
    model.move_probe(Axis::Lateral, 2.0, after(began, 2500));
    assert!(model.trajectory.replay.is_none());
    assert!((slid(&model, &model.pose) - 12.0).abs() < 1e-9);
    assert_eq!(model.devices.holder(), Some(Source::Keyboard));
    // Put to the place where it already is, the probe stops there too.
    model.replay(after(began, 3000));
    let revision = model.revision();
    model.place_probe(Source::Pointer, model.order().pose(after(began, 3500)), after(began, 3500));
    assert!(model.trajectory.replay.is_none() && model.revision() > revision);
}

#[test]
fn a_tracker_that_lies_still_leaves_the_replay_alone() {
    let began = Instant::now();
    let mut model = recorded(began);
    let tool = |x| DAffine3::from_translation(DVec3::X * x);
    model.track("Probe", tool(0.0), after(began, 1600));
    model.replay(after(began, 2000));
    model.track("Probe", tool(1.5), after(began, 2200));
    assert!(model.trajectory.replay.is_some());
    model.track("Probe", tool(3.0), after(began, 2300));
    assert!(model.trajectory.replay.is_none());
    assert_eq!(model.pose, tool(3.0));
}

#[test]
fn the_recording_names_the_device_that_moves_the_probe() {
    let began = Instant::now();
    let mut model = model(began);
    model.record(began);
    model.move_probe(Axis::Depth, 1.0, after(began, 10));
    model.track("Stylus", DAffine3::IDENTITY, after(began, 60));
    model.move_probe(Axis::Depth, 1.0, after(began, 90));
    model.record(after(began, 120));
    let stored = model.trajectory.stored.as_ref().expect("recorded");
    let text = stored.unsaved.as_ref().expect("not saved").text();
    let names: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("# ")).collect();
    assert_eq!(names[2..], ["keyboard", "Stylus", "keyboard"], "{text}");
}

#[test]
fn a_replay_by_the_scenes_time_begins_when_the_recording_did() {
    let began = Instant::now();
    let mut model = model(began);
    model.clock.seek(7.0, began);
    model.record(began);
    model.move_probe(Axis::Lateral, 5.0, after(began, 50));
    model.record(after(began, 500));
    model.trajectory.with_scene = true;
    model.replay(after(began, 3000));
    assert!((model.clock.at(after(began, 3000)) - 7.0).abs() < 1e-9);
    // It stands still with the scene, and goes on with it.
    model.clock.play(false, after(began, 3100));
    model.follow(after(began, 9000));
    assert!(model.trajectory.replay.is_some());
}

#[test]
fn a_replay_waits_for_the_first_picture() {
    let began = Instant::now();
    let mut model = recorded(began);
    let stored = model.trajectory.stored.take().expect("recorded");
    model.await_replay(stored, after(began, 2000));
    model.follow(after(began, 6000));
    assert!(slid(&model, &model.pose).abs() < 1e-9);
    model.begin_replay(after(began, 7000));
    model.follow(after(began, 7500));
    assert!((slid(&model, &model.pose) - 10.0).abs() < 1e-9);
}
