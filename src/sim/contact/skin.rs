//! The body's surface as it stands, found by lines.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ray::Ray;

use crate::reference::intersect;
use crate::scene::{Mesh, Scene};
use crate::sim::bvh;

/// Crossings of one mesh from one side closer together than this, mm, are one crossing: a line through
/// an edge meets both its triangles.
const SAME_CROSSING: f64 = 1e-6;
/// Layers of a body that are no farther apart than this, mm, touch: meshes are rounded to hundredths.
const JOINED: f64 = 0.1;
/// Boxes are widened by this much of the mesh's extent, so that single precision misses no triangle.
const MARGIN: f32 = 1e-5;

/// Hierarchies over the triangles of meshes, made when a mesh is first skin.
#[derive(Default)]
pub struct Skins {
    trees: HashMap<usize, Arc<Tree>>,
}

impl Skins {
    /// The skin of `scene` as it stands, with the shapes and places of now; without `contact`, or while
    /// none of it is shown, there is none. Scenes of other meshes need skins of their own.
    pub fn of(&mut self, scene: &Scene) -> Skin {
        let named = scene.contact.iter().flat_map(|c| &c.skin);
        let placed = named.map(|&i| &scene.instances[i]).filter(|i| i.shown);
        let bodies = placed.map(|placed| Body {
            tree: self
                .trees
                .entry(placed.mesh)
                .or_insert_with(|| Arc::new(Tree::new(&scene.meshes[placed.mesh])))
                .clone(),
            object_from_world: placed.world_from_object.inverse(),
        });
        Skin {
            bodies: bodies.collect(),
        }
    }
}

/// The body's surface at one time.
#[derive(Clone)]
pub struct Skin {
    bodies: Vec<Body>,
}

#[derive(Clone)]
struct Body {
    tree: Arc<Tree>,
    object_from_world: DAffine3,
}

/// A mesh's triangles with boxes around them, object space.
struct Tree {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    boxes: Bvh2,
}

impl Tree {
    fn new(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds().map(Vec3A::from);
        let margin = Vec3A::splat(MARGIN * (low.abs().max(high.abs())).max_element());
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

    /// Where the line meets triangles: place along it, and whether it goes in.
    fn crossings(&self, origin: DVec3, direction: DVec3) -> Vec<(f64, bool)> {
        let mut found: Vec<(f64, bool)> = Vec::new();
        let Some(root) = self.boxes.nodes.first() else {
            return found;
        };
        // The hierarchy is walked forward only: from before everything that the line can meet.
        let (middle, radius) = (root.aabb().center(), root.aabb().diagonal().length());
        let length = direction.length();
        let back = (middle.as_dvec3() - origin).length() + f64::from(radius);
        let start = origin - direction * (back / length);
        let ray = Ray::new_inf(start.as_vec3a(), direction.as_vec3a());
        self.boxes.ray_traverse_anyhit(ray, |_, leaf| {
            let triangle = self.triangles[self.boxes.primitive_indices[leaf] as usize];
            let corners = triangle.map(|i| self.positions[i as usize]);
            if let Some([t, ..]) = intersect::triangle(corners, origin, direction) {
                let [a, b, c] = corners;
                found.push((t, direction.dot((b - a).cross(c - a)) < 0.0));
            }
        });
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut distinct: Vec<(f64, bool)> = Vec::with_capacity(found.len());
        for (t, entry) in found {
            let previous = distinct.iter().rev().find(|p| p.1 == entry);
            if previous.is_none_or(|p| (t - p.0) * length > SAME_CROSSING) {
                distinct.push((t, entry));
            }
        }
        distinct
    }
}

impl Skin {
    /// Stretches of the line `origin + t direction` (world, mm) that lie in the body, in order; layers
    /// that touch are one.
    pub fn inside(&self, origin: DVec3, direction: DVec3) -> Vec<[f64; 2]> {
        let mut crossings: Vec<(f64, bool)> = Vec::new();
        for body in &self.bodies {
            let o = body.object_from_world.transform_point3(origin);
            let d = body.object_from_world.transform_vector3(direction);
            crossings.extend(body.tree.crossings(o, d));
        }
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut stretches: Vec<[f64; 2]> = Vec::new();
        let (mut depth, mut begin) = (0i32, 0.0);
        for (t, entry) in crossings {
            let before = depth;
            depth += if entry { 1 } else { -1 };
            if before == 0 && depth == 1 {
                begin = t;
            } else if before == 1 && depth == 0 {
                match stretches.last_mut().filter(|last| begin - last[1] < JOINED) {
                    Some(last) => last[1] = t,
                    None => stretches.push([begin, t]),
                }
            }
        }
        stretches
    }

    /// How far the skin is ahead of a point (world, mm) along a unit `direction`, mm; below 0 where the
    /// point lies in the body: then as far back it was entered. None: there is no body ahead.
    pub fn gap(&self, point: DVec3, direction: DVec3) -> Option<f64> {
        let stretches = self.inside(point, direction);
        let ahead = stretches.into_iter().find(|[_, end]| *end >= 0.0);
        ahead.map(|[begin, _]| begin)
    }
}
