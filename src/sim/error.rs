//! Errors of the simulation.

use super::world::WorldError;
use crate::gpu::GpuError;

/// The reason why a scene cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The Vulkan layer failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The geometry does not fit the tracer.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A packet is larger than what is kept of one.
    #[error(
        "a packet of {bytes} bytes is larger than {most}: take fewer pulses, scanlines or samples"
    )]
    Packet {
        /// Size of the packet.
        bytes: u64,
        /// Largest size.
        most: u64,
    },
}
