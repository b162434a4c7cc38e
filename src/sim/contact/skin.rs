//! The skin: the surface of the body as it is now, found by intersecting lines.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ray::Ray;

use crate::bvh;
use crate::scene::{Mesh, Scene, triangle};

/// Crossings of one mesh from one side closer together than this, mm, are one crossing: a line through
/// an edge meets both its triangles.
const SAME_CROSSING: f64 = 1e-6;
/// Layers of a body that are no farther apart than this, mm, touch: meshes are rounded to hundredths.
const TOUCHING: f64 = 0.1;
/// Boxes are widened by this much of the mesh's extent, so that single precision misses no triangle.
const BOX_MARGIN: f32 = 1e-5;

/// Hierarchies over the triangles of meshes, built when a mesh is first used as skin.
#[derive(Clone, Default)]
pub struct Skins {
    /// By mesh, each with the shape that it was built over: a program may have given the mesh another one since.
    trees: HashMap<usize, (Arc<Mesh>, Arc<MeshTree>)>,
}

impl Skins {
    /// The skin of `scene` with the shapes and placements of now; empty without `contact` or while none of it
    /// is shown. Trees are built again where a mesh has another shape.
    pub fn of(&mut self, scene: &Scene) -> Skin {
        let named = scene.contact.iter().flat_map(|c| &c.skin);
        let placed = named.map(|&i| &scene.instances[i]).filter(|i| i.shown);
        let bodies = placed.map(|placed| PlacedSkin {
            tree: self.tree(placed.mesh, &scene.meshes[placed.mesh]),
            object_from_world: placed.world_from_object.inverse(),
        });
        Skin { bodies: bodies.collect() }
    }

    fn tree(&mut self, index: usize, mesh: &Arc<Mesh>) -> Arc<MeshTree> {
        match self.trees.get(&index) {
            Some((of, tree)) if Arc::ptr_eq(of, mesh) => Arc::clone(tree),
            _ => {
                let tree = Arc::new(MeshTree::new(mesh));
                self.trees.insert(index, (Arc::clone(mesh), Arc::clone(&tree)));
                tree
            }
        }
    }
}

/// The surface of the body at one time.
#[derive(Clone)]
pub struct Skin {
    bodies: Vec<PlacedSkin>,
}

#[derive(Clone)]
struct PlacedSkin {
    tree: Arc<MeshTree>,
    object_from_world: DAffine3,
}

/// A line's crossing of a triangle.
struct Crossing {
    t: f64,
    /// True if the line enters the mesh here.
    entry: bool,
    /// Outward normal, of any length.
    normal: DVec3,
}

/// A part of a line that lies in the body.
struct Chord {
    begin: f64,
    end: f64,
    /// Outward normal at `begin`, of any length.
    normal: DVec3,
}

/// A mesh's triangles with boxes around them, object space.
struct MeshTree {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    boxes: Bvh2,
}

impl MeshTree {
    fn new(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds().map(Vec3A::from);
        let margin = Vec3A::splat(BOX_MARGIN * (low.abs().max(high.abs())).max_element());
        let around = |t: &[u32; 3]| {
            let tight = Aabb::from_points(&t.map(|i| Vec3A::from(mesh.positions[i as usize])));
            Aabb::new(tight.min - margin, tight.max + margin)
        };
        let boxes: Vec<Aabb> = mesh.triangles.iter().map(around).collect();
        let widened = |p: &[f32; 3]| DVec3::from(p.map(f64::from));
        Self {
            positions: mesh.positions.iter().map(widened).collect(),
            triangles: mesh.triangles.clone(),
            boxes: bvh::binary(&boxes),
        }
    }

    /// Crossings of the line with triangles, in order.
    fn crossings(&self, origin: DVec3, direction: DVec3) -> Vec<Crossing> {
        let mut found: Vec<Crossing> = Vec::new();
        let Some(root) = self.boxes.nodes.first() else {
            return found;
        };
        // The hierarchy is traversed forward only, so the ray starts before everything that the line can meet.
        let (middle, radius) = (root.aabb().center(), root.aabb().diagonal().length());
        let length = direction.length();
        let back = (middle.as_dvec3() - origin).length() + f64::from(radius);
        let start = origin - direction * (back / length);
        let ray = Ray::new_inf(start.as_vec3a(), direction.as_vec3a());
        self.boxes.ray_traverse_anyhit(ray, |_, leaf| {
            let triangle = self.triangles[self.boxes.primitive_indices[leaf] as usize];
            let corners = triangle.map(|i| self.positions[i as usize]);
            if let Some([t, ..]) = triangle::crossing(corners, origin, direction) {
                let [a, b, c] = corners;
                let normal = (b - a).cross(c - a);
                found.push(Crossing { t, entry: direction.dot(normal) < 0.0, normal });
            }
        });
        found.sort_by(|a, b| a.t.total_cmp(&b.t));
        let mut distinct: Vec<Crossing> = Vec::with_capacity(found.len());
        for crossing in found {
            let previous = distinct.iter().rev().find(|p| p.entry == crossing.entry);
            if previous.is_none_or(|p| (crossing.t - p.t) * length > SAME_CROSSING) {
                distinct.push(crossing);
            }
        }
        distinct
    }
}

impl Skin {
    /// Stretches of the line `origin + t direction` (world, mm) that lie in the body, in order; layers
    /// that touch are one.
    fn chords(&self, origin: DVec3, direction: DVec3) -> Vec<Chord> {
        let mut crossings: Vec<Crossing> = Vec::new();
        for body in &self.bodies {
            let object = &body.object_from_world;
            let (o, d) = (object.transform_point3(origin), object.transform_vector3(direction));
            let found = body.tree.crossings(o, d).into_iter();
            crossings.extend(found.map(|crossing| Crossing {
                // Normals go by the inverse transpose.
                normal: object.matrix3.transpose() * crossing.normal,
                ..crossing
            }));
        }
        crossings.sort_by(|a, b| a.t.total_cmp(&b.t));
        let mut chords: Vec<Chord> = Vec::new();
        let (mut depth, mut begin, mut normal) = (0i32, 0.0, DVec3::ZERO);
        for crossing in crossings {
            let before = depth;
            depth += if crossing.entry { 1 } else { -1 };
            if before == 0 && depth == 1 {
                (begin, normal) = (crossing.t, crossing.normal);
            } else if before == 1 && depth == 0 {
                let end = crossing.t;
                match chords.last_mut().filter(|s| begin - s.end < TOUCHING) {
                    Some(last) => last.end = end,
                    None => chords.push(Chord { begin, end, normal }),
                }
            }
        }
        chords
    }

    /// The first point at which a ray (world, mm; `direction` a unit vector) enters the body from outside, and
    /// the outward normal of the triangle there.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<(DVec3, DVec3)> {
        let chords = self.chords(origin, direction);
        let first = chords.into_iter().find(|s| s.begin >= 0.0)?;
        Some((origin + first.begin * direction, first.normal.normalize()))
    }

    /// Distance from a point (world, mm) along a unit `direction` to the skin, mm; negative for a point in the
    /// body: the distance back to where the line entered it. None if there is no body ahead.
    pub fn gap(&self, point: DVec3, direction: DVec3) -> Option<f64> {
        let chords = self.chords(point, direction);
        let ahead = chords.into_iter().find(|s| s.end >= 0.0);
        ahead.map(|s| s.begin)
    }
}
