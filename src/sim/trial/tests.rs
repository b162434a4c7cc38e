//! The trial on the device's ray query, and on results that are wrong.

use std::path::Path;
use std::sync::Arc;

use bytemuck::Zeroable;
use glam::DVec3;

use super::{RayHit, Trial, agree, id, tried};
use crate::gpu::test_device;
use crate::layout::NONE;
use crate::scene::flow::{Course, FlowShape};
use crate::scene::{Flow, Scene};
use crate::shaders::Library;
use crate::skip::{Lacking, skip};

fn hit(instance: u32, t: f32) -> RayHit {
    RayHit { instance, t, ..RayHit::zeroed() }
}

fn phantom() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/phantom.toml");
    Scene::load(&file, &[]).unwrap().0
}

#[test]
fn the_ray_query_finds_the_surfaces_of_a_scene() {
    let (device, library) = (test_device(), Library::embedded());
    if !device.supports_ray_query() {
        skip(Lacking::Tool, &format!("'{}' has no ray queries", device.name()));
        return;
    }
    let scene = phantom();
    let trial = Trial::run(&device, &library, &scene).unwrap();
    assert!(trial.rays > 3000, "{trial:?}");
    assert_eq!(device.validation_messages(), [""; 0]);
    // What flows meets the same surfaces.
    let mut flowing = scene.clone();
    let shape = FlowShape::Uniform(DVec3::X);
    flowing.flows = vec![Flow::new("flow".into(), 0, shape, 100.0, Course::Steady)];
    assert_eq!(Trial::run(&device, &library, &flowing).unwrap(), trial);
    let verdict = tried(&device, &library, &scene);
    assert_eq!(verdict.is_ok(), trial.passed(), "{trial:?}");
    if let Err(why) = verdict {
        // A fault of the driver, for which there is the trial.
        assert!(why.contains(&format!("on {} of {} rays", trial.different, trial.rays)), "{why}");
        skip(Lacking::Tool, &format!("the ray query of '{}' {why}", device.name()));
    }
}

#[test]
fn a_surface_that_is_missed_or_found_again_counts() {
    assert!(agree(&hit(NONE, 0.0), &hit(NONE, 7.0)));
    assert!(agree(&hit(2, 31.0), &hit(2, 31.0005)));
    assert!(agree(&hit(2, 31.0), &hit(5, 31.0005)), "they lie together");
    assert!(!agree(&hit(2, 31.0), &hit(NONE, 0.0)), "missed");
    assert!(!agree(&hit(2, 31.0), &hit(2, 0.0)), "the surface just left");
    assert!(!agree(&hit(2, 31.0), &hit(2, f32::NAN)));
    let trial = |different| Trial { rays: 10_000, different };
    assert!(trial(3).passed());
    assert!(!trial(4).passed());
}

#[test]
fn another_geometry_is_tried_again() {
    let library = Library::embedded();
    let mut scene = phantom();
    let before = id(&library, &scene);
    assert_eq!(id(&library, &scene), before);
    Arc::make_mut(&mut scene.meshes[0]).positions[0][1] += 1.0;
    assert_ne!(id(&library, &scene), before);
}
