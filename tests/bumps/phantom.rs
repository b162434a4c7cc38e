//! A block with a bumpy top in a background, and how scenes with it are made.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use insonify::probe::Probe;
use insonify::scene::mesh::Soup;
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Simulation, Surface, Tissue};
use insonify::scene::{normals, topology};
use insonify::settings::{Imaging, Refraction};

/// Numbers uniform in 0..1.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        // Steele, Lea, Flood 2014.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// Bumps of a deviation between two wavelengths, mm: waves of random direction.
pub fn bumps([rms, shortest, longest]: [f64; 3], seed: u64) -> impl Fn(DVec2) -> f64 {
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
pub fn block(height: impl Fn(DVec2) -> f64) -> Mesh {
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

pub fn tissue(speed: f64, impedance: f64, echogenicity: f64) -> Tissue {
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
pub fn layers(probe: Probe, around: Tissue, inside: Tissue, block: Mesh) -> Scene {
    let mut scene = Scene::homogeneous(around, probe);
    scene.simulation = Simulation {
        paths: 1,
        max_reflections: 0,
        cell: Simulation::default_cell(scene.probe.frequency),
        ..Simulation::default()
    };
    scene.imaging =
        Imaging { noise: f64::NEG_INFINITY, tgc_attenuation: 0.0, ..Imaging::default() };
    scene.tissues.extend([inside.clone(), Tissue { echogenicity: f64::NEG_INFINITY, ..inside }]);
    place(&mut scene, block, 1, DAffine3::IDENTITY);
    scene
}

/// Placement of a cylinder along y through a place (x, z).
pub fn along_y([x, z]: [f64; 2]) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_rotation_x(FRAC_PI_2), DVec3::new(x, 0.0, z))
}

/// Adds a mesh that echoes nothing; a later tissue wins where two overlap.
pub fn place(scene: &mut Scene, mesh: Mesh, tissue: usize, at: DAffine3) {
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
    scene.meshes.push(mesh.into());
}

/// The scene with surfaces that refract so.
pub fn with(scene: &Scene, refraction: Refraction) -> Scene {
    let mut scene = scene.clone();
    scene.simulation.refraction = refraction;
    scene
}
