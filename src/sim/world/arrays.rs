//! A scene's geometry as the kernels bind it, on the host.

use glam::DAffine3;
use rayon::prelude::*;

use crate::scene::{Mesh, Scene};
use crate::sim::bvh::{BvhError, MeshBvh, SceneBvh};
use crate::sim::fields::Fields;
use crate::sim::layout::{Instance, NONE};
use crate::sim::placement::{rigid, rows};
use crate::sim::tracer::Tracer;

/// Where a mesh lies in the arrays.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) first_triangle: u32,
    pub(super) triangles: u32,
    /// Index in the mesh of each triangle, in the order of the array; none where it is the mesh's.
    pub(super) order: Option<Vec<u32>>,
}

/// Geometry of all meshes, and the instances. For the compute tracer triangles lie in the order of
/// its leaves, for the ray query in that of the meshes, so that nothing is built to sort them.
pub struct Arrays {
    /// One row per instance of the scene.
    pub instances: Vec<Instance>,
    /// Vertex positions, object space, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Unit outward shading normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// Indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
    /// The compute tracer's hierarchy.
    pub bvh: Option<SceneBvh>,
    /// How tissue deforms.
    pub fields: Fields,
    pub(super) places: Vec<Place>,
}

impl Arrays {
    /// What `tracer` needs of `scene`.
    ///
    /// # Errors
    /// When the hierarchy is deeper than the compute tracer walks.
    ///
    /// # Panics
    /// When a mesh has not one normal per vertex.
    pub fn new(scene: &Scene, tracer: Tracer) -> Result<Self, BvhError> {
        let mut arrays = Self {
            instances: Vec::new(),
            vertices: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
            bvh: None,
            fields: Fields::build(scene),
            places: Vec::new(),
        };
        if tracer == Tracer::Bvh {
            let trees: Vec<MeshBvh> = scene.meshes.par_iter().map(MeshBvh::build).collect();
            for (mesh, tree) in scene.meshes.iter().zip(&trees) {
                arrays.add(mesh, Some(&tree.triangle_order));
            }
            let first: Vec<u32> = arrays.places.iter().map(|p| p.first_triangle).collect();
            let mut bvh = SceneBvh::new(&trees, &first, scene.instances.len());
            bvh.place(&placements(scene))?;
            arrays.bvh = Some(bvh);
        } else {
            for mesh in &scene.meshes {
                arrays.add(mesh, None);
            }
        }
        let roots = arrays.bvh.as_ref().map(|bvh| &bvh.roots[..]);
        arrays.instances = instance_rows(scene, &arrays.places, roots, &arrays.fields);
        Ok(arrays)
    }

    fn add(&mut self, mesh: &Mesh, order: Option<&[u32]>) {
        assert_eq!(
            mesh.normals.len(),
            mesh.positions.len(),
            "one normal per vertex: `{}`",
            mesh.name
        );
        let base = self.vertices.len() as u32;
        self.places.push(Place {
            first_triangle: self.triangles.len() as u32,
            triangles: mesh.triangles.len() as u32,
            order: order.map(<[u32]>::to_vec),
        });
        self.vertices.extend_from_slice(&mesh.positions);
        self.normals.extend_from_slice(&mesh.normals);
        let moved = |triangle: &[u32; 3]| triangle.map(|v| v + base);
        match order {
            Some(order) => {
                let sorted = order.iter().map(|&i| moved(&mesh.triangles[i as usize]));
                self.triangles.extend(sorted);
            }
            None => self.triangles.extend(mesh.triangles.iter().map(moved)),
        }
    }
}

pub(super) fn placements(scene: &Scene) -> Vec<(usize, DAffine3)> {
    scene
        .instances
        .iter()
        .map(|i| (i.mesh, i.world_from_object))
        .collect()
}

/// Rows of the scene's instances; `roots` are the meshes' in the compute tracer's hierarchy.
pub(super) fn instance_rows(
    scene: &Scene,
    places: &[Place],
    roots: Option<&[u32]>,
    fields: &Fields,
) -> Vec<Instance> {
    let row = |(i, placed): (usize, &crate::scene::Instance)| Instance {
        world_from_object: rows(&placed.world_from_object),
        object_from_world: rows(&placed.world_from_object.inverse()),
        texture_from_world: rows(&rigid(&placed.world_from_object).inverse()),
        tissue: placed.tissue as u32,
        priority: placed.priority,
        surface_outside: 2 * i as u32,
        surface_inside: 2 * i as u32 + 1,
        first_triangle: places[placed.mesh].first_triangle,
        triangles: places[placed.mesh].triangles,
        bvh_root: roots.map_or(NONE, |roots| roots[placed.mesh]),
        slot: 0,
        field: fields.offset(scene, i),
        ..Instance::default()
    };
    scene.instances.iter().enumerate().map(row).collect()
}
