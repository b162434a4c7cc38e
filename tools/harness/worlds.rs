//! Small worlds for the tracing kernels: ellipsoids and boxes, in the form of the device's buffers and of the
//! twins.

use glam::{DAffine3, DQuat, DVec3};

use super::inputs::Random;
use super::{Case, Input, Job};
use crate::reference::Owned;
use insonify::scene::smoothed::smoothed;
use insonify::scene::{Mesh, shapes};
use insonify::sim::bvh::{BvhInstance, MeshBvh, SceneBvh};
use insonify::sim::fields::{HEADER, padded};
use insonify::sim::layout::{FLOW_VECTORS, Frame, Instance, NONE, Surface, Tissue};
use insonify::sim::lobe::Lobes;
use insonify::sim::placement;

/// The tables and instances of one world.
#[derive(Default)]
pub struct Builder {
    meshes: Vec<Mesh>,
    placements: Vec<(usize, DAffine3)>,
    instances: Vec<Instance>,
    fields: Vec<[f32; 3]>,
}

impl Builder {
    /// Places a mesh that encloses `tissue`; its sides echo as surfaces 0 (outside) and 1.
    pub fn place(&mut self, mesh: Mesh, at: DAffine3, tissue: u32, priority: i32) {
        self.meshes.push(mesh);
        self.again(self.meshes.len() - 1, at, tissue, priority);
    }

    /// Places a mesh again.
    pub fn again(&mut self, mesh: usize, at: DAffine3, tissue: u32, priority: i32) {
        self.placements.push((mesh, at));
        self.instances.push(Instance {
            world_from_object: placement::matrix_rows(&at),
            object_from_world: placement::matrix_rows(&at.inverse()),
            texture_from_world: placement::matrix_rows(&placement::rigid(&at).inverse()),
            tissue,
            priority,
            surface_outside: 0,
            surface_inside: 1,
            field: NONE,
            ..Instance::default()
        });
    }

    /// Adds the row that stands for the couplant, in front of everything; its index.
    fn fill(&mut self, tissue: u32) -> u32 {
        let identity = placement::matrix_rows(&DAffine3::IDENTITY);
        self.instances.push(Instance {
            world_from_object: identity,
            object_from_world: identity,
            texture_from_world: identity,
            tissue,
            priority: -i32::MAX,
            slot: NONE,
            field: NONE,
            ..Instance::default()
        });
        self.instances.len() as u32 - 1
    }

    /// Makes instance `index` part of the fusion's mask.
    pub fn mask(&mut self, index: usize) {
        self.instances[index].masks = 1;
    }

    /// Displaces the tissue of the instance placed last from its reference shape: by
    /// up to 3 mm, strained by up to a quarter.
    fn deform(&mut self) {
        let (origin, spacing, size) = (DVec3::new(-20.0, -16.0, -14.0), 4.0, [11_u8, 9, 8]);
        let instance = self.instances.last_mut().expect("placed");
        instance.field = self.fields.len() as u32;
        let scale = DVec3::splat(f64::recip(spacing));
        let header = [origin, scale, DVec3::from(size.map(f64::from))];
        self.fields.extend(header.map(|v| v.as_vec3().to_array()));
        let along = |n: u8| (0..n).map(f64::from);
        for k in along(size[2]) {
            for j in along(size[1]) {
                for i in along(size[0]) {
                    let p = origin + spacing * DVec3::new(i, j, k);
                    let wave = DVec3::new((p.y / 7.0).sin(), (p.z / 9.0).cos(), (p.x / 8.0).sin());
                    let v = DVec3::new(0.05, -0.08, 0.04) * p + wave;
                    self.fields.push(v.as_vec3().to_array());
                }
            }
        }
    }

    /// Lets something flow in the instance placed last: two generations, which a parabola about its axis z has carried by up to 3
    /// mm forwards and by 2 mm backwards.
    fn flow(&mut self) {
        let (origin, spacing, size) = (DVec3::new(-6.0, -6.0, -30.0), 1.0, [13_u8, 13, 61]);
        let header = [origin, DVec3::splat(f64::recip(spacing)), DVec3::from(size.map(f64::from))];
        let header = header.map(|v| v.as_vec3().to_array());
        self.instances.last_mut().expect("placed").flow = self.fields.len() as u32;
        // Weight, number and way of each generation; pace, number and way of pulses.
        self.fields.extend([[0.8, 7.0, 3.0], [0.6, 8.0, -2.0], [900.0, 7.0, 3.0]]);
        self.fields.extend(header);
        let along = |n: u8| (0..n).map(f64::from);
        for _ in along(size[2]) {
            for j in along(size[1]) {
                for i in along(size[0]) {
                    let [x, y] = [origin.x + spacing * i, origin.y + spacing * j];
                    let share = f64::max(1.0 - (x * x + y * y) / 16.0, 0.0);
                    self.fields.push([0.0, 0.0, share as f32]);
                }
            }
        }
    }

    /// Displacement fields of the instances.
    pub fn field_input(&self) -> Input {
        Input::floats("fields", padded(&self.fields).as_flattened())
    }

    /// The six bindings instances, vertices, normals, smoothed, triangles, nodes.
    pub fn inputs(mut self) -> Vec<Input> {
        let trees: Vec<MeshBvh> = self.meshes.iter().map(MeshBvh::build).collect();
        let (mut vertices, mut normals) = (Vec::new(), Vec::new());
        let (mut triangles, mut firsts) = (Vec::new(), Vec::new());
        let mut averages = Vec::new();
        for (mesh, tree) in self.meshes.iter().zip(&trees) {
            let base = vertices.len() as u32;
            firsts.push(triangles.len() as u32);
            vertices.extend_from_slice(&mesh.positions);
            normals.extend_from_slice(&mesh.normals);
            averages.extend(smoothed(mesh, 1.0));
            let order = tree.triangle_order.iter();
            triangles.extend(order.map(|&t| mesh.triangles[t as usize].map(|v| base + v)));
        }
        let (mut nodes, roots) = SceneBvh::of(&trees, &firsts, self.placements.len());
        let places = self.placements.iter().zip(0..);
        let placed: Vec<BvhInstance> = places
            .map(|(&(mesh, world_from_object), instance)| BvhInstance {
                instance,
                bounds: trees[mesh].bounds,
                world_from_object,
                partial: false,
            })
            .collect();
        nodes.place(&placed, false).expect("a small world");
        for (i, &(mesh, _)) in self.placements.iter().enumerate() {
            let instance = &mut self.instances[i];
            instance.first_triangle = firsts[mesh];
            instance.triangles = self.meshes[mesh].triangles.len() as u32;
            instance.bvh_root = roots[mesh];
            instance.slot = nodes.slots[i];
            instance.finest = placement::stretch(&self.placements[i].1) as f32;
            let [low, high] = trees[mesh].bounds.map(|[x, y, z]| [x, y, z, 0.0]);
            (instance.low, instance.high) = (low, high);
        }
        vec![
            Input::words("instances", &self.instances),
            Input::floats("vertices", vertices.as_flattened()),
            Input::floats("normals", normals.as_flattened()),
            Input::words("smoothed", &averages),
            Input::words("triangles", &triangles),
            Input::words("nodes", &nodes.nodes),
        ]
    }
}

/// Tissues 0 (background), 1, 2, 3; contrasts from weak to bone-like.
pub fn tissues() -> Vec<Tissue> {
    let tissue = |speed, impedance, absorption, seed| Tissue {
        speed,
        impedance,
        absorption,
        presence: 0.7,
        mean: 0.1,
        sigma: 0.8,
        density: 0.4,
        amplitude: 0.9,
        texture_depth: 0.3,
        texture_length: 4.0,
        seed,
        ..Tissue::default()
    };
    vec![
        tissue(1.54, 1.63, 0.004, 11),
        tissue(1.57, 1.70, 0.006, 22),
        tissue(1.45, 1.38, 0.005, 33),
        tissue(3.2, 6.0, 0.06, 44),
    ]
}

/// Outside: rough, thick, partly coherent. Inside: mirror-like.
pub fn surfaces() -> Vec<Surface> {
    vec![
        Surface {
            roughness: 60.0,
            thickness: 0.2,
            specularity: 3.0,
            gain: 1.5,
            coherence: 0.6,
            lobe: Lobes::default().of(60.0, 3.0),
            ..Surface::default()
        },
        Surface {
            roughness: 1e9,
            thickness: 0.0,
            specularity: 1.0,
            gain: 0.7,
            coherence: 1.0,
            ..Surface::default()
        },
    ]
}

/// The couplant of [`world`]: an instance where all lines start outside, else NONE.
pub fn couplant(case: Case) -> u32 {
    match case {
        Case::One => 1,
        Case::Modes => 3,
        _ => NONE,
    }
}

/// A world in front of a probe that looks along z. Its poses are random, so that no ray of a case
/// is likely to run through an edge or along a surface.
pub fn world(case: Case) -> Builder {
    let mut random = Random(7);
    let mut builder = Builder::default();
    let mut pose = |x: f64, y: f64, z: f64| {
        let mut r = |s: f64| random.within(-s, s);
        let axis = DVec3::new(r(1.0), r(1.0), r(1.0)).normalize();
        let turn = DQuat::from_axis_angle(axis, r(3.0));
        DAffine3::from_rotation_translation(turn, DVec3::new(x + r(1.0), y + r(1.0), z + r(1.0)))
    };
    match case {
        Case::Empty => {}
        Case::Modes => {
            // Two boxes in one frame share a face exactly; a third encloses both.
            let at = pose(0.0, 0.0, 30.0);
            for (x, tissue) in [(-3.5, 1), (4.5, 2)] {
                let mut half = shapes::cuboid([if tissue == 1 { 7.0 } else { 9.0 }, 24.0, 11.0]);
                for p in &mut half.positions {
                    p[0] += x;
                }
                builder.place(half, at, tissue, 1);
            }
            builder.place(shapes::cuboid([40.0, 60.0, 36.0]), at, 3, 0);
        }
        Case::One => builder.place(shapes::sphere(9.0, 2), pose(0.0, 0.0, 25.0), 1, 0),
        _ => {
            // A body around the probe, with nested and overlapping organs and a bone.
            builder.place(shapes::ellipsoid([60.0, 40.0, 70.0], 3), pose(0.0, 0.0, 20.0), 1, 0);
            builder.place(shapes::ellipsoid([14.0, 11.0, 9.0], 2), pose(3.0, 0.0, 28.0), 2, 1);
            builder.deform();
            builder.place(shapes::sphere(5.0, 2), pose(2.0, 1.0, 27.0), 0, 2);
            builder.place(shapes::cuboid([9.0, 30.0, 6.0]), pose(-14.0, 0.0, 40.0), 3, 5);
            builder.place(shapes::cylinder(4.0, 50.3, 24), pose(12.0, 0.0, 33.0), 0, 1);
            builder.flow();
            // A second placement of the same mesh, scaled and mirrored.
            let mirrored = DAffine3::from_scale(DVec3::new(-1.4, 0.8, 1.1));
            builder.again(2, pose(16.0, 2.0, 47.0) * mirrored, 3, 2);
        }
    }
    if couplant(case) != NONE {
        assert_eq!(builder.fill(1), couplant(case), "behind the others");
    }
    builder
}

/// The world of the twins, from a job's bindings; arrays that the kernel does not bind are empty.
pub fn owned(job: &Job) -> Owned {
    let frame = job.optional::<Frame>("frame").first().copied().unwrap_or_default();
    // Without the spheres around them. `trace` binds none and only asks whether there are any.
    let mut points = job.optional("points");
    points.resize(frame.points as usize, [0.0; 4]);
    Owned {
        frame,
        rows: job.optional("rows"),
        tissues: job.optional("tissues"),
        surfaces: job.optional("surfaces"),
        instances: job.optional("instances"),
        positions: job.optional("vertices"),
        normals: job.optional("normals"),
        smoothed: job.optional("smoothed"),
        triangles: job.optional("triangles"),
        points,
        fields: fields(job),
        apertures: job.optional("apertures"),
    }
}

/// The displacement fields of a job, in vectors.
fn fields(job: &Job) -> Vec<[f32; 3]> {
    job.optional::<[f32; 4]>("fields").iter().map(|&[x, y, z, _]| [x, y, z]).collect()
}

/// Bytes of a binding of [`Builder::inputs`], or of the displacement fields, to which the instances of `job`
/// refer; 0 for other bindings.
pub fn size(job: &Job, name: &str) -> usize {
    let instances: Vec<Instance> = job.optional("instances");
    let triangles: Vec<[u32; 3]> = job.optional("triangles");
    let ends = instances.iter().map(|i| (i.first_triangle + i.triangles) as usize);
    let end = ends.max().unwrap_or(0);
    // No more than exist: a job of another kernel has none, and a dump may lack some.
    let used = &triangles[..end.min(triangles.len())];
    match name {
        "vertices" | "normals" | "smoothed" => {
            let each = if name == "smoothed" { 16 } else { 12 };
            each * used.iter().flatten().map(|v| v + 1).max().unwrap_or(0) as usize
        }
        "triangles" => {
            let owners = instances.iter().filter(|i| i.owners != 0);
            let words = owners.map(|i| i.owners + i.triangles.div_ceil(2)).max();
            (12 * end).max(4 * words.unwrap_or(0) as usize)
        }
        "nodes" => {
            let roots = instances.iter().map(|i| i.bvh_root).filter(|&r| r != NONE);
            80 * (1 + roots.max().unwrap_or(0) as usize)
        }
        "fields" => {
            let fields = fields(job);
            let end = |at: u32| {
                let header = at as usize + HEADER as usize;
                let nodes = fields.get(header - 1).map_or(0.0, |n| n[0] * n[1] * n[2]);
                header + nodes as usize
            };
            let deformed = instances.iter().filter(|i| i.field != NONE).map(|i| end(i.field));
            let flows = instances.iter().filter(|i| i.flow != 0);
            let flows = flows.map(|i| end(i.flow + FLOW_VECTORS));
            16 * deformed.chain(flows).max().unwrap_or(0)
        }
        _ => 0,
    }
}
