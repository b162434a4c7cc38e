//! The buffers of the frame, by name.

use std::collections::BTreeMap;
use std::ops::Index;
use std::sync::Arc;

use super::pass::{Array, Sizes};
use super::stages;
use crate::gpu::{Buffer, BufferKind, Commands, Device, GpuError};
use crate::scene::Scene;

/// All buffers of the frame but the geometry; made when a frame of the scene first needs them.
pub(super) struct Buffers {
    made: BTreeMap<&'static str, (&'static Array, Buffer)>,
    /// The sizes for which they have room.
    room: Sizes,
}

impl Buffers {
    /// The buffers that frames of `scene` need, for sizes up to `room`.
    pub(super) fn new(device: &Arc<Device>, scene: &Scene, room: Sizes) -> Result<Self, GpuError> {
        let mut buffers = Self { made: BTreeMap::new(), room };
        buffers.add(device, stages::needed(scene))?;
        Ok(buffers)
    }

    /// Makes those of `arrays` that do not exist yet.
    pub(super) fn add(
        &mut self,
        device: &Arc<Device>,
        arrays: impl Iterator<Item = &'static Array>,
    ) -> Result<(), GpuError> {
        let missing: Vec<_> = arrays.filter(|array| !self.has(array.name)).collect();
        let within = |array: &&&Array| array.within.is_some();
        for array in missing.iter().filter(|array| !within(array)) {
            let guests = missing.iter().filter(|guest| guest.within == Some(array.name));
            let bytes = guests.chain([array]).map(|a| a.bytes(&self.room)).max().unwrap_or(0);
            let buffer = device.buffer(array.name, bytes.max(16), BufferKind::Storage)?;
            self.made.insert(array.name, (array, buffer));
        }
        for guest in missing.iter().filter(within) {
            let host = self[guest.within.unwrap_or_default()].clone();
            self.made.insert(guest.name, (guest, host));
        }
        Ok(())
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.made.contains_key(name)
    }

    /// True if all have room for frames of `sizes`.
    pub(super) fn hold(&self, sizes: &Sizes) -> bool {
        self.made.values().all(|(array, buffer)| buffer.size() >= array.bytes(sizes))
    }

    /// The sizes for which they have room.
    pub(super) fn room(&self) -> &Sizes {
        &self.room
    }

    /// The arrays with memory of their own, ordered by name.
    pub(super) fn arrays(&self) -> Vec<&'static Array> {
        self.made.values().map(|(array, _)| *array).filter(|a| a.within.is_none()).collect()
    }

    /// Sets to zero the buffers to which kernels add.
    pub(super) fn clear(&self, cmd: &mut Commands<'_>) {
        for (_, buffer) in self.made.values().filter(|(array, _)| array.zeroed) {
            cmd.fill(buffer, 0);
        }
    }

    /// The content of buffer `name` after the last frame, which had these `sizes`.
    pub(super) fn read(
        &self,
        device: &Arc<Device>,
        name: &str,
        sizes: &Sizes,
    ) -> Result<Vec<u8>, GpuError> {
        let (array, buffer) = &self.made[name];
        let mut bytes = vec![0; array.bytes(sizes) as usize];
        device.read_into(buffer, 0, &mut bytes)?;
        Ok(bytes)
    }
}

impl Index<&str> for Buffers {
    type Output = Buffer;

    fn index(&self, name: &str) -> &Buffer {
        let made = self.made.get(name);
        &made.unwrap_or_else(|| panic!("no stage of this scene makes '{name}'")).1
    }
}
