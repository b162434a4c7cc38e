//! Why a scene cannot be simulated.

use super::world::WorldError;
use crate::gpu::GpuError;

/// Why a scene cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The Vulkan layer failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The geometry does not fit the tracer.
    #[error(transparent)]
    World(#[from] WorldError),
}
