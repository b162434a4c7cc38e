//! The scenes that come with the program: sound, and holding what their default view should show.

use std::path::Path;

use glam::DVec3;
use insonify::scene::Scene;

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.toml"));
    let (scene, warnings) = Scene::load(&path, &[]).expect(name);
    assert!(warnings.is_empty(), "{name}: {warnings:?}");
    scene
}

/// Tissue at a point of the probe's space, mm: the highest priority among the meshes that a ray
/// to infinity leaves once more than it enters. Direct, in f64; shares nothing with the tracers.
fn tissue(scene: &Scene, point: [f64; 3]) -> &str {
    let from = scene.world_from_probe.transform_point3(point.into());
    // Along no axis and through no vertex.
    let along = DVec3::new(0.611, 0.357, -0.706);
    let inside = scene.instances.iter().filter(|instance| {
        let mesh = &scene.meshes[instance.mesh];
        let corner = |i: u32| {
            let p = mesh.positions[i as usize].map(f64::from);
            instance.world_from_object.transform_point3(p.into()) - from
        };
        let exits = mesh.triangles.iter().map(|t| {
            let [a, b, c] = t.map(corner);
            // Signed volumes with the ray: all of one sign where it passes inside.
            let sides = [(a, b), (b, c), (c, a)].map(|(p, q)| along.dot(p.cross(q)));
            let ahead = |normal: DVec3| a.dot(normal) / along.dot(normal) > 0.0;
            let normal = (b - a).cross(c - a);
            match sides {
                s if s.iter().all(|v| *v > 0.0) && ahead(normal) => 1,
                s if s.iter().all(|v| *v < 0.0) && ahead(normal) => -1,
                _ => 0,
            }
        });
        exits.sum::<i32>() != 0
    });
    let top = inside.max_by_key(|i| i.priority);
    &scene.tissues[top.map_or(scene.background, |i| i.tissue)].name
}

#[test]
fn the_abdomen_shows_its_organs_in_the_default_view() {
    let mut scene = shipped("abdomen");
    // Lateral, elevation and depth read off the section drawn by hand, each well inside.
    let view = [
        ([0.0, 0.0, -10.0], "gel"),
        ([0.0, 0.0, 10.0], "fat"),
        ([0.0, 0.0, 17.5], "muscle"),
        ([-44.0, 0.0, 20.0], "cortical_bone"),
        ([-11.0, 0.0, 47.0], "cyst_fluid"),
        ([-20.0, 0.0, 40.0], "liver"),
        ([-45.0, 0.0, 128.0], "liver"),
        ([-36.0, 0.0, 112.0], "tumour"),
        ([29.0, 0.0, 62.0], "bile"),
        ([67.0, 0.0, 80.0], "stool"),
        ([-15.0, 0.0, 118.0], "kidney"),
        ([25.0, 0.0, 115.0], "renal_sinus"),
        ([-98.0, 0.0, 85.0], "lung"),
    ];
    for (point, expected) in view {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    // The comparison sees priorities: a liver above its cyst hides it.
    for instance in &mut scene.instances {
        if instance.name == "liver" {
            instance.priority = 1000;
        }
    }
    assert_eq!(tissue(&scene, [-11.0, 0.0, 47.0]), "liver");
}

#[test]
fn the_face_of_the_abdomens_probe_touches_the_skin() {
    let scene = shipped("abdomen");
    for l in [0, 48, 95, 143, 191] {
        for e in 0..scene.probe.elevation_layers {
            let (origin, _) = scene.probe.ray(l, e);
            let at = tissue(&scene, origin.into());
            assert!(["gel", "skin"].contains(&at), "line {l}, layer {e}: {at}");
            let deeper = tissue(&scene, (origin + DVec3::Z * 10.0).into());
            assert_eq!(deeper, "fat", "line {l}, layer {e}");
        }
    }
}

#[test]
fn the_phantom_is_one_gel_with_contrast_in_it() {
    let scene = shipped("phantom");
    assert!(scene.wires.len() > 50);
    for (point, expected) in [
        ([0.0, 0.0, 0.5], "gel_050"),
        ([-60.0, 5.0, 65.0], "minus_9"),
        ([60.0, -5.0, 65.0], "plus_15"),
        ([-60.0, 0.0, 78.0], "anechoic"),
        ([-48.0, 0.0, 50.0], "anechoic"),
    ] {
        assert_eq!(tissue(&scene, point), expected, "at {point:?}");
    }
    let impedance = scene.tissues[0].impedance();
    // Equal to rounding: no interface may reflect.
    for tissue in &scene.tissues {
        assert!((tissue.impedance() / impedance - 1.0).abs() < 1e-12);
    }
}
