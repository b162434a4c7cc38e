//! The world of the tracing twins: the device's arrays, with brute-force rays over all triangles.

use glam::{DAffine3, DMat3, DVec3};

use super::field::{Field, Flowed};
use super::stack::Stack;
use insonify::scene::triangle;
use insonify::sim::layout::{Aperture, Frame, Instance, NONE, Row, Rows, Surface, Tissue};
use insonify::sim::push::Scatter;

/// Distance, mm, below which crossings of one instance from one side are one crossing: a ray
/// through an edge meets both its triangles.
const SAME_CROSSING: f64 = 1e-6;

/// Vertices and triangles of all meshes in the device's order, object space, mm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Geometry<'a> {
    /// Vertex positions.
    pub positions: &'a [[f32; 3]],
    /// Unit outward shading normals, one per vertex.
    pub normals: &'a [[f32; 3]],
    /// The same averaged over the surface, packed ([`insonify::scene::smoothed`]).
    pub smoothed: &'a [[u32; 4]],
    /// Vertex indices, counter-clockwise seen from outside; an instance owns the range
    /// `first_triangle..first_triangle + triangles`, or shares it. Behind them, lists of the instances to which
    /// the shared ones belong.
    pub triangles: &'a [[u32; 3]],
}

impl Geometry<'_> {
    /// The instance to which `triangle` belongs, of those that share the range of `instance`, which has this index.
    fn owner(&self, instance: &Instance, index: usize, triangle: usize) -> usize {
        if instance.owners == 0 {
            return index;
        }
        let place = triangle - instance.first_triangle as usize;
        let word = self.triangles.as_flattened()[instance.owners as usize + place / 2];
        (word >> (16 * (place % 2)) & 0xffff) as usize
    }
}

/// The inputs of `origin`, `trace` and `scatter`.
#[derive(Clone, Copy, Debug)]
pub struct World<'a> {
    /// Constants of the frame.
    pub frame: &'a Frame,
    /// One per axial sample.
    pub rows: &'a [Row],
    /// Acoustic properties.
    pub tissues: &'a [Tissue],
    /// Echo properties.
    pub surfaces: &'a [Surface],
    /// Placed meshes.
    pub instances: &'a [Instance],
    /// Triangles.
    pub geometry: Geometry<'a>,
    /// World position (mm) and amplitude of point targets.
    pub points: &'a [[f32; 4]],
    /// Displacement fields of deforming instances.
    pub fields: &'a [[f32; 3]],
    /// Nodes of depth with what lies on the way to targets there, by layer, node and scanline; read where losses count by the aperture.
    pub apertures: &'a [Aperture],
}

/// A ray's crossing of one mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance, mm.
    pub t: f64,
    /// Index of the instance.
    pub instance: u32,
    /// Index into the geometry's triangles.
    pub triangle: usize,
    /// Barycentric weights of the second and third vertex.
    pub uv: [f64; 2],
    /// True if the ray enters the instance.
    pub entry: bool,
}

impl Crossing {
    /// 1 where the ray enters, -1 where it leaves.
    pub fn sign(&self) -> i32 {
        if self.entry { 1 } else { -1 }
    }
}

/// A 3x4 matrix in f64.
pub fn affine(rows: &Rows) -> DAffine3 {
    let r = rows.map(|r| r.map(f64::from));
    DAffine3 {
        matrix3: DMat3::from_cols_array_2d(&[
            [r[0][0], r[1][0], r[2][0]],
            [r[0][1], r[1][1], r[2][1]],
            [r[0][2], r[1][2], r[2][2]],
        ]),
        translation: DVec3::new(r[0][3], r[1][3], r[2][3]),
    }
}

fn widen(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

impl World<'_> {
    /// The instance around a ray behind the first `passed` of its crossings, `all` of which are given: the one of the
    /// highest priority, among equals the one entered last. None if nothing is around.
    pub fn behind(&self, all: &[Crossing], passed: usize) -> Option<u32> {
        let around = all[passed..].iter().filter(|candidate| {
            let own = all[passed..].iter().filter(|c| c.instance == candidate.instance);
            own.map(Crossing::sign).sum::<i32>() < 0
        });
        let rank = |c: &&Crossing| {
            let enters = |other: &Crossing| other.instance == c.instance && other.entry;
            let entered = all[..passed].iter().rposition(enters).map_or(0, |i| i + 1);
            (self.instances[c.instance as usize].priority, entered)
        };
        // Among equals the first in the list, which is left first.
        let best = around.reduce(|best, next| if rank(&next) > rank(&best) { next } else { best });
        best.map(|crossing| crossing.instance)
    }

    /// All crossings with `t_min` < t < `t_max`, by increasing distance.
    pub fn crossings(&self, o: DVec3, d: DVec3, [t_min, t_max]: [f64; 2]) -> Vec<Crossing> {
        let mut found: Vec<Crossing> = Vec::new();
        let mut shared = Vec::new();
        for (index, instance) in self.instances.iter().enumerate() {
            if instance.owners != 0 {
                // Instances that share a range share their placement.
                if shared.contains(&instance.owners) {
                    continue;
                }
                shared.push(instance.owners);
            }
            let object = affine(&instance.object_from_world);
            let (o, d) = (object.transform_point3(o), object.transform_vector3(d));
            let first = instance.first_triangle as usize;
            for triangle in first..first + instance.triangles as usize {
                let corners = self.corners(triangle);
                if let Some([t, u, v]) = triangle::crossing(corners, o, d)
                    && t > t_min
                    && t < t_max
                {
                    let [a, b, c] = corners;
                    found.push(Crossing {
                        t,
                        instance: self.geometry.owner(instance, index, triangle) as u32,
                        triangle,
                        uv: [u, v],
                        entry: d.dot((b - a).cross(c - a)) < 0.0,
                    });
                }
            }
        }
        found.sort_by(|a, b| a.t.total_cmp(&b.t));
        let mut distinct: Vec<Crossing> = Vec::new();
        for c in found {
            let same = |p: &&Crossing| p.instance == c.instance && p.entry == c.entry;
            let previous = distinct.iter().rev().find(same);
            if previous.is_none_or(|p| c.t - p.t > SAME_CROSSING) {
                distinct.push(c);
            }
        }
        distinct
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.geometry.triangles[triangle].map(|i| widen(self.geometry.positions[i as usize]))
    }

    /// World-space unit normals at a crossing, both outward: of the triangle, and interpolated.
    pub fn normals(&self, crossing: &Crossing) -> (DVec3, DVec3) {
        let instance = &self.instances[crossing.instance as usize];
        // Normals go by the inverse transpose.
        let turn = affine(&instance.object_from_world).matrix3.transpose();
        let [a, b, c] = self.corners(crossing.triangle);
        let [u, v] = crossing.uv;
        let [na, nb, nc] = self.corner_normals(crossing);
        let shading = (1.0 - u - v) * na + u * nb + v * nc;
        ((turn * (b - a).cross(c - a)).normalize(), (turn * shading).normalize())
    }

    /// Normals at the corners of the triangle, as the vertices have them.
    pub fn corner_normals(&self, crossing: &Crossing) -> [DVec3; 3] {
        let corners = self.geometry.triangles[crossing.triangle];
        corners.map(|i| widen(self.geometry.normals[i as usize]))
    }

    /// The unit normal at a crossing that is `normals` at the corners of the triangle (object space); zero where they
    /// cancel.
    pub fn between(&self, crossing: &Crossing, normals: [DVec3; 3]) -> DVec3 {
        let instance = &self.instances[crossing.instance as usize];
        let [u, v] = crossing.uv;
        let mean = (1.0 - u - v) * normals[0] + u * normals[1] + v * normals[2];
        (affine(&instance.object_from_world).matrix3.transpose() * mean).normalize_or_zero()
    }

    /// Change of the normal interpolated from `normals` at the corners of the triangle (object space) over the way
    /// `along` (world, mm).
    pub fn turning(&self, crossing: &Crossing, normals: [DVec3; 3], along: DVec3) -> DVec3 {
        let instance = &self.instances[crossing.instance as usize];
        let to_world = affine(&instance.world_from_object).matrix3;
        let turn = affine(&instance.object_from_world).matrix3.transpose();
        let [a, b, c] = self.corners(crossing.triangle);
        let (u, v) = (to_world * (b - a), to_world * (c - a));
        let [n, n_u, n_v] = normals.map(|n| (turn * n).normalize_or_zero());
        let across = u.cross(v);
        let area2 = across.length_squared();
        if area2 == 0.0 {
            return DVec3::ZERO;
        }
        let a = along.cross(v).dot(across) / area2;
        let b = u.cross(along).dot(across) / area2;
        a * (n_u - n) + b * (n_v - n)
    }

    /// Rotation of that normal along the direction `along` (world, any length), rad/mm.
    pub fn curvature(&self, crossing: &Crossing, normals: [DVec3; 3], along: DVec3) -> f64 {
        match along.length_squared() {
            0.0 => 0.0,
            size => self.turning(crossing, normals, along).dot(along).abs() / size,
        }
    }

    /// Index of the tissue where `stack` encloses a point, and of the instance or NONE.
    pub fn medium(&self, stack: &Stack) -> (u32, u32) {
        match stack.current(self.instances) {
            Some(i) => (self.instances[i as usize].tissue, i),
            None => (self.frame.background, NONE),
        }
    }

    /// Texture space from world space for `instance`: the frame in which its lattice rests.
    pub fn texture(&self, instance: u32) -> DAffine3 {
        let world = self.frame.flags & insonify::sim::layout::FLAG_WORLD_TEXTURE != 0;
        if instance == NONE || world {
            DAffine3::IDENTITY
        } else {
            affine(&self.instances[instance as usize].texture_from_world)
        }
    }

    /// The displacement field of `instance` in its texture space; none where its tissue does not deform.
    pub fn field(&self, instance: u32) -> Option<Field<'_>> {
        let world = self.frame.flags & insonify::sim::layout::FLAG_WORLD_TEXTURE != 0;
        if instance == NONE || world {
            return None;
        }
        let at = self.instances[instance as usize].field;
        (at != NONE).then(|| Field::new(self.fields, at))
    }

    /// The generations of scatterers of what flows in `instance` that are heard; none where nothing flows.
    pub fn flows(&self, instance: u32, heard: Scatter) -> Vec<Flowed<'_>> {
        let world = self.frame.flags & insonify::sim::layout::FLAG_WORLD_TEXTURE != 0;
        let at = if instance == NONE || world { 0 } else { self.instances[instance as usize].flow };
        if at == 0 { Vec::new() } else { Flowed::all(self.fields, at, heard) }
    }

    /// The place in the reference shape, in texture space, of the tissue that is at `p` in the world.
    pub fn tissue_point(&self, instance: u32, p: DVec3) -> DVec3 {
        let p = self.texture(instance).transform_point3(p);
        self.field(instance).map_or(p, |field| field.reference(p))
    }
}
