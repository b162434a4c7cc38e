//! Where the anatomy was in the last frame, for labels that say how it has moved since.

use super::GeometryBuffers;
use crate::gpu::{Buffer, BufferKind, Commands, GpuError, Stage};

/// Rows and displacement fields of the last frame.
pub(super) struct Past {
    pub(super) instances: Buffer,
    pub(super) fields: Buffer,
    /// True if they were left behind by a world that another has replaced, and are not to be overwritten by those of
    /// the new one.
    left: bool,
}

impl Past {
    /// The buffers of a world that is about to be replaced.
    pub(super) fn left(geometry: &GeometryBuffers) -> Self {
        Self { instances: geometry.instances.clone(), fields: geometry.fields.clone(), left: true }
    }

    /// Records the copy of what `geometry` holds now, into the buffers of `kept` where they fit.
    pub(super) fn of(
        commands: &mut Commands<'_>,
        geometry: &GeometryBuffers,
        kept: Option<Self>,
    ) -> Result<Self, GpuError> {
        let (instances, fields) = match kept {
            Some(kept) if kept.left => return Ok(Self { left: false, ..kept }),
            Some(kept) => (Some(kept.instances), Some(kept.fields)),
            None => (None, None),
        };
        // The rows of a first image may have been written just now.
        commands.barrier(Stage::Transfer, Stage::Transfer);
        let past = Self {
            instances: copy(commands, "instances before", &geometry.instances, instances)?,
            fields: copy(commands, "fields before", &geometry.fields, fields)?,
            left: false,
        };
        commands.barrier(Stage::Transfer, Stage::Transfer);
        commands.barrier(Stage::Transfer, Stage::Compute);
        Ok(past)
    }
}

fn copy(
    commands: &mut Commands<'_>,
    name: &str,
    from: &Buffer,
    kept: Option<Buffer>,
) -> Result<Buffer, GpuError> {
    let size = from.size();
    let to = match kept.filter(|kept| kept.size() == size) {
        Some(kept) => kept,
        None => commands.device().buffer(name, size, BufferKind::Storage)?,
    };
    commands.copy((from, 0), (&to, 0), size)?;
    Ok(to)
}
