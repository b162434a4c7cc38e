//! The anatomy on the device: geometry, instance rows, and what a tracer walks.

mod arrays;

use std::sync::Arc;

use super::bvh::{BvhError, SceneBvh};
use super::fields::Fields;
use super::layout;
use super::placement::rows;
use super::tracer::Tracer;
use crate::gpu::{
    Binding, Blas, BlasInput, BlasOptions, Buffer, BufferKind, Commands, Device, GpuError, Tlas,
    TlasInstance,
};
use crate::scene::Scene;
pub use arrays::Arrays;
use arrays::{Place, instance_rows, placements};

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

/// The anatomy on the device.
pub struct World {
    tracer: Tracer,
    places: Vec<Place>,
    rows: Vec<layout::Instance>,
    instances: Buffer,
    vertices: Buffer,
    normals: Buffer,
    triangles: Buffer,
    fields: Fields,
    field_buffer: Buffer,
    structure: Structure,
}

impl World {
    /// Uploads a scene's geometry. Surface `2 i` is instance i's outside, `2 i + 1` its inside;
    /// tissues keep their indices.
    ///
    /// # Errors
    /// When the scene exceeds the device's limits or memory, or the tracer cannot serve it.
    pub fn new(device: &Arc<Device>, scene: &Scene, tracer: Tracer) -> Result<Self, WorldError> {
        let Arrays {
            places,
            bvh,
            instances: rows,
            vertices,
            normals,
            triangles,
            fields,
        } = Arrays::new(scene, tracer)?;
        let structure = match bvh {
            Some(bvh) => {
                let nodes = upload(device, "nodes", bytemuck::cast_slice(&bvh.nodes))?;
                Structure::Bvh { bvh, nodes }
            }
            None => {
                let meshes = build_meshes(device, scene)?;
                let mut tlas = Tlas::new(device, "anatomy", scene.instances.len().max(1) as u32)?;
                device.once(|commands| tlas.build(commands, &tlas_instances(scene, &meshes)))?;
                Structure::Query { meshes, tlas }
            }
        };
        Ok(Self {
            tracer,
            instances: upload(device, "instances", bytemuck::cast_slice(&rows))?,
            vertices: upload(device, "vertices", bytemuck::cast_slice(&vertices))?,
            normals: upload(device, "normals", bytemuck::cast_slice(&normals))?,
            triangles: upload(device, "triangles", bytemuck::cast_slice(&triangles))?,
            field_buffer: upload(device, "fields", fields.bytes())?,
            fields,
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
        let roots = match &self.structure {
            Structure::Bvh { bvh, .. } => Some(&bvh.roots[..]),
            Structure::Query { .. } => None,
        };
        let rows = instance_rows(scene, &self.places, roots, &self.fields);
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

    /// Displacement fields of deforming tissue: three floats per vector.
    pub fn fields(&self) -> &Buffer {
        &self.field_buffer
    }

    /// Whether any instance's tissue deforms.
    pub fn deforms(&self) -> bool {
        !self.fields.is_empty()
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
        let index = (primitive - place.first_triangle) as usize;
        place.order.as_ref().map_or(index, |o| o[index] as usize)
    }

    /// Device memory of geometry and structure, bytes.
    pub fn bytes(&self) -> u64 {
        let buffers = [
            &self.instances,
            &self.vertices,
            &self.normals,
            &self.triangles,
            &self.field_buffer,
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

fn upload(device: &Arc<Device>, name: &str, bytes: &[u8]) -> Result<Buffer, GpuError> {
    let buffer = device.buffer(name, bytes.len() as u64, BufferKind::Storage)?;
    device.upload(&buffer, bytes)?;
    Ok(buffer)
}

fn build_meshes(device: &Arc<Device>, scene: &Scene) -> Result<Vec<Option<Blas>>, GpuError> {
    let solid = scene.meshes.iter().filter(|m| !m.triangles.is_empty());
    let inputs: Vec<BlasInput<'_>> = solid
        .map(|mesh| BlasInput {
            name: &mesh.name,
            positions: &mesh.positions,
            triangles: &mesh.triangles,
        })
        .collect();
    let mut built = Blas::build_many(device, &inputs, BlasOptions::default())?.into_iter();
    let structure = |mesh: &crate::scene::Mesh| {
        let solid = !mesh.triangles.is_empty();
        solid.then(|| built.next()).flatten()
    };
    Ok(scene.meshes.iter().map(structure).collect())
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
