//! A copy of the image made within its frame, if the image before was read: reading it then needs no
//! submission of its own.

use crate::gpu::{Buffer, BufferKind, Commands, GpuError, Stage};

/// The copy of the last frame's image, if there is one.
#[derive(Default)]
pub(super) struct ReadOut {
    copy: Option<Buffer>,
    /// True if the image of the last frame has been read.
    wanted: bool,
    /// True if the copy is of the last frame.
    is_current: bool,
}

impl ReadOut {
    /// Records the copy of a finished image, if the image before was read.
    pub(super) fn record(
        &mut self,
        cmd: &mut Commands<'_>,
        pixels: &Buffer,
    ) -> Result<(), GpuError> {
        self.is_current = std::mem::take(&mut self.wanted);
        if !self.is_current {
            return Ok(());
        }
        let size = pixels.size();
        let copy = match self.copy.take().filter(|copy| copy.size() >= size) {
            Some(copy) => copy,
            None => cmd.device().buffer("image read out", size, BufferKind::Readback)?,
        };
        cmd.copy((pixels, 0), (&copy, 0), size)?;
        cmd.barrier(Stage::Transfer, Stage::Host);
        self.copy = Some(copy);
        Ok(())
    }

    /// The copy of the last frame's image, if there is one; asks for a copy of the next.
    pub(super) fn take(&mut self) -> Option<&Buffer> {
        self.wanted = true;
        self.copy.as_ref().filter(|_| self.is_current)
    }
}
