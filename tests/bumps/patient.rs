//! The nested vessels of a patient's segmented liver.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use insonify::gpu::test_device;
use insonify::scene::{Instance, Scene, triangle};
use insonify::settings::Refraction;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use rayon::prelude::*;

use crate::bumps::lumen::{LEAST, dark, levels, share, unrefracted};
use crate::bumps::phantom::{Random, with};
use crate::common::shared_data;

/// Vessels, cysts and gallbladder of the patient's liver.
const LUMINA: [&str; 7] = [
    "gallbladder",
    "biliary tract",
    "hepatic veins",
    "portal vein",
    "gastric vein",
    "arteries",
    "cysts",
];

/// Distances at which a ray enters and leaves each instance, in order.
fn crossings(scene: &Scene, o: DVec3, d: DVec3) -> Vec<Vec<f64>> {
    let of = |instance: &Instance| {
        let object = instance.world_from_object.inverse();
        let (o, d) = (object.transform_point3(o), object.transform_vector3(d));
        let mesh = &scene.meshes[instance.mesh];
        let point = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
        let mut met: Vec<f64> = (mesh.triangles.iter())
            .filter_map(|t| triangle::crossing(t.map(point), o, d))
            .map(|[t, ..]| t)
            .filter(|t| *t > 0.0)
            .collect();
        met.sort_by(f64::total_cmp);
        // Through an edge two triangles are met.
        met.dedup_by(|a, b| *a - *b < 1e-6);
        met
    };
    scene.instances.iter().map(of).collect()
}

/// For each sample, true if it lies in one of [`LUMINA`], straight along its scanline, and its neighbours 2.5 mm
/// before and behind it do, too, so that it is no vessel narrower than the resolution.
fn in_lumina(scene: &Scene) -> Vec<bool> {
    let probe = &scene.probe;
    let samples = probe.samples as usize;
    let line = |l: u32| {
        let (o, d) = probe.ray(l, 0);
        let o = DVec3::new(o.x, 0.0, o.z);
        let [o, d] = [
            scene.world_from_probe.transform_point3(o),
            scene.world_from_probe.transform_vector3(d),
        ];
        let crossings = crossings(scene, o, d);
        let inside = |k: usize| {
            let t = k as f64 * probe.sample_pitch();
            // An odd number of crossings ahead of a point in a closed mesh.
            let around = (scene.instances.iter().zip(&crossings))
                .filter(|(_, met)| met.iter().filter(|&&m| m > t).count() % 2 == 1);
            let best = around.map(|(instance, _)| instance).max_by_key(|i| i.priority);
            best.is_some_and(|i| LUMINA.contains(&i.name.as_str()))
        };
        let inside: Vec<bool> = (0..samples).map(inside).collect();
        let reach = (2.5 / probe.sample_pitch()).round() as usize;
        let well =
            |k: usize| inside[k.saturating_sub(reach)..(k + reach).min(samples)].iter().all(|&i| i);
        (0..samples).map(well).collect::<Vec<bool>>()
    };
    (0..probe.scanlines).into_par_iter().flat_map_iter(line).collect()
}

/// The nested vessels of a segmented liver, from eight sides.
#[test]
fn vessels_of_a_patient_stay_whole() {
    if shared_data::shared_data().is_none() {
        return;
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/liver.toml");
    let settings = [
        ("probe.scanlines", "128"),
        ("probe.samples", "1024"),
        ("probe.elevation_layers", "3"),
        ("simulation.paths", "1"),
        ("simulation.max_reflections", "0"),
        ("imaging.noise", "-inf"),
    ];
    let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let (base, _) = Scene::load(&file, &settings).expect("the scene");
    let simulator = Simulator::new(&test_device(), &Library::embedded(), &base, Tracer::Bvh);
    let mut simulator = simulator.expect("a simulator");
    let mut random = Random(21);
    let mut sums = [0.0; 2];
    for pose in 0..8 {
        let mut scene = base.clone();
        let at = DVec3::new(random.within(-20.0, 20.0), random.within(-20.0, 20.0), 0.0);
        let [rock, tilt] = [(); 2].map(|()| random.within(-0.2, 0.2));
        scene.world_from_probe *= DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(rock) * DQuat::from_rotation_x(tilt),
            at,
        );
        let lumen = in_lumina(&scene);
        let straight = dark(&levels(&mut simulator, &unrefracted(&scene)), &lumen, &scene);
        let most = share(&straight, &lumen);
        let shares = [Refraction::Beam, Refraction::Ray].map(|refraction| {
            let image = levels(&mut simulator, &with(&scene, refraction));
            share(&dark(&image, &lumen, &scene), &lumen) / most
        });
        let count = lumen.iter().filter(|&&l| l).count();
        println!("{pose}: {count} samples, dark {most:.3}, of it {shares:.3?}");
        sums = [0, 1].map(|i| sums[i] + shares[i] / 8.0);
    }
    println!("beam {:.3}, ray {:.3}", sums[0], sums[1]);
    assert!(sums[0] >= LEAST);
}
