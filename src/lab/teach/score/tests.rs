//! Attempts of which the score is known.

use glam::{DAffine3, DVec3};

use super::*;
use crate::probe::Probe;
use crate::scene::task::{Cover, Measurement, Question, Unit};
use crate::scene::tissue::table;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn scene() -> Scene {
    let water = table::shipped().iter().find(|t| t.name == "water").expect("ships").clone();
    Scene::homogeneous(water, Probe::linear())
}

fn task(goal: Goal) -> Task {
    Task { name: "t".to_owned(), text: "do".to_owned(), hints: Vec::new(), start: None, goal }
}

fn target() -> Target {
    Target {
        world_from_probe: DAffine3::from_translation(DVec3::new(40.0, 0.0, 0.0)),
        distance: 10.0,
        plane_angle: 10.0 * DEGREE,
        turn: 20.0 * DEGREE,
        hold: 1.0,
        contact: 0.5,
    }
}

/// 40 mm in 2 s to the target as seen from `off`, then `rest` seconds there.
fn attempt(off: DAffine3, rest: f64) -> Attempt {
    let end = target().world_from_probe * off;
    let start = DAffine3 { translation: end.translation - DVec3::X * 40.0, ..end };
    let path = Path { times: vec![0.0, 2.0, 2.0 + rest], poses: vec![start, end, end] };
    Attempt { path, ..Attempt::default() }
}

fn score(attempt: &Attempt, touch: Option<&mut Touch<'_>>) -> Score {
    Score::of(&scene(), &task(Goal::View(target())), attempt, touch)
}

#[test]
fn the_target_is_reached_and_held_and_its_numbers_are_exact() {
    let found = score(&attempt(DAffine3::IDENTITY, 1.0), None);
    assert!(found.reached, "{found:?}");
    assert!((found.movement.path_mm - 40.0).abs() < 1e-6, "{found:?}");
    assert!((found.movement.seconds - 3.0).abs() < 1e-6, "{found:?}");
    assert_eq!((found.distance_mm, found.contact), (Some(0.0), None));
    // 20 mm/s: the last 10 mm before the target are within, too.
    let short = score(&attempt(DAffine3::IDENTITY, 0.25), None);
    assert!((short.held_s.expect("a view") - 0.75).abs() < 1e-6, "{short:?}");
    assert!(!short.reached && short.reasons.len() == 1 && short.reasons[0].contains("held"));
}

#[test]
fn wrong_views_are_not_accepted_and_the_reason_is_said() {
    for (off, reason) in [
        (DAffine3::from_translation(DVec3::Y * 20.0), "20.0 mm beside"),
        (DAffine3::from_rotation_z(25.0 * DEGREE), "plane is 25.0"),
        (DAffine3::from_rotation_y(25.0 * DEGREE), "turned 25.0"),
        (DAffine3::from_rotation_z(180.0 * DEGREE), "exchanged"),
        (DAffine3::from_translation(DVec3::X * f64::NAN), "NaN"),
    ] {
        let found = score(&attempt(off, 1.0), None);
        assert!(!found.reached, "{reason}");
        assert!(found.reasons.iter().any(|r| r.contains(reason)), "{reason}: {:?}", found.reasons);
    }
    // As far off as is allowed, and a hair more.
    let off = |mm: f64| score(&attempt(DAffine3::from_translation(DVec3::Y * mm), 1.0), None);
    assert!(off(9.999).reached && !off(10.001).reached);
    let none = score(&Attempt::default(), None);
    assert!(!none.reached && none.reasons[0].contains("not recorded"));
}

#[test]
fn contact_is_the_mean_over_the_time_and_lost_contact_counts() {
    // Lifted at the target.
    let mut lifted = |pose: &DAffine3| if pose.translation.x < 39.0 { 1.0 } else { 0.25 };
    let found = score(&attempt(DAffine3::IDENTITY, 2.0), Some(&mut lifted));
    assert!(found.reasons.len() == 1 && found.reasons[0].contains("25 %"), "{:?}", found.reasons);
    assert!((found.contact.expect("looked at") - 0.625).abs() < 0.02, "{found:?}");
    let mut pressed = |_: &DAffine3| 0.5;
    assert!(score(&attempt(DAffine3::IDENTITY, 2.0), Some(&mut pressed)).reached);
}

#[test]
fn measurements_answers_and_structures_are_judged() {
    let mut scene = scene();
    let length = Measurement { value: 40.0, unit: Unit::Length, tolerance: 10.0 };
    let measured = |value: Option<f64>| {
        let attempt = Attempt { measured: value, ..Attempt::default() };
        Score::of(&scene, &task(Goal::Measure(length.clone())), &attempt, None)
    };
    assert!(measured(Some(43.9)).reached && !measured(Some(44.1)).reached);
    assert!(!measured(None).reached && !measured(Some(f64::NAN)).reached);
    assert!((measured(Some(36.0)).error_percent.expect("measured") + 10.0).abs() < 1e-9);

    let question = Question {
        choices: vec!["a".to_owned(), "b".to_owned()],
        answer: 1,
        explanation: String::new(),
    };
    let answered = |answer: Option<usize>| {
        let attempt = Attempt { answer, ..Attempt::default() };
        Score::of(&scene, &task(Goal::Question(question.clone())), &attempt, None)
    };
    assert!(answered(Some(1)).reached);
    assert!([None, Some(0), Some(7)].into_iter().all(|answer| !answered(answer).reached));

    scene.instances.push(crate::scene::Instance {
        name: "liver".to_owned(),
        mesh: 0,
        keyframes: crate::scene::Keyframes::default(),
        shown: true,
        tissue: 0,
        priority: 0,
        world_from_object: DAffine3::IDENTITY,
        surface: [scene.tissues[0].surface; 2],
    });
    let cover = Cover { instances: vec![0], area: 100.0, contact: 0.5 };
    let seen = |areas: Option<Vec<f64>>| {
        let attempt = Attempt { seen: areas, ..Attempt::default() };
        Score::of(&scene, &task(Goal::Show(cover.clone())), &attempt, None)
    };
    assert!(seen(Some(vec![100.0])).reached);
    assert!(!seen(Some(vec![99.0])).reached && !seen(None).reached);
    assert_eq!(seen(Some(vec![99.0])).seen, [("liver".to_owned(), 99.0)]);
}
