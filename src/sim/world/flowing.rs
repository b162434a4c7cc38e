//! Blood that flows: the device computes before a frame where each generation of its scatterers is.

use super::{ShapeKernels, World};
use crate::fields::Carried;
use crate::gpu::{Binding, Commands, GpuError, Stage};
use crate::push;
use crate::scene::Scene;

impl World {
    /// Records what has flowed since the last call. Returns true if anything has.
    pub(super) fn carry(
        &mut self,
        commands: &mut Commands<'_>,
        scene: &Scene,
    ) -> Result<bool, GpuError> {
        let carried = self.fields.carried(scene);
        if carried == self.carried {
            return Ok(false);
        }
        for Carried { head: (at, [weight, number, next]), .. } in &carried {
            let place = u64::from(*at) * size_of::<[f32; 4]>() as u64;
            let vector = [*weight, *number, *next, 0.0];
            commands.write(&self.geometry.fields, place, bytemuck::cast_slice(&vector))?;
        }
        // All lie in one buffer: a barrier between two that write it.
        commands.barrier(Stage::Transfer, Stage::Compute);
        for Carried { field, .. } in &carried {
            let push = push::Interpolate {
                count: field.count,
                target: field.target,
                sources: field.sources.map(|(at, _)| at),
                weights: field.sources.map(|(_, weight)| weight as f32),
                stride: 4,
                ..push::Interpolate::default()
            };
            let ShapeKernels { interpolate, .. } = &*self.kernels;
            let bindings = [Binding::Buffer(&self.geometry.fields)];
            commands.dispatch(
                interpolate,
                [push.count, 1, 1],
                bytemuck::bytes_of(&push),
                &bindings,
            )?;
            commands.barrier(Stage::Compute, Stage::Compute);
        }
        self.carried = carried;
        Ok(true)
    }
}
