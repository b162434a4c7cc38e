use std::sync::Arc;

use glam::{DMat3, DQuat};

use super::*;
use crate::probe::Probe;
use crate::scene::{Keyframes, Tissue, shapes};

fn scene() -> Scene {
    let liver = Tissue::shipped("liver").expect("shipped");
    Scene::homogeneous(liver, Probe::paper_table1())
}

/// Adds `mesh` and, as its second keyframe, the same mesh moved by `displaced` in object space.
fn add(scene: &mut Scene, mesh: Mesh, at: DAffine3, displaced: impl Fn(DVec3) -> DVec3) {
    let mut moved = mesh.clone();
    for p in &mut moved.positions {
        let old = DVec3::from(p.map(f64::from));
        *p = (old + displaced(old)).as_vec3().to_array();
    }
    let first = scene.meshes.len();
    scene.meshes.extend([mesh, moved].map(Arc::new));
    scene.instances.push(Instance {
        name: "moving".into(),
        mesh: first,
        keyframes: Keyframes {
            meshes: vec![first, first + 1],
            blend: [(1, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)],
            group: Some(3),
            ..Keyframes::default()
        },
        shown: true,
        tissue: 0,
        priority: 0,
        world_from_object: at,
        surface: [scene.tissues[0].surface; 2],
    });
}

/// Present field of instance `i`, as the twins read it.
fn displacement(scene: &Scene, fields: &Fields, i: usize, p: DVec3) -> DVec3 {
    let at = fields.offset(scene, i);
    assert_ne!(at, NONE);
    insonify_tools::reference::field::Field::new(&fields.values, at).displacement(p)
}

/// Worst difference, mm, from `(map - 1) p` in texture space, inside a box and at its faces.
fn affine_error(map: DMat3, planted: DMat3) -> f64 {
    let mut scene = scene();
    let rotation = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(-1.1);
    let at = DAffine3::from_scale_rotation_translation(
        DVec3::splat(2.0),
        rotation,
        DVec3::new(5.0, -8.0, 40.0),
    );
    add(&mut scene, shapes::cuboid([20.0, 9.0, 14.0]), at, |p| planted * p - p);
    let fields = Fields::build(&scene);
    let mut worst = 0.0_f64;
    for i in 0..343 {
        let part =
            DVec3::new(f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49)) / 6.0 - 0.5;
        // Texture space is object space scaled by 2: the rest of the placement is rigid.
        let p = 2.0 * part * DVec3::new(20.0, 9.0, 14.0);
        let error = displacement(&scene, &fields, 0, p) - (map * p - p);
        worst = worst.max(error.length());
    }
    worst
}

// A box of twelve triangles: 1e-5 mm is the rounding of displacements of 10 mm to 32 bits.
#[test]
fn homogeneous_strain_and_rotation_are_exact() {
    let turn = DMat3::from_rotation_y(0.6);
    let strain = DMat3::from_diagonal(DVec3::new(0.8, 1.1, 1.2));
    for map in [turn, strain, turn * strain] {
        let error = affine_error(map, map);
        assert!(error < 1e-5, "{error}");
        assert!(affine_error(map, map * 1.0001) > 1e-4, "a strain of 1e-4 is caught");
    }
}

/// Worst and root mean square error, mm, of the field between two spheres of radius 10 and 18 mm, of
/// which the inner one becomes 2 mm smaller. Components of a radial displacement x f(r) are
/// harmonic where f = a + b / r^3.
fn shell_errors(grouped: bool) -> [f64; 2] {
    let mut scene = scene();
    let shrink = |p: DVec3| -0.2 * p;
    add(&mut scene, shapes::sphere(10.0, 3), DAffine3::IDENTITY, shrink);
    add(&mut scene, shapes::sphere(18.0, 4), DAffine3::IDENTITY, |_| DVec3::ZERO);
    // The outer sphere moves by a negligible amount: if it did not move, it would have no field.
    Arc::make_mut(&mut scene.meshes[3]).positions[0][0] += 1e-6;
    if !grouped {
        scene.instances[0].keyframes.group = None;
    }
    let fields = Fields::build(&scene);
    let (inner, outer) = (10.0_f64.powi(-3), 18.0_f64.powi(-3));
    let b = -0.2 / (inner - outer);
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0.0);
    for (i, direction) in shapes::sphere(1.0, 2).positions.into_iter().enumerate() {
        let r = 10.0 + 8.0 * (i % 9) as f64 / 8.0;
        let p = r * DVec3::from(direction.map(f64::from));
        let expected = p * b * (r.powi(-3) - outer);
        let error = displacement(&scene, &fields, 1, p).distance(expected);
        worst = worst.max(error);
        sum += error * error;
        count += 1.0;
    }
    [worst, (sum / count).sqrt()]
}

// Cells of 1.7 mm: where the strain jumps by 0.73, at the inner surface, nodes that are right leave
// jump times spacing over 4 = 0.31 mm in the middle of a cell through which the kink runs. Those are
// a quarter of the places looked at, and the root mean square of a hat is 1 / sqrt 3 of its height:
// 0.09 mm.
#[test]
fn a_wall_between_two_surfaces_is_harmonic() {
    let [worst, mean] = shell_errors(true);
    assert!(worst < 0.31 && mean < 0.09, "{worst} {mean}");
    let [worst, _] = shell_errors(false);
    assert!(worst > 0.5, "without the inner surface nothing moves: {worst}");
}

#[test]
fn offsets_follow_keyframes_strategies_and_settings() {
    let mut scene = scene();
    let cube = || shapes::cuboid([10.0; 3]);
    add(&mut scene, cube(), DAffine3::IDENTITY, |p| 0.1 * p);
    add(&mut scene, cube(), DAffine3::IDENTITY, |_| DVec3::ZERO);
    add(&mut scene, cube(), DAffine3::IDENTITY, |p| 0.2 * p);
    add(&mut scene, cube(), DAffine3::IDENTITY, |p| 0.1 * p);
    Arc::make_mut(&mut scene.meshes[5]).triangles.pop();
    scene.instances[3].keyframes.strategy = Strategy::Interpolate;
    let fields = Fields::build(&scene);
    let offsets = |scene: &Scene| [0, 1, 2, 3].map(|i| fields.offset(scene, i));
    let slots = fields.slots[0].expect("deforms");
    assert_eq!(offsets(&scene)[..3], [slots.stride, NONE, NONE], "rigid, or of another topology");
    let blended = fields.slots[3].expect("deforms");
    assert_eq!(offsets(&scene)[3], blended.first + 2 * blended.stride);
    assert_eq!(fields.blend(&scene, 0), None);
    let blend = fields.blend(&scene, 3).expect("between keyframes");
    assert_eq!(blend.sources[0], (blended.first + blended.stride + HEADER, 1.0));
    assert_eq!((blend.target + blend.count) as usize, fields.values.len());
    scene.instances[0].keyframes.blend[0].0 = 0;
    assert_eq!(offsets(&scene)[0], 0);
    scene.simulation.texture_space = TextureSpace::Object;
    assert_eq!(offsets(&scene), [NONE; 4]);
}
