//! The tasks of the scenes that ship: every target reaches its own task, and no view far from it does; what is to be
//! measured and shown can be.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use insonify::gpu::test_device;
use insonify::scene::Scene;
use insonify::scene::file::load_trajectory;
use insonify::scene::task::{Goal, Target, Task};
use insonify::sim::contact::{Coupling, Skins};
use insonify::sim::shaders::Library;
use insonify::sim::{Tracer, seen};
use insonify::teach::{Attempt, Path as Way, Score};

fn scenes() -> Vec<(PathBuf, Scene)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let all = ["abdomen", "artery", "carotid", "fetus", "heart", "phantom"];
    let load = |name: &str| {
        let path = folder.join(format!("{name}.toml"));
        let (scene, _) = Scene::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
        (path, scene)
    };
    all.into_iter().map(load).collect()
}

/// Held at a place for two seconds.
fn held(pose: DAffine3) -> Way {
    Way { times: vec![0.0, 2.0], poses: vec![pose; 2] }
}

fn score(scene: &Scene, task: &Task, attempt: &Attempt) -> Score {
    let mut skins = Skins::default();
    let mut touch = |pose: &DAffine3| {
        Coupling::at(scene, pose, &mut skins).map_or(1.0, |found| found.touch.share)
    };
    Score::of(scene, task, attempt, Some(&mut touch))
}

#[test]
fn there_are_ten_and_each_target_is_reached_from_itself_alone() {
    let mut count = 0;
    for (path, scene) in scenes() {
        assert!(!scene.tasks.is_empty(), "{}", path.display());
        for task in &scene.tasks {
            count += 1;
            assert!(!task.hints.is_empty(), "{}", task.name);
            let Goal::View(Target { world_from_probe: target, .. }) = task.goal else { continue };
            let at = |pose| {
                let attempt = Attempt { path: held(pose), ..Attempt::default() };
                score(&scene, task, &attempt)
            };
            let found = at(target);
            assert!(found.reached, "{}: {:?}", task.name, found.reasons);
            let start = task.start.expect("a view has a start beside it");
            assert!(!at(start).reached, "{}: it begins at its end", task.name);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let off = target * DAffine3::from_translation(20.0 * axis);
                assert!(!at(off).reached, "{}: 20 mm along {axis}", task.name);
                let off = target * DAffine3::from_axis_angle(axis, 25f64.to_radians());
                assert!(!at(off).reached, "{}: 25 degrees about {axis}", task.name);
            }
        }
    }
    assert!(count >= 10, "{count}");
}

#[test]
fn what_is_to_be_shown_is_seen_from_its_view_and_not_from_beside() {
    for (name, task, view) in [
        ("abdomen", "Find the gallbladder", "right intercostal"),
        ("heart", "All four chambers", "apical four-chamber"),
    ] {
        let (_, mut scene) =
            scenes().into_iter().find(|(p, _)| p.ends_with(format!("{name}.toml"))).expect(name);
        let task = scene.tasks.iter().find(|t| t.name == task).expect(task).clone();
        let Goal::Show(cover) = &task.goal else { panic!("{task:?}") };
        let there = scene.poses.iter().find(|pose| pose.name == view).expect(view).world_from_probe;
        let mut at = |pose: DAffine3| {
            scene.world_from_probe = pose;
            let device = test_device();
            let library = Library::embedded();
            let found = seen::areas(&device, &library, &scene, Tracer::Bvh, &cover.instances);
            let seen = Some(found.expect("a frame"));
            score(&scene, &task, &Attempt { path: held(pose), seen, ..Attempt::default() })
        };
        let found = at(there);
        assert!(found.reached, "{found:?}");
        let found = at(task.start.expect("one"));
        assert!(!found.reached, "{found:?}");
        assert_eq!(test_device().validation_messages(), Vec::<String>::new());
    }
}

#[test]
fn trajectories_are_scored_to_the_numbers_that_they_were_made_with() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("way.csv");
    let (_, scene) = scenes().into_iter().find(|(p, _)| p.ends_with("artery.toml")).expect("ships");
    // 30 mm along x in 1 s, a quarter turn about z in 1 s, back by both, 2 s at rest: into the target.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let text = format!(
        "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,30,0,0,1,0,0,0\n\
         2,30,0,0,{half},0,0,{half}\n3,30,0,0,1,0,0,0\n4,0,0,0,1,0,0,0\n6,0,0,0,1,0,0,0\n"
    );
    std::fs::write(&file, text).expect("written");
    let way = Way::of(&load_trajectory(&file).expect("sound"), &scene.world_from_probe);
    let found = score(&scene, &scene.tasks[0], &Attempt { path: way, ..Attempt::default() });
    assert!(found.reached, "{found:?}");
    let movement = found.movement;
    for (found, wanted) in
        [(movement.path_mm, 60.0), (movement.angle_deg, 180.0), (movement.seconds, 6.0)]
    {
        assert!((found - wanted).abs() < 1e-6, "{movement:?}");
    }
    assert_eq!(movement.peaks, 2);
}
