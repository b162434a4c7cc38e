//! The image copied out with its frame, where the one before was read: reading it then costs no
//! submission of its own.

use crate::gpu::{Buffer, BufferKind, Commands, GpuError, Stage};

/// Where the last frame's image was copied, if it was.
#[derive(Default)]
pub(super) struct ReadOut {
    copy: Option<Buffer>,
    /// Somebody has read the last frame's image.
    wanted: bool,
    /// It holds the last frame's.
    is_current: bool,
}

impl ReadOut {
    /// Records the copy of a finished image, of which somebody has wanted the one before.
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

    /// The last frame's image, if it was copied; the next one will be.
    pub(super) fn take(&mut self) -> Option<&Buffer> {
        self.wanted = true;
        self.copy.as_ref().filter(|_| self.is_current)
    }
}
