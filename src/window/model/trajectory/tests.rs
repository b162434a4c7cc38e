use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DAffine3, DQuat, DVec3};

use super::{Clock, ROWS, Recorder, Recording, Replay};
use crate::scene::file::load_trajectory;

fn after(began: Instant, ms: u64) -> Instant {
    began + Duration::from_millis(ms)
}

fn at(x: f64, angle: f64) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_rotation_z(angle), DVec3::X * x)
}

/// A recording with a movement every 40 ms: 1 s along x with a quarter turn about z.
fn moved(began: Instant) -> Recording {
    let mut recorder = Recorder::new(at(0.0, 0.0), 3.0, began);
    for i in 1..=25 {
        let part = f64::from(i) / 25.0;
        let pose = at(10.0 * part, FRAC_PI_2 * part);
        recorder.note("keyboard", pose, after(began, 40 * i as u64));
    }
    recorder.finish(after(began, 1000))
}

fn replay(recording: &Recording, with_scene: Option<f64>, looped: bool, now: Instant) -> Replay {
    let track = Arc::new(recording.track());
    Replay::new(track, &DAffine3::IDENTITY, with_scene, looped, now)
}

#[test]
fn a_file_gives_back_what_was_recorded_to_the_last_digit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("way.csv");
    let recording = moved(Instant::now());
    std::fs::write(&path, recording.text()).expect("written");
    let read = load_trajectory(&path).expect("its own format");
    assert_eq!(read, recording.track());
    let text = recording.text();
    assert!(text.contains("scene's time at the first row: 3 s"), "{text}");
    assert!(text.contains("# keyboard\n"), "{text}");
}

#[test]
fn names_of_devices_cannot_break_the_file() {
    let began = Instant::now();
    let mut recorder = Recorder::new(at(0.0, 0.0), 0.0, began);
    recorder.note("a\n1,2\r,x", at(1.0, 0.0), after(began, 50));
    let text = recorder.finish(after(began, 50)).text();
    assert!(text.contains("# a1,2,x\n"), "{text}");
    // Only two rows and the header are no comments.
    let rows = text.lines().filter(|line| !line.starts_with('#')).count();
    assert_eq!(rows, 3, "{text}");
}

#[test]
fn between_two_rows_the_probe_goes_straight_and_turns_along_the_great_circle() {
    let began = Instant::now();
    let mut recorder = Recorder::new(at(2.0, 0.0), 0.0, began);
    recorder.note("keyboard", at(6.0, FRAC_PI_2), after(began, 80));
    let replay = replay(&recorder.finish(after(began, 80)), None, false, began);
    let scene = Clock::new(0.0, false, began);
    // Half way in time: half the distance and half the angle; a quarter: a quarter.
    for (ms, x, angle) in [(40, 4.0, FRAC_PI_4), (20, 3.0, FRAC_PI_4 / 2.0)] {
        let pose = replay.pose(&scene, after(began, ms));
        assert!(pose.abs_diff_eq(at(x, angle), 1e-12), "{ms}: {pose}");
    }
}

#[test]
fn a_probe_that_stood_still_stands_still_again() {
    let began = Instant::now();
    let mut recorder = Recorder::new(at(0.0, 0.0), 0.0, began);
    recorder.note("keyboard", at(2.0, 0.0), after(began, 5000));
    let recording = recorder.finish(after(began, 8000));
    let replay = replay(&recording, None, false, began);
    let scene = Clock::new(0.0, false, began);
    let x = |ms| replay.pose(&scene, after(began, ms)).translation.x;
    assert_eq!([x(2500), x(4949), x(5000), x(7999)], [0.0, 0.0, 2.0, 2.0]);
    assert_eq!(replay.length(), 8.0);
}

#[test]
fn events_of_one_moment_leave_one_row_and_times_grow() {
    let began = Instant::now();
    let mut recorder = Recorder::new(at(0.0, 0.0), 0.0, began);
    for (ms, x) in [(0, 1.0), (0, 2.0), (30, 3.0), (30, 4.0), (30, 5.0)] {
        recorder.note("keyboard", at(x, 0.0), after(began, ms));
    }
    let track = recorder.finish(after(began, 30)).track();
    let times: Vec<f64> = track.translation.expect("positions").times().to_vec();
    assert!(times.windows(2).all(|w| w[0] < w[1]), "{times:?}");
    assert!(times.len() <= 4, "{times:?}");
}

#[test]
fn a_recording_ends_before_it_is_too_long_to_be_read() {
    let began = Instant::now();
    let mut recorder = Recorder::new(at(0.0, 0.0), 0.0, began);
    let mut ms = 0;
    while !recorder.is_full() {
        ms += 20;
        recorder.note("tracker", at(ms as f64, 0.0), after(began, ms));
        assert!(recorder.rows() <= ROWS);
    }
    recorder.note("tracker", at(-1.0, 0.0), after(began, ms + 20));
    let rows = recorder.finish(after(began, ms + 5000)).rows.len();
    assert!((ROWS - 3..=ROWS).contains(&rows), "{rows}");
}

#[test]
fn a_replay_keeps_the_recorded_pace_and_ends_or_begins_again() {
    let began = Instant::now();
    let recording = moved(began);
    let scene = Clock::new(0.0, false, began);
    let once = replay(&recording, None, false, began);
    let x = |replay: &Replay, ms| replay.pose(&scene, after(began, ms)).translation.x;
    assert!((x(&once, 500) - 5.0).abs() < 1e-9);
    assert_eq!(x(&once, 1500), 10.0, "it stays at its end");
    assert!(once.moves(&scene, after(began, 999)) && !once.is_over(&scene, after(began, 999)));
    assert!(!once.moves(&scene, after(began, 1000)) && once.is_over(&scene, after(began, 1000)));
    let looped = replay(&recording, None, true, began);
    assert!((x(&looped, 1500) - 5.0).abs() < 1e-9);
    assert!(looped.moves(&scene, after(began, 60_000)));
    // Frozen, it waits.
    let mut held = once.clone();
    held.hold(true, after(began, 300));
    assert!(!held.moves(&scene, after(began, 300)));
    held.hold(false, after(began, 900));
    assert!((x(&held, 1100) - 5.0).abs() < 1e-9);
}

#[test]
fn a_replay_by_the_scenes_time_goes_as_fast_as_that_and_stands_with_it() {
    let began = Instant::now();
    let recording = moved(began);
    let replay = replay(&recording, Some(3.0), false, began);
    let mut scene = Clock::new(3.0, true, began);
    scene.set_speed(0.5, began);
    let x = |scene: &Clock, ms| replay.pose(scene, after(began, ms)).translation.x;
    assert!((x(&scene, 1000) - 5.0).abs() < 1e-9);
    scene.play(false, after(began, 1000));
    assert!((x(&scene, 9000) - 5.0).abs() < 1e-9);
    assert!(!replay.moves(&scene, after(began, 9000)));
    scene.seek(3.9, after(began, 9000));
    assert!((x(&scene, 9000) - 9.0).abs() < 1e-9, "and goes where it is set");
}

#[test]
fn columns_that_a_file_lacks_are_those_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("way.csv");
    std::fs::write(&path, "time_s,qw,qx,qy,qz\n0,1,0,0,0\n1,0,0,0,1\n").expect("written");
    let track = Arc::new(load_trajectory(&path).expect("rotations"));
    let began = Instant::now();
    let home = at(7.0, 1.0);
    let replay = Replay::new(track, &home, None, false, began);
    let pose = replay.pose(&Clock::new(0.0, false, began), began);
    assert!(pose.abs_diff_eq(at(7.0, 0.0), 1e-12), "{pose}");
}
