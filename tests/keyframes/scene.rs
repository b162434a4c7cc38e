//! Animations in scene files: placements, shapes and loops over the scene's time.

use std::path::Path;

use glam::{DAffine3, DVec3};
use insonify::scene::mesh::{Choice, Options, Units, load_animated};
use insonify::scene::{Scene, Strategy};

use crate::common::shared_data::shared_data;
use crate::keyframes::compare::ROUNDING;
use crate::keyframes::document::Document;
use crate::keyframes::made;
use crate::keyframes::pose::{Planted, Pose, apply};

/// Resting values of a file are read in single precision: four levels of four roundings each, at most
/// 200 mm away.
const CLOSE: f64 = 16.0 * ROUNDING * 200.0;

fn load(folder: &Path, text: &str) -> Scene {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).expect("written");
    Scene::load(&path, &[]).expect("sound").0
}

/// Largest distance of four points of the bar between their places by the file's nodes and by the scene's, over a
/// few periods.
fn off(scene: &mut Scene, pose: &Pose<'_>, file_time: impl Fn(f64) -> f64) -> f64 {
    let outer = DAffine3::from_translation(DVec3::new(0.0, 0.0, 50.0))
        * DAffine3::from_rotation_z(0.5)
        * DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
    let mut off = 0f64;
    for i in 0..40 {
        // No step of the scale falls on such a time.
        let t = 0.013 + f64::from(i) * 0.17;
        scene.set_time(t);
        let world = scene.instances[0].world_from_object;
        let global = pose.global(3, file_time(t));
        for point in [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            let stored = DVec3::from(apply(&global, &point)) * 10.0;
            let found = world.transform_point3(DVec3::from(point) * 10.0);
            off = off.max((found - outer.transform_point3(stored)).length());
        }
    }
    off
}

#[test]
fn nodes_of_a_file_become_transforms_below_those_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = made::written(folder.path(), &made::tree());
    let document = Document::open(&path);
    let pose = |planted| Pose { document: &document, animation: 1, planted };
    let file = path.file_name().expect("a name").to_string_lossy();
    let text = |more: &str| {
        format!(
            "[[transform]]\nname = \"outer\"\ntranslate = [0, 0, 50]\n\
             rotate = {{ axis = [0, 0, 1], angle = \"0.5 rad\" }}\n\
             [[mesh]]\nname = \"bar\"\nparent = \"outer\"\ntissue = \"liver\"\nfile = \"{file}\"\n\
             units = \"cm\"\nanimation = \"all\"\ntranslate = [1, 2, 3]\n{more}\n"
        )
    };
    // Keyframes from 0.5 to 2.5 s.
    let repeat = |t: f64| 0.5 + t % 2.0;
    let fro = |t: f64| 0.5 + (2.0 - (t % 4.0 - 2.0).abs());
    let once = |t: f64| 0.5 + t.min(2.0);
    let all: [(&str, &dyn Fn(f64) -> f64); 3] =
        [("", &repeat), ("loop = \"ping-pong\"", &fro), ("loop = \"once\"", &once)];
    for (more, file_time) in all {
        let mut scene = load(folder.path(), &text(more));
        assert_eq!(scene.instances.len(), 1);
        let found = off(&mut scene, &pose(None), file_time);
        assert!(found < CLOSE, "{more}: {found}");
        for planted in [Planted::Late, Planted::Unmoved] {
            let found = off(&mut scene, &pose(Some(planted)), file_time);
            assert!(found > 1.0, "{more} {planted:?}: {found}");
        }
    }
}

#[test]
fn a_skin_becomes_keyframes_at_their_times() {
    let Some(data) = shared_data() else { return };
    let fox = data.join("gltf-samples/bevy/assets/models/animated/Fox.glb");
    let options = Options { units: Units::named("mm"), ..Options::default() };
    let (animated, _) = load_animated(&fox, &options, Choice::Named("Walk")).expect("sound");
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "[[mesh]]\nname = \"fox\"\ntissue = \"muscle\"\nfile = {:?}\nunits = \"mm\"\n\
         animation = \"Walk\"\nstrategy = \"interpolate\"\n",
        fox.canonicalize().expect("there")
    );
    let mut scene = load(folder.path(), &text);
    let [mesh] = animated.meshes.as_slice() else {
        panic!("one mesh");
    };
    // The last keyframe ends the period, and the first one takes its place there.
    let last = mesh.times.len() - 1;
    for (k, (shape, time)) in mesh.shapes.iter().zip(&mesh.times).enumerate().take(last) {
        scene.set_time(time - animated.span.0);
        let [fox] = scene.instances.as_slice() else {
            panic!("one instance");
        };
        assert_eq!(fox.keyframes.strategy, Strategy::Interpolate);
        assert_eq!(fox.keyframes.nearest(), k);
        assert!((fox.keyframes.blend[0].1 - 1.0).abs() < 1e-6, "{k}");
        assert!(scene.meshes[fox.mesh].positions == shape.positions, "{k}");
    }
    let (a, b) = (mesh.times[3], mesh.times[4]);
    scene.set_time(a + 0.25 * (b - a) - animated.span.0);
    let [from, to, ..] = scene.instances[0].keyframes.blend;
    assert_eq!((from.0, to.0), (3, 4));
    assert!((from.1 - 0.75).abs() < 1e-6 && (to.1 - 0.25).abs() < 1e-6);
}

#[test]
fn surfaces_of_a_beating_heart_change_together() {
    let Some(data) = shared_data() else { return };
    let file = data.join("heart-4d-bivme/heart-4d-25frames-morph.glb");
    let file = file.canonicalize().expect("there");
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "[[mesh]]\nname = \"heart\"\ntissue = \"blood\"\nfile = {file:?}\nunits = \"mm\"\n\
         animation = true\ncap_openings = true\n"
    );
    let mut scene = load(folder.path(), &text);
    assert!(scene.instances.len() > 1, "{}", scene.instances.len());
    for t in [0.0, 0.3, 0.7] {
        scene.set_time(t);
        let first = scene.instances[0].keyframes.clone();
        for instance in &scene.instances {
            let keyframes = &instance.keyframes;
            assert_eq!(keyframes.meshes.len(), first.meshes.len());
            assert!(instance.name.starts_with("heart/"), "{}", instance.name);
            assert!(keyframes.group.is_some() && keyframes.group == first.group);
            assert_eq!(keyframes.blend, first.blend);
            assert!(scene.shares_topology(instance));
        }
    }
    assert_ne!(scene.instances[0].keyframes.nearest(), 0);
}
