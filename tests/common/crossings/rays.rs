//! Scenes and rays of the intersection tests.

use glam::{DAffine3, DQuat, DVec3};
use insonify::probe::Probe;
use insonify::scene::{Instance, Keyframes, Mesh, Scene, Tissue};

/// The same ray for the device and for the reference: single precision throughout.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    pub t_min: f32,
    pub t_max: f32,
    pub skip: Option<u32>,
}

impl Ray {
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        let single = |v: DVec3| v.as_vec3().into();
        Self {
            origin: single(origin),
            direction: single(direction),
            t_min: 0.0,
            t_max: 1e4,
            skip: None,
        }
    }

    pub fn origin(&self) -> DVec3 {
        DVec3::from(self.origin.map(f64::from))
    }

    pub fn direction(&self) -> DVec3 {
        DVec3::from(self.direction.map(f64::from))
    }
}

/// PCG32 (O'Neill 2014), so that every run traces the same rays.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 =
            old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}

/// A scene of placed meshes, whose other parts do not matter.
pub fn scene(placed: Vec<(Mesh, DAffine3)>) -> Scene {
    let tissue = Tissue::shipped("liver").expect("liver is shipped");
    let surface = tissue.surface;
    let (meshes, instances) = placed
        .into_iter()
        .enumerate()
        .map(|(i, (mesh, world_from_object))| {
            let instance = Instance {
                name: format!("{i}"),
                mesh: i,
                keyframes: Keyframes::default(),
                shown: true,
                tissue: 0,
                priority: i as i32,
                world_from_object,
                surface: [surface; 2],
            };
            (mesh.into(), instance)
        })
        .unzip();
    Scene { meshes, instances, ..Scene::homogeneous(tissue, Probe::abdominal()) }
}

/// A realistic rotation, stretch and shift: organs of 10 to 100 mm, up to 150 mm away.
pub fn placement(scale: DVec3, axis: DVec3, angle: f64, shift: DVec3) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        scale,
        DQuat::from_axis_angle(axis.normalize(), angle),
        shift,
    )
}

/// A placement turned about a slanted axis and stretched differently along each of its own.
pub fn turned() -> DAffine3 {
    placement(
        DVec3::new(1.0, 0.4, 2.0),
        DVec3::new(1.0, 2.0, 3.0),
        1.1,
        DVec3::new(30.0, -20.0, 90.0),
    )
}

/// Mirrored, stretched and turned.
pub fn mirrored() -> DAffine3 {
    placement(DVec3::new(-1.5, 1.0, 1.0), DVec3::Y, 0.7, DVec3::new(-40.0, 10.0, 50.0))
}

/// The mesh with its placement applied to the vertices. Normals keep the length that the placement gives
/// them, so that both interpolate alike.
pub fn baked(mesh: &Mesh, world_from_object: &DAffine3) -> Mesh {
    let normal = world_from_object.matrix3.inverse().transpose();
    let mut out = mesh.clone();
    for p in &mut out.positions {
        *p = world_from_object.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().into();
    }
    for n in &mut out.normals {
        *n = (normal * DVec3::from(n.map(f64::from))).as_vec3().into();
    }
    if world_from_object.matrix3.determinant() < 0.0 {
        out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    out
}

/// World positions of a triangle's corners.
pub fn corners(scene: &Scene, instance: usize, triangle: usize) -> [DVec3; 3] {
    let placed = &scene.instances[instance];
    let mesh = &scene.meshes[placed.mesh];
    mesh.triangles[triangle].map(|i| {
        placed
            .world_from_object
            .transform_point3(DVec3::from(mesh.positions[i as usize].map(f64::from)))
    })
}

/// Returns whether the i-th ray of [`rays`] aims at a vertex or an edge.
pub fn aimed_at_seams(i: usize) -> bool {
    i % 4 < 2
}

/// Rays from all around and from inside at hard places: besides arbitrary points, shared edges and
/// vertices, along axes, and grazing.
pub fn rays(scene: &Scene, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let triangles = |i: usize| scene.meshes[scene.instances[i].mesh].triangles.len();
    let seen: Vec<usize> = (0..scene.instances.len()).filter(|&i| triangles(i) > 0).collect();
    (0..count)
        .map(|i| {
            let instance = seen[random.below(seen.len())];
            let triangle = random.below(triangles(instance));
            let [a, b, c] = corners(scene, instance, triangle);
            let target = match i % 4 {
                0 => a,
                1 => a.lerp(b, random.unit()),
                _ => {
                    let (u, v) = (random.unit(), random.unit());
                    a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v)
                }
            };
            let distance = 1.0 + 150.0 * random.unit();
            let direction = match i % 3 {
                // Within a thousandth of tangential.
                0 if i % 2 == 0 => {
                    let n = (b - a).cross(c - a).normalize();
                    (n.cross(random.direction()) + n * (random.unit() - 0.5) * 2e-3).normalize()
                }
                1 => {
                    let mut d = DVec3::ZERO;
                    d[random.below(3)] = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
                    d
                }
                _ => random.direction(),
            };
            Ray::new(target - direction * distance, direction)
        })
        .collect()
}
