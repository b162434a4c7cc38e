//! Blood that flows: what its scatterers have been carried by until a frame.

use super::{World, padded};
use crate::fields::Carried;
use crate::gpu::{Commands, GpuError};
use crate::scene::Scene;

impl World {
    /// Records what has flowed since the last call. Returns true if anything has.
    pub(super) fn carry(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<bool, GpuError> {
        let carried = self.fields.carry(scene);
        self.write(commands, &carried)?;
        Ok(!carried.is_empty())
    }

    /// Records what will have flowed `after` seconds from the scene's time, for dispatches behind it: at 0 what has flowed now.
    pub(crate) fn carry_on(
        &self,
        commands: &mut Commands<'_>,
        scene: &Scene,
        after: f64,
    ) -> Result<(), GpuError> {
        self.write(commands, &self.fields.carried(scene, after))
    }

    fn write(&self, commands: &mut Commands<'_>, carried: &[Carried]) -> Result<(), GpuError> {
        for (at, vectors) in carried {
            let place = u64::from(*at) * size_of::<[f32; 4]>() as u64;
            commands.write(&self.geometry.fields, place, bytemuck::cast_slice(&padded(vectors)))?;
        }
        Ok(())
    }
}
