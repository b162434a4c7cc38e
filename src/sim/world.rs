//! The anatomy on the device: geometry, instance rows, and what a tracer walks.

use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use super::bvh::{BvhError, MeshBvh, SceneBvh};
use super::layout::{self, NONE};
use super::placement::{rigid, rows};
use super::tracer::Tracer;
use crate::gpu::{
    Binding, Blas, BlasInput, BlasOptions, Buffer, BufferKind, Commands, Device, GpuError, Tlas,
    TlasInstance,
};
use crate::scene::Scene;

/// Why the anatomy is not on the device.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// The device refuses.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The hierarchy does not fit its kernel.
    #[error(transparent)]
    Bvh(#[from] BvhError),
}

/// What the tracer walks.
enum Structure {
    Bvh {
        bvh: SceneBvh,
        nodes: Buffer,
    },
    /// No structure for a mesh without triangles.
    Query {
        meshes: Vec<Option<Blas>>,
        tlas: Tlas,
    },
}

/// Where a mesh lies in the buffers.
#[derive(Clone, Debug)]
struct Place {
    first_triangle: u32,
    /// Index in the mesh of each triangle, in the order of the buffer.
    order: Vec<u32>,
}

/// The anatomy on the device. Triangles lie in the order of the compute tracer's leaves, so that a
/// hit's primitive means the same to both tracers.
pub struct World {
    tracer: Tracer,
    places: Vec<Place>,
    rows: Vec<layout::Instance>,
    instances: Buffer,
    vertices: Buffer,
    normals: Buffer,
    triangles: Buffer,
    structure: Structure,
}

/// Everything that is uploaded once.
#[derive(Default)]
struct Geometry {
    vertices: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl World {
    /// Uploads a scene's geometry. Surface `2 i` is instance i's outside, `2 i + 1` its inside;
    /// tissues keep their indices.
    ///
    /// # Errors
    /// When the scene exceeds the device's limits or memory, or the tracer cannot serve it.
    pub fn new(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Result<Self, WorldError> {
        let trees: Vec<MeshBvh> = scene.meshes.par_iter().map(MeshBvh::build).collect();
        let mut geometry = Geometry::default();
        let places: Vec<Place> = scene
            .meshes
            .iter()
            .zip(&trees)
            .map(|(mesh, tree)| geometry.add(mesh, tree))
            .collect();

        let (structure, roots) = match tracer {
            Tracer::Bvh => {
                let first: Vec<u32> = places.iter().map(|p| p.first_triangle).collect();
                let mut bvh = SceneBvh::new(&trees, &first, scene.instances.len());
                bvh.place(&placements(scene))?;
                let roots = bvh.roots.clone();
                let nodes = upload(device, "nodes", bytemuck::cast_slice(&bvh.nodes))?;
                (Structure::Bvh { bvh, nodes }, roots)
            }
            Tracer::RayQuery => {
                let meshes = build_meshes(device, scene, &places)?;
                let mut tlas = Tlas::new(device, "anatomy", scene.instances.len().max(1) as u32)?;
                device.once(|commands| tlas.build(commands, &tlas_instances(scene, &meshes)))?;
                (
                    Structure::Query { meshes, tlas },
                    vec![NONE; scene.meshes.len()],
                )
            }
        };
        let rows = instance_rows(scene, &places, &roots);
        Ok(Self {
            tracer,
            instances: upload(device, "instances", bytemuck::cast_slice(&rows))?,
            vertices: upload(device, "vertices", bytemuck::cast_slice(&geometry.vertices))?,
            normals: upload(device, "normals", bytemuck::cast_slice(&geometry.normals))?,
            triangles: upload(
                device,
                "triangles",
                bytemuck::cast_slice(&geometry.triangles),
            )?,
            structure,
            places,
            rows,
        })
    }

    /// Records what changed since the last call: instance rows and the top level, or nothing.
    /// Meshes and the number of instances must be those of [`Self::new`]. Barriers to and from
    /// the kernels before and after are the caller's when this returns true.
    ///
    /// # Errors
    /// When recording fails, or the moved instances need a deeper top level than the kernel walks.
    pub fn update(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<bool, WorldError> {
        assert_eq!(
            scene.instances.len(),
            self.rows.len(),
            "instances were added or removed after the upload"
        );
        let roots: Vec<u32> = match &self.structure {
            Structure::Bvh { bvh, .. } => bvh.roots.clone(),
            Structure::Query { meshes, .. } => vec![NONE; meshes.len()],
        };
        let rows = instance_rows(scene, &self.places, &roots);
        if rows == self.rows {
            return Ok(false);
        }
        commands.write(&self.instances, 0, bytemuck::cast_slice(&rows))?;
        match &mut self.structure {
            Structure::Bvh { bvh, nodes } => {
                commands.write(
                    nodes,
                    0,
                    bytemuck::cast_slice(bvh.place(&placements(scene))?),
                )?;
            }
            Structure::Query { meshes, tlas } => {
                tlas.build(commands, &tlas_instances(scene, meshes))?
            }
        }
        self.rows = rows;
        Ok(true)
    }

    /// How rays find surfaces here.
    pub fn tracer(&self) -> Tracer {
        self.tracer
    }

    /// Instance rows, in the order of [`Scene::instances`].
    pub fn instances(&self) -> &Buffer {
        &self.instances
    }

    /// Vertex positions, object space, mm: three floats each.
    pub fn vertices(&self) -> &Buffer {
        &self.vertices
    }

    /// Shading normals, object space: three floats each.
    pub fn normals(&self) -> &Buffer {
        &self.normals
    }

    /// Three indices into the vertices per triangle.
    pub fn triangles(&self) -> &Buffer {
        &self.triangles
    }

    /// What a kernel of this world's tracer binds as `nodes` or `tlas`.
    pub fn structure(&self) -> Binding<'_> {
        match &self.structure {
            Structure::Bvh { nodes, .. } => Binding::Buffer(nodes),
            Structure::Query { tlas, .. } => Binding::Tlas(tlas),
        }
    }

    /// Instances, vertices, normals, triangles, structure: the order in which the kernels bind them.
    pub fn bindings(&self) -> [Binding<'_>; 5] {
        [
            Binding::Buffer(&self.instances),
            Binding::Buffer(&self.vertices),
            Binding::Buffer(&self.normals),
            Binding::Buffer(&self.triangles),
            self.structure(),
        ]
    }

    /// The rows as they are on the device.
    pub fn rows(&self) -> &[layout::Instance] {
        &self.rows
    }

    /// Index in [`crate::scene::Mesh::triangles`] of a hit's primitive on mesh `mesh`.
    pub fn triangle(&self, mesh: usize, primitive: u32) -> usize {
        let place = &self.places[mesh];
        place.order[(primitive - place.first_triangle) as usize] as usize
    }

    /// Device memory of geometry and structure, bytes.
    pub fn bytes(&self) -> u64 {
        let buffers = [
            &self.instances,
            &self.vertices,
            &self.normals,
            &self.triangles,
        ];
        let structure = match &self.structure {
            Structure::Bvh { nodes, .. } => nodes.size(),
            Structure::Query { meshes, tlas } => {
                tlas.bytes() + meshes.iter().flatten().map(Blas::bytes).sum::<u64>()
            }
        };
        buffers.iter().map(|b| b.size()).sum::<u64>() + structure
    }
}

impl Geometry {
    fn add(&mut self, mesh: &crate::scene::Mesh, tree: &MeshBvh) -> Place {
        assert_eq!(
            mesh.normals.len(),
            mesh.positions.len(),
            "one normal per vertex: `{}`",
            mesh.name
        );
        let first_vertex = self.vertices.len() as u32;
        let first_triangle = self.triangles.len() as u32;
        self.vertices.extend_from_slice(&mesh.positions);
        self.normals.extend_from_slice(&mesh.normals);
        let order = tree.triangle_order.clone();
        self.triangles.extend(
            order
                .iter()
                .map(|&i| mesh.triangles[i as usize].map(|v| v + first_vertex)),
        );
        Place {
            first_triangle,
            order,
        }
    }
}

fn upload(device: &Arc<Device>, name: &str, bytes: &[u8]) -> Result<Buffer, GpuError> {
    let buffer = device.buffer(name, bytes.len() as u64, BufferKind::Storage)?;
    device.upload(&buffer, bytes)?;
    Ok(buffer)
}

fn placements(scene: &Scene) -> Vec<(usize, DAffine3)> {
    scene
        .instances
        .iter()
        .map(|i| (i.mesh, i.world_from_object))
        .collect()
}

fn instance_rows(scene: &Scene, places: &[Place], roots: &[u32]) -> Vec<layout::Instance> {
    let row = |(i, placed): (usize, &crate::scene::Instance)| layout::Instance {
        world_from_object: rows(&placed.world_from_object),
        object_from_world: rows(&placed.world_from_object.inverse()),
        texture_from_world: rows(&rigid(&placed.world_from_object).inverse()),
        tissue: placed.tissue as u32,
        priority: placed.priority,
        surface_outside: 2 * i as u32,
        surface_inside: 2 * i as u32 + 1,
        first_triangle: places[placed.mesh].first_triangle,
        triangles: places[placed.mesh].order.len() as u32,
        bvh_root: roots[placed.mesh],
        unused0: 0,
    };
    scene.instances.iter().enumerate().map(row).collect()
}

fn build_meshes(
    device: &Arc<Device>,
    scene: &Scene,
    places: &[Place],
) -> Result<Vec<Option<Blas>>, GpuError> {
    let ordered: Vec<Vec<[u32; 3]>> = scene
        .meshes
        .iter()
        .zip(places)
        .map(|(mesh, place)| {
            place
                .order
                .iter()
                .map(|&i| mesh.triangles[i as usize])
                .collect()
        })
        .collect();
    let inputs: Vec<BlasInput<'_>> = scene
        .meshes
        .iter()
        .zip(&ordered)
        .filter(|(_, triangles)| !triangles.is_empty())
        .map(|(mesh, triangles)| BlasInput {
            name: &mesh.name,
            positions: &mesh.positions,
            triangles,
        })
        .collect();
    let mut built = Blas::build_many(device, &inputs, BlasOptions::default())?.into_iter();
    Ok(ordered
        .iter()
        .map(|triangles| {
            if triangles.is_empty() {
                None
            } else {
                built.next()
            }
        })
        .collect())
}

fn tlas_instances<'a>(scene: &Scene, meshes: &'a [Option<Blas>]) -> Vec<TlasInstance<'a>> {
    scene
        .instances
        .iter()
        .enumerate()
        .filter_map(|(i, placed)| {
            Some(TlasInstance {
                blas: meshes[placed.mesh].as_ref()?,
                transform: rows(&placed.world_from_object),
                custom_index: i as u32,
                mask: 0xff,
            })
        })
        .collect()
}
