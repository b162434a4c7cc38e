//! The top level of either tracer: built over the entries of a scene, again only when they change.

use std::sync::Arc;

use super::WorldError;
use super::arrays::{Residency, needs, ordered, placed};
use super::entry::{self, EntryGeometry, TopLevelEntry};
use super::joined::{SharingSet, SharingSets};
use crate::bvh::SceneBvh;
use crate::gpu::{
    Binding, Blas, BlasInput, BlasOptions, Buffer, Commands, Device, GpuError, Stage, Tlas,
    TlasInstance,
};
use crate::placement::matrix_rows;
use crate::scene::Scene;

/// The structures that the tracer walks.
enum TracerStructure {
    Bvh {
        bvh: SceneBvh,
        nodes: Buffer,
    },
    /// Structures of the ray query; none for a mesh that needs none of its own.
    Query {
        meshes: Vec<Option<Blas>>,
        /// Structures that instances share, by set and shape.
        joined: Vec<Vec<Blas>>,
        tlas: Tlas,
    },
}

/// The top level, and everything below it that does not change.
pub(super) struct TopLevel {
    structure: TracerStructure,
    entries: Option<Vec<TopLevelEntry>>,
    slots: Vec<u32>,
}

impl TopLevel {
    /// Uploads the trees of the compute tracer, or builds the structures of the ray query.
    pub(super) fn new(
        device: &Arc<Device>,
        scene: &Scene,
        sets: &SharingSets,
        bvh: Option<SceneBvh>,
    ) -> Result<Self, GpuError> {
        let structure = match bvh {
            Some(mut bvh) => {
                let nodes = super::upload(device, "nodes", bytemuck::cast_slice(&bvh.nodes))?;
                bvh.forget_meshes();
                TracerStructure::Bvh { bvh, nodes }
            }
            None => {
                let capacity = entry::capacity(scene).max(1) as u32;
                TracerStructure::Query {
                    meshes: build_meshes(device, scene, sets)?,
                    joined: build_joined(device, scene, sets)?,
                    tlas: Tlas::new(device, "anatomy", capacity)?,
                }
            }
        };
        Ok(Self { structure, entries: None, slots: Vec::new() })
    }

    /// Records the top level over `entries`, if they differ from those of the last call. `changing` has
    /// the ray query's structures of instances that change their shape. Returns true if
    /// anything was recorded.
    pub(super) fn place(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        entries: Vec<TopLevelEntry>,
        changing: &[Option<Blas>],
    ) -> Result<bool, WorldError> {
        if self.entries.as_ref() == Some(&entries) {
            return Ok(false);
        }
        let old = self.entries.as_deref().unwrap_or_default();
        let refit = self.entries.is_some() && entry::may_refit(scene, old, &entries);
        match &mut self.structure {
            TracerStructure::Bvh { bvh, nodes } => {
                let changed = bvh.place(&placed(&entries), refit)?;
                commands.write(nodes, 0, bytemuck::cast_slice(changed))?;
                self.slots = bvh.slots.clone();
            }
            TracerStructure::Query { meshes, joined, tlas } => {
                let instances: Vec<_> = entries
                    .iter()
                    .map(|entry| TlasInstance {
                        blas: match entry.geometry {
                            EntryGeometry::Mesh(mesh) => meshes[mesh].as_ref(),
                            EntryGeometry::Changing { .. } => {
                                changing[entry.instance as usize].as_ref()
                            }
                            EntryGeometry::Joined { set, shape, .. } => Some(&joined[set][shape]),
                            EntryGeometry::Union => unreachable!("refused with the ray query"),
                        }
                        .expect("entries have triangles, and these a structure"),
                        transform: matrix_rows(&entry.world_from_object),
                        custom_index: entry.instance,
                        mask: entry.mask,
                    })
                    .collect();
                match refit {
                    true => tlas.refit(commands, &instances)?,
                    false => tlas.build(commands, &instances)?,
                }
                commands.barrier(Stage::Build, Stage::Compute);
                self.slots = (0..entries.len() as u32).collect();
            }
        }
        self.entries = Some(entries);
        Ok(true)
    }

    /// Entries of the last [`Self::place`].
    pub(super) fn entries(&self) -> &[TopLevelEntry] {
        self.entries.as_deref().unwrap_or_default()
    }

    /// The place of each entry, in the form that rows need.
    pub(super) fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// The compute tracer's hierarchy and its buffer.
    pub(super) fn bvh(&mut self) -> Option<(&mut SceneBvh, &Buffer)> {
        match &mut self.structure {
            TracerStructure::Bvh { bvh, nodes } => Some((bvh, nodes)),
            TracerStructure::Query { .. } => None,
        }
    }

    pub(super) fn binding(&self) -> Binding<'_> {
        match &self.structure {
            TracerStructure::Bvh { nodes, .. } => Binding::Buffer(nodes),
            TracerStructure::Query { tlas, .. } => Binding::Tlas(tlas),
        }
    }

    /// Device memory, bytes.
    pub(super) fn bytes(&self) -> u64 {
        match &self.structure {
            TracerStructure::Bvh { nodes, .. } => nodes.size(),
            TracerStructure::Query { meshes, joined, tlas } => {
                let all = meshes.iter().flatten().chain(joined.iter().flatten());
                tlas.bytes() + all.map(Blas::bytes).sum::<u64>()
            }
        }
    }
}

fn build_meshes(
    device: &Arc<Device>,
    scene: &Scene,
    sets: &SharingSets,
) -> Result<Vec<Option<Blas>>, GpuError> {
    let all = || scene.meshes.iter().zip(needs(scene, sets));
    let walked = |(mesh, need): &(&Arc<crate::scene::Mesh>, Residency)| {
        *need == Residency::Structure && !mesh.triangles.is_empty()
    };
    let inputs: Vec<BlasInput<'_>> = all()
        .filter(walked)
        .map(|(mesh, _)| BlasInput {
            name: &mesh.name,
            positions: &mesh.positions,
            triangles: &mesh.triangles,
        })
        .collect();
    let mut built = Blas::build_many(device, &inputs, BlasOptions::default())?.into_iter();
    Ok(all().map(|mesh| walked(&mesh).then(|| built.next()).flatten()).collect())
}

/// Builds the structures of sets. Their triangles lie as in the arrays: member after member.
fn build_joined(
    device: &Arc<Device>,
    scene: &Scene,
    sets: &SharingSets,
) -> Result<Vec<Vec<Blas>>, GpuError> {
    let mut built = Vec::new();
    for set in &sets.all {
        let mut shapes = Vec::new();
        for shape in 0..set.shapes.len() {
            let (mut positions, mut triangles) = (Vec::new(), Vec::new());
            for &member in &set.members {
                let mesh = &scene.meshes[SharingSet::mesh(scene, member, shape)];
                triangles.extend(ordered(mesh, None, positions.len() as u32));
                positions.extend_from_slice(&mesh.positions);
            }
            let input = BlasInput { name: "joined", positions: &positions, triangles: &triangles };
            shapes.extend(Blas::build_many(device, &[input], BlasOptions::default())?);
        }
        built.push(shapes);
    }
    Ok(built)
}
