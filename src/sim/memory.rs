//! Device memory that a scene takes.

/// Bytes of a scene on the device, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Vertices, normals, indices and instance rows, of all keyframes that stay on the device.
    pub geometry: u64,
    /// Nodes of the compute tracer, or acceleration structures with the scratch memory that they keep.
    pub structures: u64,
    /// Displacement fields of deforming tissue.
    pub fields: u64,
    /// The acquired volume.
    pub volume: u64,
}

impl Memory {
    /// The sum of all kinds.
    pub fn total(&self) -> u64 {
        self.geometry + self.structures + self.fields + self.volume
    }
}
