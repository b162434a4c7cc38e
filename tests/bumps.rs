//! Vessels behind bumpy surfaces, as segmentations have them: bumps smaller than the beam do not steer it.

#[path = "common/shared_data.rs"]
#[allow(dead_code, reason = "skips are told there")]
mod shared;

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use insonify::gpu::test_device;
use insonify::probe::{Kind, Probe};
use insonify::scene::mesh::Soup;
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Simulation, Surface, Tissue, Wire};
use insonify::scene::{normals, shapes, topology, triangle};
use insonify::settings::{Imaging, Refraction};
use insonify::sim::shaders::Library;
use insonify::sim::{Simulator, Tracer};
use rayon::prelude::*;
use serde_json::Value;

/// Depth of the bumpy surface, mm.
const TOP: f64 = 15.0;
/// Places (x, z) and radius of the vessels, which run along y, mm.
const VESSELS: [[f64; 3]; 5] =
    [[-16.0, 36.0, 3.5], [-7.0, 52.0, 4.0], [0.0, 30.0, 3.0], [8.0, 46.0, 4.0], [17.0, 34.0, 3.5]];
/// Places of the wires of the full-wave simulation, mm.
const WIRES: [[f64; 2]; 3] = [[-5.0, 26.0], [0.0, 34.0], [5.0, 40.0]];
/// Deviation of the bumps, mm, and between which wavelengths they lie.
const BUMPS: [[f64; 3]; 4] = [[0.3, 2.0, 3.0], [0.6, 3.0, 5.0], [1.2, 5.0, 8.0], [2.0, 7.0, 10.0]];
/// Poses of each.
const POSES: usize = 5;
/// Least share of what is dark without refraction.
const LEAST: f64 = 0.9;

/// Numbers uniform in 0..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        // Steele, Lea, Flood 2014.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Bumps of a deviation between two wavelengths, mm: waves of random direction.
fn bumps([rms, shortest, longest]: [f64; 3], seed: u64) -> impl Fn(DVec2) -> f64 {
    let mut random = Random(seed);
    let waves: Vec<(DVec2, f64)> = (0..32)
        .map(|_| {
            let (angle, length) = (random.within(0.0, TAU), random.within(shortest, longest));
            (DVec2::from_angle(angle) * TAU / length, random.within(0.0, TAU))
        })
        .collect();
    let amplitude = rms * (2.0 / waves.len() as f64).sqrt();
    move |p: DVec2| {
        let waves = waves.iter().map(|(k, phase)| (k.dot(p) + phase).sin());
        amplitude * waves.sum::<f64>()
    }
}

/// A block whose top, towards the probe, lies at a depth by place.
fn block(height: impl Fn(DVec2) -> f64) -> Mesh {
    let (half, edge, bottom) = (DVec2::new(60.0, 36.0), 0.5, 100.0);
    let [nx, ny] = [half.x, half.y].map(|h| (2.0 * h / edge) as u32);
    let mut soup = Soup::default();
    for (i, j) in (0..=nx).flat_map(|i| (0..=ny).map(move |j| (i, j))) {
        let p = DVec2::new(f64::from(i), f64::from(j)) * edge - half;
        soup.positions.push(p.extend(height(p)).as_vec3().to_array());
        if i < nx && j < ny {
            let (a, b) = (i * (ny + 1) + j, (i + 1) * (ny + 1) + j);
            soup.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }
    // Once around the top.
    let at = |i: u32, j: u32| i * (ny + 1) + j;
    let sides = [
        (0..nx).map(|i| at(i, 0)).collect::<Vec<_>>(),
        (0..ny).map(|j| at(nx, j)).collect(),
        (0..nx).map(|i| at(nx - i, ny)).collect(),
        (0..ny).map(|j| at(0, ny - j)).collect(),
    ];
    let rim = sides.concat();
    let first = soup.positions.len() as u32;
    for &v in &rim {
        let [x, y, _] = soup.positions[v as usize];
        soup.positions.push([x, y, bottom as f32]);
    }
    let hub = soup.positions.len() as u32;
    soup.positions.push([0.0, 0.0, bottom as f32]);
    let n = rim.len() as u32;
    for i in 0..n {
        let next = (i + 1) % n;
        let (a, b) = (rim[i as usize], rim[next as usize]);
        let (c, d) = (first + i, first + next);
        soup.triangles.extend([[a, b, d], [a, d, c], [c, d, hub]]);
    }
    assert!(topology::orient(Path::new("block"), &mut soup).iter().all(|i| !i.is_error()));
    // Creases as of a file.
    normals::shade(&soup, 40.0)
}

fn tissue(speed: f64, impedance: f64, echogenicity: f64) -> Tissue {
    Tissue {
        speed,
        density: impedance / speed,
        attenuation: 0.0,
        echogenicity,
        texture_depth: 0.0,
        ..Tissue::shipped("liver").expect("shipped")
    }
}

/// The block inside a background; the same tissue without scatterers is the third.
fn layers(probe: Probe, around: Tissue, inside: Tissue, block: Mesh) -> Scene {
    let mut scene = Scene {
        simulation: Simulation {
            paths: 1,
            max_reflections: 0,
            cell: Simulation::default_cell(probe.frequency),
            ..Simulation::default()
        },
        imaging: Imaging { noise: f64::NEG_INFINITY, tgc_attenuation: 0.0, ..Imaging::default() },
        ..Scene::homogeneous(around, probe)
    };
    scene.tissues.extend([inside.clone(), Tissue { echogenicity: f64::NEG_INFINITY, ..inside }]);
    place(&mut scene, block, 1, DAffine3::IDENTITY);
    scene
}

/// Adds a mesh that echoes nothing; a later tissue wins where two overlap.
fn place(scene: &mut Scene, mesh: Mesh, tissue: usize, at: DAffine3) {
    let silent = Surface {
        roughness: f64::INFINITY,
        thickness: 0.0,
        specularity: 1.0,
        gain: f64::NEG_INFINITY,
    };
    scene.instances.push(Instance {
        name: mesh.name.clone(),
        mesh: scene.meshes.len(),
        keyframes: Keyframes::default(),
        shown: true,
        tissue,
        priority: tissue as i32,
        world_from_object: at,
        surface: [silent; 2],
    });
    scene.meshes.push(mesh);
}

/// The block below fat, with vessels.
fn phantom(block: Mesh) -> Scene {
    let probe = Probe {
        kind: Kind::Linear { width: 48.0 },
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
        let along_y = DQuat::from_rotation_x(FRAC_PI_2);
        let at = DAffine3::from_rotation_translation(along_y, DVec3::new(x, 0.0, z));
        place(&mut scene, shapes::cylinder(radius, 66.0, 48), 2, at);
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

/// Of each sample the log image, averaged over 3 scanlines and 1.5 mm of depth.
fn smoothed(levels: &[f32], probe: &Probe) -> Vec<f64> {
    let samples = probe.samples as usize;
    let reach = (0.75 / probe.sample_pitch()).round() as usize;
    let lines: Vec<Vec<f64>> = (levels.chunks(samples))
        .map(|line| {
            let mut sums = vec![0.0; samples + 1];
            for (k, &v) in line.iter().enumerate() {
                sums[k + 1] = sums[k] + f64::from(v);
            }
            let mean = |k: usize| {
                let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(samples));
                (sums[to] - sums[from]) / (to - from) as f64
            };
            (0..samples).map(mean).collect()
        })
        .collect();
    let mean = |l: usize, k: usize| {
        let beside = l.saturating_sub(1)..=(l + 1).min(lines.len() - 1);
        let count = beside.clone().count() as f64;
        beside.map(|l| lines[l][k]).sum::<f64>() / count
    };
    (0..lines.len())
        .flat_map(|l| (0..samples).map(move |k| (l, k)))
        .map(|(l, k)| mean(l, k))
        .collect()
}

/// Whether each sample is 8 dB or more below the mean of those that are not in a lumen and within 4 mm of its depth.
fn dark(levels: &[f32], lumen: &[bool], scene: &Scene) -> Vec<bool> {
    let samples = scene.probe.samples as usize;
    let means = smoothed(levels, &scene.probe);
    let reach = (4.0 / scene.probe.sample_pitch()).round() as usize;
    let mut sums = vec![[0.0, 0.0]; samples + 1];
    for (i, &level) in means.iter().enumerate().filter(|(i, _)| !lumen[*i]) {
        let sum = &mut sums[i % samples + 1];
        *sum = [sum[0] + level, sum[1] + 1.0];
    }
    for k in 0..samples {
        sums[k + 1] = [sums[k + 1][0] + sums[k][0], sums[k + 1][1] + sums[k][1]];
    }
    let below = 8.0 / scene.imaging.dynamic_range;
    let limit = |k: usize| {
        let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(samples));
        (sums[to][0] - sums[from][0]) / (sums[to][1] - sums[from][1]) - below
    };
    let limits: Vec<f64> = (0..samples).map(limit).collect();
    means.iter().enumerate().map(|(i, &level)| level < limits[i % samples]).collect()
}

/// The scene with all sound at the probe's speed.
fn unrefracted(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for tissue in &mut scene.tissues {
        tissue.density *= tissue.speed / scene.probe.speed;
        tissue.speed = scene.probe.speed;
    }
    scene
}

fn with(scene: &Scene, refraction: Refraction) -> Scene {
    let mut scene = scene.clone();
    scene.simulation.refraction = refraction;
    scene
}

/// The log image of `scene` by a simulator that has its meshes.
fn levels(simulator: &mut Simulator, scene: &Scene) -> Vec<f32> {
    simulator.frame(scene, 0).expect("a frame");
    simulator.log_image().expect("an image")
}

fn share(dark: &[bool], lumen: &[bool]) -> f64 {
    let inside = lumen.iter().filter(|&&l| l).count();
    dark.iter().zip(lumen).filter(|&(&d, &l)| d && l).count() as f64 / inside as f64
}

/// Middles of what is dark about each vessel that lies well within the image, mm in the image plane.
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

/// Whether each of the `places` lies in a vessel.
fn in_vessels(places: &[DVec3], scene: &Scene) -> Vec<bool> {
    let inside = |p: &DVec3| {
        let p = scene.world_from_probe.transform_point3(*p);
        VESSELS.iter().any(|[x, z, radius]| (p.x - x).hypot(p.z - z) < *radius)
    };
    places.iter().map(inside).collect()
}

/// What of the vessels is dark over what is without refraction, pose by pose; and how far their middles lie from where
/// the smooth surface puts them: mean of the shifts, and their root mean square, mm.
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
    let tracers = [Tracer::Bvh, Tracer::RayQuery].into_iter().cycle();
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

/// Whether each sample lies in one of [`LUMINA`], straight along its scanline; and whether its neighbours 2.5 mm before
/// and behind it do, so that it is no vessel narrower than the resolution.
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
    if shared::shared_data().is_none() {
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

/// A wire as it is seen: place and depth, width at half of the envelope, mm; level, dB.
#[derive(Clone, Copy, Debug)]
struct Spot {
    lateral: f64,
    depth: f64,
    width: f64,
    level: f64,
}

/// The brightest spot about `at` (x, z).
fn spot(simulator: &mut Simulator, scene: &Scene, [x, z]: [f64; 2]) -> Spot {
    simulator.frame(scene, 0).expect("a frame");
    let iq = simulator.iq().expect("baseband");
    let samples = scene.probe.samples as usize;
    let pitch = scene.probe.sample_pitch();
    let near = ((z - 2.0) / pitch) as usize..((z + 2.0) / pitch) as usize;
    let brightest = |line: &[f32]| {
        let of = |k: usize| (f64::from(line[2 * k]).hypot(line[2 * k + 1].into()), k);
        near.clone().map(of).max_by(|a, b| a.0.total_cmp(&b.0)).expect("samples")
    };
    let profile: Vec<(f64, f64, usize)> = (iq.chunks(2 * samples).zip(0..))
        .map(|(line, l)| (scene.probe.ray(l, 0).0.x, brightest(line)))
        .filter(|(place, _)| (place - x).abs() < 3.0)
        .map(|(place, (value, k))| (place, value, k))
        .collect();
    let top = (1..profile.len() - 1).max_by(|&i, &j| profile[i].1.total_cmp(&profile[j].1));
    let top = top.expect("scanlines");
    let half = profile[top].1 / 2.0;
    let step = profile[1].0 - profile[0].0;
    let crossing = |ahead: bool| {
        let next = |i: usize| if ahead { i + 1 } else { i - 1 };
        let mut i = top;
        while profile[next(i)].1 > half {
            i = next(i);
        }
        let (a, b) = (profile[i], profile[next(i)]);
        a.0 + (a.1 - half) / (a.1 - b.1) * (b.0 - a.0)
    };
    let [a, b, c] = [top - 1, top, top + 1].map(|i| profile[i].1.ln());
    Spot {
        lateral: profile[top].0 + step * 0.5 * (a - c) / (a - 2.0 * b + c),
        depth: profile[top].2 as f64 * pitch,
        width: crossing(true) - crossing(false),
        level: 20.0 * profile[top].1.log10(),
    }
}

/// A full-wave simulation of the same wires behind the same bumps: `tests/bumps.json`.
#[test]
fn wires_behind_bumps_stand_as_in_a_full_wave_simulation() {
    let table: Value = serde_json::from_str(include_str!("bumps.json")).expect("JSON");
    let number = |v: &Value| v.as_f64().expect("a number");
    let waves: Vec<[f64; 3]> = (table["waves"].as_array().expect("a list").iter())
        .map(|w| ["length", "phase", "amplitude"].map(|key| number(&w[key])))
        .collect();
    let height = |x: f64| {
        waves.iter().map(|[length, phase, a]| a * (TAU * x / length + phase).sin()).sum::<f64>()
    };
    let probe = Probe {
        kind: Kind::Linear { width: 17.0 },
        scanlines: 136,
        elevation_layers: 1,
        samples: 2048,
        depth: 48.0,
        frequency: number(&table["frequency"]),
        bandwidth: number(&table["bandwidth"]),
        focus: number(&table["focus"]),
        f_number_transmit: number(&table["f_number"]),
        f_number_receive: number(&table["f_number"]),
        ..Probe::paper_table1()
    };
    let [around, inside] = [0, 1].map(|i| {
        let layer = &table["layers"][i];
        let speed = number(&layer["speed"]);
        tissue(speed, speed * number(&layer["density"]), f64::NEG_INFINITY)
    });
    let mut smooth: Vec<[Spot; 3]> = Vec::new();
    let (mut wrong, mut planted) = (Vec::new(), 0);
    for row in table["wires"].as_array().expect("a list") {
        let (rms, at) = (number(&row["rms"]), [0, 1].map(|i| number(&row["at"][i])));
        let block = block(|p| number(&table["top"]) + rms * height(p.x));
        let mut scene = layers(probe.clone(), around.clone(), inside.clone(), block);
        let ends = [[at[0], 0.0, at[1]]; 2];
        scene.wires.push(Wire { ends, spacing: 1.0, amplitude: 1.0 });
        let simulator = Simulator::new(&test_device(), &Library::embedded(), &scene, Tracer::Bvh);
        let mut simulator = simulator.expect("a simulator");
        let full = ["lateral", "depth", "width", "level"].map(|key| number(&row[key]));
        let full = Spot { lateral: full[0], depth: full[1], width: full[2], level: full[3] };
        let [beam, ray] = [Refraction::Beam, Refraction::Ray]
            .map(|refraction| spot(&mut simulator, &with(&scene, refraction), at));
        if rms == 0.0 {
            smooth.push([full, beam, ray]);
        }
        let first = smooth[WIRES.iter().position(|w| *w == at).expect("a wire")];
        // Level over that behind the smooth surface.
        let agree = |own: &Spot, reference: &Spot| {
            let gain = own.level - reference.level - (full.level - first[0].level);
            println!(
                "{rms} mm, {at:?}: lateral {:.3} depth {:.3} width {:.3} of {:.3}, level {:.2} of {:.2} dB",
                own.lateral - full.lateral,
                own.depth - full.depth,
                own.width,
                full.width,
                own.level - reference.level,
                full.level - first[0].level
            );
            (own.lateral - full.lateral).abs() < 0.3
                && (own.depth - full.depth).abs() < 0.3
                && (own.width / full.width - 1.0).abs() < 0.2
                && gain.abs() < 2.0
        };
        if !agree(&beam, &first[1]) {
            wrong.push(format!("{rms} mm, {at:?}"));
        }
        planted += u32::from(!agree(&ray, &first[2]));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("; "));
    assert!(planted > 0, "local normals agree");
}
