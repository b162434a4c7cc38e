//! Shapes that a program sets while frames are made: vertices of a mesh whose triangles stay.

use super::arrays::Averages;
use super::{World, WorldError, padded};
use crate::gpu::Commands;
use crate::scene::Scene;
use crate::scene::smoothed::{self, smoothed};

impl World {
    /// Records the shapes that were set since the last call: vertices, normals and the displacements of the tissue.
    pub(super) fn take_shapes(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<(), WorldError> {
        for (i, instance) in scene.instances.iter().enumerate() {
            let revision = instance.keyframes.revision;
            if self.revisions[i] == revision {
                continue;
            }
            self.revisions[i] = revision;
            let mesh = &scene.meshes[instance.mesh];
            let place = &mut self.places[instance.mesh];
            place.bounds = mesh.bounds();
            let averages: Vec<Averages> = match self.averaged {
                true => smoothed(mesh, place.finest),
                false => vec![[0; smoothed::LEVELS]; mesh.positions.len()],
            };
            let first = u64::from(place.first_vertex);
            let geometry = &self.geometry;
            commands.write(
                &geometry.vertices,
                12 * first,
                bytemuck::cast_slice(&mesh.positions),
            )?;
            commands.write(&geometry.normals, 12 * first, bytemuck::cast_slice(&mesh.normals))?;
            let at = size_of::<Averages>() as u64 * first;
            commands.write(&geometry.smoothed, at, bytemuck::cast_slice(&averages))?;
            if let Some(range) = self.fields.follow_shape(scene, i) {
                let vectors = padded(&self.fields.values[range.clone()]);
                let at = (size_of::<[f32; 4]>() * range.start) as u64;
                commands.write(&geometry.fields, at, bytemuck::cast_slice(&vectors))?;
            }
        }
        Ok(())
    }
}
