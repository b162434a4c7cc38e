//! What a scene takes of a device's memory.

/// Bytes of a scene on the device, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Vertices, normals, indices and instance rows, of all keyframes that are kept there.
    pub geometry: u64,
    /// What rays walk: nodes, or acceleration structures with the scratch memory that they keep.
    pub structures: u64,
    /// Where deforming tissue has gone.
    pub fields: u64,
    /// The acquired volume.
    pub volume: u64,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> u64 {
        self.geometry + self.structures + self.fields + self.volume
    }
}
