//! Timestamps of a device, without which it does not tell how long its stages take.

use insonify::gpu::Device;

use super::skip::{Lacking, skip};

/// True where the device's queue has timestamps; else false, with a message that times are not tested.
pub fn timestamps(device: &Device) -> bool {
    let timed = !device.info().lacks.iter().any(|lack| lack.starts_with("timestamps"));
    if !timed {
        skip(Lacking::Tool, &format!("'{}' has no timestamps", device.name()));
    }
    timed
}
