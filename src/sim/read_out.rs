//! Copies of results made within their frame, if those of the frame before were read: reading them then needs no
//! submission of its own.

use std::collections::BTreeMap;

use super::buffers::Buffers;
use super::pass::{Array, Sizes};
use crate::gpu::{Buffer, BufferKind, Commands, GpuError};

/// The copies of the last frame's results.
#[derive(Default)]
pub(super) struct ReadOut(BTreeMap<&'static str, (&'static Array, ResultCopy)>);

/// A result that was read at least once.
#[derive(Default)]
struct ResultCopy {
    copy: Option<Buffer>,
    /// True if the result of the last frame has been read.
    wanted: bool,
    /// True if the copy is of the last frame.
    is_current: bool,
}

impl ReadOut {
    /// Records copies of those results in finished `buffers`, of a frame of these sizes, that were read after the frame
    /// before.
    pub(super) fn record(
        &mut self,
        cmd: &mut Commands<'_>,
        buffers: &Buffers,
        sizes: &Sizes,
    ) -> Result<(), GpuError> {
        for (array, result) in self.0.values_mut() {
            result.is_current = std::mem::take(&mut result.wanted);
            if !result.is_current {
                continue;
            }
            let from = &buffers[*array];
            let copy = match result.copy.take().filter(|copy| copy.size() >= from.size()) {
                Some(copy) => copy,
                None => cmd.device().buffer("read out", from.size(), BufferKind::Readback)?,
            };
            cmd.copy((from, 0), (&copy, 0), buffers.bytes(array, sizes) as u64)?;
            result.copy = Some(copy);
        }
        Ok(())
    }

    /// The copy of an array of the last frame, if there is one; asks for a copy of the next.
    pub(super) fn take(&mut self, array: &'static Array) -> Option<&Buffer> {
        let (_, result) =
            self.0.entry(array.name).or_insert_with(|| (array, ResultCopy::default()));
        result.wanted = true;
        result.copy.as_ref().filter(|_| result.is_current)
    }
}
