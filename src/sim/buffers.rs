//! The buffers of the frame, by name.

use std::collections::BTreeMap;
use std::ops::Index;
use std::sync::Arc;

use super::pass::{Array, Sizes};
use super::tables;
use crate::gpu::{Buffer, BufferKind, Commands, Device, GpuError};

/// All buffers of the frame but the geometry; made when a frame of the scene first needs them.
pub(super) struct Buffers {
    made: BTreeMap<&'static str, (&'static Array, Buffer)>,
    /// The sizes for which they have room.
    room: Sizes,
}

impl Buffers {
    /// Buffers of `arrays`, for sizes up to `room`.
    pub(super) fn new(
        device: &Arc<Device>,
        arrays: impl Iterator<Item = &'static Array>,
        room: Sizes,
    ) -> Result<Self, GpuError> {
        let mut buffers = Self { made: BTreeMap::new(), room };
        buffers.add(device, arrays)?;
        Ok(buffers)
    }

    /// Buffers of `arrays` once more, but for the tables, which are shared.
    pub(super) fn beside(
        &self,
        device: &Arc<Device>,
        arrays: impl Iterator<Item = &'static Array>,
    ) -> Result<Self, GpuError> {
        let shared =
            tables::ARRAYS.iter().filter_map(|(array, _)| self.made.get_key_value(array.name));
        let made = shared.map(|(name, (array, buffer))| (*name, (*array, buffer.clone())));
        let mut buffers = Self { made: made.collect(), room: self.room };
        buffers.add(device, arrays)?;
        Ok(buffers)
    }

    /// Bytes of the buffers that no other lane shares.
    pub(super) fn own_bytes(&self) -> u64 {
        let own = |(array, _): &&(&Array, Buffer)| {
            array.within.is_none() && !tables::ARRAYS.iter().any(|(shared, _)| shared == array)
        };
        self.made.values().filter(own).map(|(_, buffer)| buffer.size()).sum()
    }

    /// Makes those of `arrays` that do not exist yet.
    pub(super) fn add(
        &mut self,
        device: &Arc<Device>,
        arrays: impl Iterator<Item = &'static Array>,
    ) -> Result<(), GpuError> {
        let missing: Vec<_> = arrays.filter(|array| !self.has(array)).collect();
        let within = |array: &&&Array| array.within.is_some();
        for array in missing.iter().filter(|array| !within(array)) {
            let guests = missing.iter().filter(|guest| guest.within == Some(array));
            let bytes = guests.chain([array]).map(|a| a.bytes(&self.room)).max().unwrap_or(0);
            let buffer = device.buffer(array.name, bytes.max(16), BufferKind::Storage)?;
            self.made.insert(array.name, (array, buffer));
        }
        for guest in missing.iter().filter(within) {
            let host = self[guest.within.expect("a guest")].clone();
            self.made.insert(guest.name, (guest, host));
        }
        Ok(())
    }

    pub(super) fn has(&self, array: &Array) -> bool {
        self.made.contains_key(array.name)
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

    /// Sets to zero what a frame of these sizes uses of the buffers to which kernels add.
    pub(super) fn clear(&self, cmd: &mut Commands<'_>, sizes: &Sizes) {
        for (array, buffer) in self.made.values().filter(|(array, _)| array.zeroed) {
            cmd.fill_first(buffer, array.bytes(sizes).clamp(4, buffer.size()), 0);
        }
    }

    /// Bytes of an array that a frame of these `sizes` uses.
    pub(super) fn bytes(&self, array: &Array, sizes: &Sizes) -> usize {
        self.made[array.name].0.bytes(sizes) as usize
    }
}

impl Index<&Array> for Buffers {
    type Output = Buffer;

    fn index(&self, array: &Array) -> &Buffer {
        let made = self.made.get(array.name);
        &made.unwrap_or_else(|| panic!("no stage of this scene makes '{}'", array.name)).1
    }
}
