//! A world with arrays of its own, for the twins.

use super::world::{Geometry, World, affine};
use super::{aperture, origin, trace};
use insonify::scene::Mesh;
use insonify::scene::smoothed::{FINEST, smoothed};
use insonify::sim::layout::{Aperture, Frame, Instance, Row, Surface, Tissue};

/// The arrays that a [`World`] borrows, in the device's layout and units.
#[derive(Clone, Debug, Default)]
pub struct Owned {
    /// Constants of the frame.
    pub frame: Frame,
    /// One per axial sample.
    pub rows: Vec<Row>,
    /// Acoustic properties.
    pub tissues: Vec<Tissue>,
    /// Echo properties.
    pub surfaces: Vec<Surface>,
    /// Placed meshes.
    pub instances: Vec<Instance>,
    /// World position (mm) and amplitude of point targets.
    pub points: Vec<[f32; 4]>,
    /// Vertex positions of all meshes, object space, mm.
    pub positions: Vec<[f32; 3]>,
    /// Unit outward shading normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// The same averaged over the surface.
    pub smoothed: Vec<[u32; 4]>,
    /// Vertex indices; an instance owns a range, or shares it ([`Geometry::triangles`]).
    pub triangles: Vec<[u32; 3]>,
    /// Displacement fields, in vectors.
    pub fields: Vec<[f32; 3]>,
    /// Nodes of depth, [`World::apertures`].
    pub apertures: Vec<Aperture>,
}

impl Owned {
    /// Appends a mesh and `instance`, which gets its range of triangles, and averages as the device has them.
    pub fn place(
        &mut self,
        positions: &[[f32; 3]],
        normals: &[[f32; 3]],
        triangles: &[[u32; 3]],
        instance: Instance,
    ) {
        let base = self.positions.len() as u32;
        self.instances.push(Instance {
            first_triangle: self.triangles.len() as u32,
            triangles: triangles.len() as u32,
            finest: FINEST as f32,
            ..instance
        });
        let mesh = Mesh {
            positions: positions.to_vec(),
            normals: normals.to_vec(),
            triangles: triangles.to_vec(),
            ..Mesh::default()
        };
        let stretch = affine(&instance.world_from_object).matrix3.determinant().abs().cbrt();
        self.smoothed.extend(smoothed(&mesh, FINEST / stretch));
        self.positions.extend_from_slice(positions);
        self.normals.extend_from_slice(normals);
        let moved = triangles.iter().map(|t| t.map(|v| v + base));
        self.triangles.extend(moved);
    }

    /// The world that borrows these arrays.
    pub fn world(&self) -> World<'_> {
        World {
            frame: &self.frame,
            rows: &self.rows,
            tissues: &self.tissues,
            surfaces: &self.surfaces,
            instances: &self.instances,
            geometry: Geometry {
                positions: &self.positions,
                normals: &self.normals,
                smoothed: &self.smoothed,
                triangles: &self.triangles,
            },
            points: &self.points,
            fields: &self.fields,
            apertures: &self.apertures,
        }
    }

    /// Computes what lies on the way to targets; nothing where losses do not count by the aperture.
    pub fn converge(&mut self) {
        let world = self.world();
        let passed = trace::passed(&world, &origin::origin(&world).0);
        let found = aperture::aperture(&self.frame, &self.rows, &passed);
        let nodes = found.iter().zip(&passed).map(|(found, passed)| Aperture {
            gain: found.gain as f32,
            lost: passed.lost as f32,
            bent: passed.bent as f32,
            level: found.level as f32,
        });
        self.apertures = nodes.collect();
    }

    /// Segments per line and surface echoes; every line starts inside the media that enclose its origin.
    pub fn traced(&self) -> trace::Traced {
        let world = self.world();
        trace::trace(&world, &origin::origin(&world).0)
    }
}
