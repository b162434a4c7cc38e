//! Cost of bottom-level structures: milliseconds on the device, and memory.
//!
//! Builds need acceleration structures only, so this runs where ray queries are absent, as on GPUs
//! for data centres. Uploads are not timed; times are NaN on a device without timestamps. The first
//! builds on a GPU that was idle are slow: measure several times.

use std::sync::Arc;

use super::barrier::Stage;
use super::blas::{Blas, BlasInput, BlasOptions};
use super::device::Device;
use super::dynamic::{DynamicBlas, DynamicSource};
use super::error::GpuError;
use super::memory::BufferKind;

/// Cost of meshes that are built once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildTimes {
    /// Time of all builds, milliseconds.
    pub build_ms: f64,
    /// Time of all copies into as little memory as needed, milliseconds; 0 without compaction.
    pub compact_ms: f64,
    /// Size of the structures as built, bytes.
    pub bytes: u64,
    /// Size of the structures that remain, bytes: as built without compaction.
    pub compacted_bytes: u64,
}

/// Cost of meshes that change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RefitTimes {
    /// Time of all builds, milliseconds.
    pub build_ms: f64,
    /// Time of all refits, milliseconds.
    pub refit_ms: f64,
    /// Size of the structures with the scratch memory that they keep, bytes.
    pub bytes: u64,
}

/// Builds the meshes as [`Blas::build_many`] does, and drops them.
///
/// # Errors
/// Those of [`Blas::build_many`].
pub fn build_times(
    device: &Arc<Device>,
    inputs: &[BlasInput<'_>],
    options: BlasOptions,
) -> Result<BuildTimes, GpuError> {
    Blas::build_timed(device, inputs, options).map(|(_, times)| times)
}

/// Builds the meshes as [`DynamicBlas`], side by side, then refits them all. Geometry, structures and
/// scratch memory of all meshes are held at the same time. `fast_trace` is that of [`DynamicBlas::new`].
///
/// # Errors
/// Those of [`Blas::build_many`].
pub fn refit_times(
    device: &Arc<Device>,
    inputs: &[BlasInput<'_>],
    fast_trace: bool,
) -> Result<RefitTimes, GpuError> {
    let mut meshes = Vec::with_capacity(inputs.len());
    for input in inputs {
        input.check(device)?;
        let (positions, triangles) =
            (bytemuck::cast_slice(input.positions), bytemuck::cast_slice(input.triangles));
        let storage = |bytes: &[u8]| {
            let size = bytes.len() as u64;
            let buffer = device.buffer(input.name, size, BufferKind::Storage)?;
            device.upload(&buffer, bytes).map(|()| buffer)
        };
        let counts = [input.triangles.len() as u32, input.positions.len() as u32];
        let mesh = DynamicBlas::new(device, input.name, counts[0], counts[1], fast_trace)?;
        meshes.push((mesh, storage(positions)?, storage(triangles)?, counts));
    }
    let bytes = meshes.iter().map(|(mesh, ..)| mesh.bytes()).sum();
    let ((), timings) = device.once_timed(|commands| {
        for scope in ["build", "refit"] {
            commands.barrier(Stage::Build, Stage::Build);
            commands.scope(scope);
            for (mesh, vertices, triangles, [triangle_count, vertex_count]) in &mut meshes {
                let source = DynamicSource {
                    vertices,
                    first_vertex: 0,
                    vertex_count: *vertex_count,
                    triangles,
                    first_triangle: 0,
                    triangle_count: *triangle_count,
                };
                if scope == "build" {
                    mesh.build(commands, source)?;
                } else {
                    mesh.refit(commands, source)?;
                }
            }
        }
        Ok(())
    })?;
    Ok(RefitTimes { build_ms: timings.of("build"), refit_ms: timings.of("refit"), bytes })
}
