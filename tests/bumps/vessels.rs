//! Vessels in a phantom behind bumps of 0.3 to 2 mm.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use insonify::gpu::test_device;
use insonify::probe::{Probe, ProbeKind};
use insonify::scene::{Mesh, Scene, shapes};
use insonify::settings::Refraction;
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};

use crate::bumps::lumen::{LEAST, dark, levels, share, unrefracted};
use crate::bumps::phantom::{Random, along_y, block, bumps, layers, place, tissue, with};
use crate::common::tracers::tracers;

/// Depth of the bumpy surface, mm.
const TOP: f64 = 15.0;
/// Places (x, z) and radius of the vessels, which run along y, mm.
const VESSELS: [[f64; 3]; 5] =
    [[-16.0, 36.0, 3.5], [-7.0, 52.0, 4.0], [0.0, 30.0, 3.0], [8.0, 46.0, 4.0], [17.0, 34.0, 3.5]];
/// Deviation of the bumps, mm, and between which wavelengths they lie.
const BUMPS: [[f64; 3]; 4] = [[0.3, 2.0, 3.0], [0.6, 3.0, 5.0], [1.2, 5.0, 8.0], [2.0, 7.0, 10.0]];
/// Poses of each surface.
const POSES: usize = 5;

/// The block below fat, with vessels.
fn phantom(block: Mesh) -> Scene {
    let probe = Probe {
        kind: ProbeKind::Linear { width: 48.0 },
        scanlines: 96,
        elevation_layers: 1,
        samples: 1024,
        depth: 64.0,
        frequency: 5.0,
        focus: 40.0,
        aperture: 24.0,
        ..Probe::paper_table1()
    };
    let mut scene = layers(probe, tissue(1.49, 1.5, 0.0), tissue(1.58, 1.65, 0.0), block);
    for [x, z, radius] in VESSELS {
        place(&mut scene, shapes::cylinder(radius, 66.0, 48), 2, along_y([x, z]));
    }
    scene
}

/// Above the block, up to 6 degrees off its normal.
fn pose(random: &mut Random) -> DAffine3 {
    let at = DVec3::new(random.within(-5.0, 5.0), random.within(-8.0, 8.0), 0.0);
    let tilt = random.within(-6.0, 6.0).to_radians();
    let turn = random.within(-15.0, 15.0).to_radians();
    DAffine3::from_rotation_translation(
        DQuat::from_rotation_z(turn) * DQuat::from_rotation_y(tilt),
        at,
    )
}

/// Place of each sample in the image plane, straight along its scanline, probe space.
fn places(probe: &Probe) -> Vec<DVec3> {
    let rays = (0..probe.scanlines).map(|l| probe.ray(l, 0));
    let along = |(o, d): (DVec3, DVec3)| {
        (0..probe.samples).map(move |k| {
            let p = o + f64::from(k) * probe.sample_pitch() * d;
            DVec3::new(p.x, 0.0, p.z)
        })
    };
    rays.flat_map(along).collect()
}

/// Middle of the dark samples around each vessel that lies well within the image, mm in the image plane.
fn middles(dark: &[bool], places: &[DVec3], scene: &Scene) -> Vec<Option<DVec2>> {
    let probe_from_world = scene.world_from_probe.inverse();
    let direction = probe_from_world.transform_vector3(DVec3::Y);
    let middle = |&[x, z, radius]: &[f64; 3]| {
        let at = probe_from_world.transform_point3(DVec3::new(x, 0.0, z));
        let at = at - at.y / direction.y * direction;
        let near = |p: &DVec3| (*p - at).length() < radius + 2.5;
        if at.x.abs() > 22.0 - radius {
            return None;
        }
        let held = places.iter().zip(dark).filter(|(p, dark)| **dark && near(p));
        let (sum, count) =
            held.fold((DVec2::ZERO, 0.0), |(s, n), (p, _)| (s + DVec2::new(p.x, p.z), n + 1.0));
        Some(sum / count)
    };
    VESSELS.iter().map(middle).collect()
}

/// True for each of the `places` that lies in a vessel.
fn in_vessels(places: &[DVec3], scene: &Scene) -> Vec<bool> {
    let inside = |p: &DVec3| {
        let p = scene.world_from_probe.transform_point3(*p);
        VESSELS.iter().any(|[x, z, radius]| (p.x - x).hypot(p.z - z) < *radius)
    };
    places.iter().map(inside).collect()
}

/// Dark share of the vessels relative to that without refraction, for each pose; and the distances of their middles
/// from where the smooth surface puts them: mean of the shifts, and their root mean square, mm.
struct Seen {
    ratios: Vec<f64>,
    shift: DVec2,
    scatter: f64,
}

/// By the mean slope, and by the local one.
fn seen(size: [f64; 3], tracer: Tracer) -> [Seen; 2] {
    let mut random = Random(11);
    let bumps = bumps(size, 5);
    let rough = phantom(block(|p| TOP + bumps(p)));
    let smooth = with(&phantom(block(|_| TOP)), Refraction::Ray);
    let simulator = |scene| Simulator::new(&test_device(), &Library::embedded(), scene, tracer);
    let [mut on_rough, mut on_smooth] =
        [&rough, &smooth].map(|scene| simulator(scene).expect("a simulator"));
    let mut ratios = [Vec::new(), Vec::new()];
    let mut shifts = [Vec::new(), Vec::new()];
    for _ in 0..POSES {
        let world_from_probe = pose(&mut random);
        let [rough, smooth] =
            [&rough, &smooth].map(|scene| Scene { world_from_probe, ..scene.clone() });
        let places = places(&rough.probe);
        let lumen = in_vessels(&places, &rough);
        let straight = levels(&mut on_rough, &unrefracted(&rough));
        let most = share(&dark(&straight, &lumen, &rough), &lumen);
        let expected = dark(&levels(&mut on_smooth, &smooth), &lumen, &smooth);
        let expected = middles(&expected, &places, &smooth);
        for (i, refraction) in [Refraction::Beam, Refraction::Ray].into_iter().enumerate() {
            let image = levels(&mut on_rough, &with(&rough, refraction));
            let dark = dark(&image, &lumen, &rough);
            ratios[i].push(share(&dark, &lumen) / most);
            let got = middles(&dark, &places, &rough);
            let pairs = got.iter().zip(&expected);
            shifts[i].extend(pairs.filter_map(|(a, b)| Some((*a)? - (*b)?)));
        }
    }
    let mut all = ratios.into_iter().zip(shifts).map(|(ratios, shifts)| {
        let count = shifts.len() as f64;
        let square: f64 = shifts.iter().map(|s| s.length_squared()).sum();
        let sum: DVec2 = shifts.iter().sum();
        Seen { ratios, shift: sum / count, scatter: (square / count).sqrt() }
    });
    [(); 2].map(|()| all.next().expect("two"))
}

/// Share, shift and scatter over all poses: near those of no refraction and of the smooth surface.
fn is_sound(all: &[&Seen]) -> bool {
    let ratios = all.iter().flat_map(|seen| &seen.ratios);
    let mean = ratios.clone().sum::<f64>() / ratios.count() as f64;
    let shift = all.iter().map(|seen| seen.shift).sum::<DVec2>() / all.len() as f64;
    let square = all.iter().map(|seen| seen.scatter.powi(2)).sum::<f64>() / all.len() as f64;
    println!("dark {mean:.3}, shift {shift:.3} mm, scatter {:.3} mm", square.sqrt());
    // A tenth of the least radius for a single vessel.
    mean >= LEAST && shift.abs().max_element() < 0.1 && square.sqrt() < 0.3
}

/// Local normals are the planted error: they cut vessels off along scanlines.
#[test]
fn bumps_smaller_than_the_beam_do_not_tear_vessels() {
    let tracers = tracers(&test_device()).into_iter().cycle();
    let all: Vec<[Seen; 2]> = BUMPS.into_iter().zip(tracers).map(|(b, t)| seen(b, t)).collect();
    for ([rms, shortest, longest], [beam, ray]) in BUMPS.into_iter().zip(&all) {
        println!(
            "{rms} mm high, {shortest} to {longest} mm long: {:.2?} {:.2?}",
            beam.ratios, ray.ratios
        );
        assert!(is_sound(&[beam]), "bumps of {rms} mm");
    }
    assert!(is_sound(&all.iter().map(|[beam, _]| beam).collect::<Vec<_>>()));
    assert!(!is_sound(&all.iter().map(|[_, ray]| ray).collect::<Vec<_>>()), "local normals pass");
}
