use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::*;
use crate::model::{File, Model, tests};
use crate::scene::{Display, Fusion};
use insonify_scene::volume::Voxels;

/// The tests' cyst of 5 mm as the mask, in a volume with levels x + 10 z of its own frame.
fn scene() -> Scene {
    let mut scene = tests::scene();
    let size = [21, 11, 31];
    let values = (0..size.iter().product()).map(|i: usize| {
        let (x, z) = (i % size[0], i / (size[0] * size[1]));
        x as f32 - 10.0 + 10.0 * (z as f32 - 15.0)
    });
    scene.volume = Some(Acquired {
        size,
        volumes: vec![Arc::new(Voxels::F32(values.collect()))],
        now: 0,
        sequence: None,
        world_from_voxel: DAffine3::from_translation(DVec3::new(-10.0, -5.0, -15.0)),
        world_from_lps: DAffine3::IDENTITY,
        black: -200.0,
        white: 200.0,
    });
    scene.fusion = Some(Fusion {
        masks: vec![0],
        surroundings: crate::settings::Surroundings::Volume,
        blur: 1,
        blend: crate::settings::Blend::Linear,
        mask_speed: crate::settings::MaskSpeed::Probe,
        background_shadows: false,
    });
    scene
}

fn model(now: Instant) -> Model {
    let scene = scene();
    let file = File::new("scene.toml".into(), Vec::new(), &scene);
    Model::new(&scene, file, crate::sim::Tracer::Bvh, 0.0, now)
}

/// Grey level of the volume at a point of the world.
fn grey(volume: &Acquired, world: DVec3) -> Option<f64> {
    volume.grey_at(volume.world_from_voxel.inverse().transform_point3(world))
}

/// Middle of the mask in the model, and the grey level of the volume at a place.
fn seen(model: &mut Model, at: DVec3) -> (DVec3, Option<f64>) {
    let mut registration = model.registration.take().expect("a volume");
    registration.follow(&model.settings, 0.0);
    registration.centre();
    let grey = registration.scene().volume.as_ref().and_then(|v| grey(v, at));
    let middle = registration.middle;
    model.registration = Some(registration);
    (middle, grey)
}

#[test]
fn grey_levels_are_trilinear_and_end_with_the_volume() {
    let volume = scene().volume.expect("one");
    // Linear in x and z, hence exact at any place.
    for (x, z) in [(0.0, 0.0), (3.25, -7.75), (-10.0, 15.0), (9.9, 0.5)] {
        let grey = grey(&volume, DVec3::new(x, 4.5, z)).expect("inside");
        assert!((grey - (x + 10.0 * z + 200.0) / 400.0).abs() < 1e-12, "{x} {z}");
    }
    // The last voxel reaches half a step farther.
    assert_eq!(
        grey(&volume, DVec3::new(10.4, 0.0, 0.0)),
        grey(&volume, DVec3::new(10.0, 0.0, 0.0))
    );
    assert_eq!(grey(&volume, DVec3::new(10.6, 0.0, 0.0)), None);
    assert_eq!(grey(&volume, DVec3::new(0.0, -5.6, 0.0)), None);
    let mut narrow = volume.clone();
    (narrow.black, narrow.white) = (10.0, -10.0);
    assert_eq!(grey(&narrow, DVec3::new(-10.0, 0.0, 0.0)), Some(1.0));
    assert_eq!(grey(&narrow, DVec3::new(5.0, 0.0, 0.0)), Some(0.25));
}

#[test]
fn a_slice_shows_the_volume_around_the_middle() {
    let mut registration = Registration::of(&scene()).expect("a volume");
    registration.middle = DVec3::new(1.0, 0.0, 2.0);
    let plane = Plane::ALL[0];
    let (size, pitch) = ([5, 3], 0.5);
    let levels = registration.slice(&plane, size, pitch);
    for (i, level) in levels.iter().enumerate() {
        let x = 1.0 + pitch * ((i % 5) as f64 - 2.0);
        let z = 2.0 + pitch * ((i / 5) as f64 - 1.0);
        let expected = (255.0 * (x + 10.0 * z + 200.0) / 400.0).round() as u8;
        assert_eq!(*level, Some(expected), "{i}");
    }
    registration.middle.y = 100.0;
    assert!(registration.slice(&plane, size, pitch).iter().all(Option::is_none));
}

#[test]
fn a_mesh_is_cut_into_a_closed_line() {
    let mut registration = Registration::of(&scene()).expect("a volume");
    registration.follow(&Settings::of(&scene(), crate::sim::Tracer::Bvh), 1.0);
    // At a quarter of its period the cyst is 8 mm aside.
    registration.middle = DVec3::new(8.0, 0.0, 3.0);
    for plane in Plane::ALL {
        let lines = registration.outlines(&plane, 50.0);
        assert_eq!(lines.len(), 1);
        let pieces = &lines[0].pieces;
        // From here a sphere of 5 mm around (0, 0, -3), made of facets.
        let off = if plane.name == "x y" { 3.0 } else { 0.0 };
        let (centre, radius) =
            ([0.0, if off == 0.0 { -3.0 } else { 0.0 }], f64::sqrt(25.0 - off * off));
        for end in pieces.iter().flatten() {
            let far = f64::hypot(end[0] - centre[0], end[1] - centre[1]);
            assert!((far / radius - 1.0).abs() < 0.05, "{} {end:?} {far}", plane.name);
        }
        // Every end belongs to two pieces.
        for end in pieces.iter().flatten() {
            let near = |other: &&[f64; 2]| {
                (other[0] - end[0]).abs() < 1e-9 && (other[1] - end[1]).abs() < 1e-9
            };
            let met = pieces.iter().flatten().filter(near).count();
            assert!(met >= 2, "{} {end:?}", plane.name);
        }
    }
    // Outside the shown part there are no lines.
    registration.middle = DVec3::new(80.0, 0.0, 0.0);
    assert!(registration.outlines(&Plane::ALL[0], 30.0).is_empty());
}

#[test]
fn volume_and_model_move_against_each_other_and_undo_takes_it_back() {
    let mut now = Instant::now();
    let mut model = model(now);
    let place = DVec3::new(2.0, 0.0, 1.0);
    let (home, grey) = seen(&mut model, place);
    let change = |model: &mut Model, now, how: &dyn Fn(&Registration, &mut Settings)| {
        let before = model.settings.clone();
        let registration = model.registration.clone().expect("a volume");
        how(&registration, &mut model.settings);
        model.note(&before, now);
    };
    // The volume: the content of the place is now 3 mm farther on.
    change(&mut model, now, &|r, s| r.shift(s, DVec3::new(0.0, 0.0, 3.0)));
    assert_eq!(seen(&mut model, place + 3.0 * DVec3::Z), (home, grey));
    now += Duration::from_secs(2);
    // About the planes' meeting point, which is the mask's middle.
    change(&mut model, now, &|r, s| r.turn(s, DVec3::Y, FRAC_PI_2));
    let turned = DVec3::new(4.0, 0.0, -2.0);
    let (middle, after) = seen(&mut model, home + turned);
    assert!((middle - home).length() < 1e-12);
    assert!((after.expect("inside") - grey.expect("inside")).abs() < 1e-12, "{after:?} {grey:?}");
    model.undo(now);
    assert_eq!(seen(&mut model, place + 3.0 * DVec3::Z).1, grey);
    model.undo(now);
    assert_eq!(seen(&mut model, place), (home, grey));
    assert_eq!(model.settings, model.loaded);
    // The model.
    model.registration.as_mut().expect("a volume").moves = Moves::Model;
    now += Duration::from_secs(2);
    change(&mut model, now, &|r, s| r.shift(s, DVec3::X));
    now += Duration::from_secs(2);
    change(&mut model, now, &|r, s| r.scale(s, 1.5));
    let (middle, after) = seen(&mut model, place);
    assert_eq!(after, grey);
    // It was shifted by 1 mm, and then scaled about its old place.
    assert!((middle - home - 1.5 * DVec3::X).length() < 1e-5, "{middle}");
    assert!((model.settings.model.matrix3.determinant() - 1.5f64.powi(3)).abs() < 1e-12);
    model.undo(now);
    model.undo(now);
    assert_eq!(model.settings, model.loaded);
}

#[test]
fn the_saved_file_has_the_settings() {
    let now = Instant::now();
    let mut model = model(now);
    let before = model.settings.clone();
    let registration = model.registration.clone().expect("a volume");
    registration.shift(&mut model.settings, DVec3::new(1.0, -2.5, 0.0));
    let volume = model.settings.volume.as_mut().expect("a volume");
    (volume.black, volume.white) = (-150.0, 90.5);
    model.settings.model = DAffine3::from_scale(DVec3::splat(1.25));
    model.note(&before, now);
    let entries = model.entries(&model.settings, None);
    let expected = [
        ("volume.translate", "[1, -2.5, 0]"),
        ("volume.black", "-150"),
        ("volume.white", "90.5"),
        ("model.scale", "1.25"),
    ];
    let found: Vec<_> = entries
        .iter()
        .map(|(path, value)| (path.as_str(), value.as_deref().expect("a value")))
        .collect();
    assert_eq!(found, expected);
    let display = Display {
        world_from_lps: DAffine3::from_translation(DVec3::new(1.0, -2.5, 0.0)),
        black: -150.0,
        white: 90.5,
    };
    assert_eq!(model.settings.volume, Some(display));
}
