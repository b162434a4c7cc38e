//! Images that the simulation writes while the window shows others.

use std::sync::Arc;

use crate::gpu::{Device, GpuError, Image, ImageDim, ImageFormat};

/// Images of one size. Those that the window still shows, or that a submission of its reads, are
/// left alone, so that neither waits for the other.
pub(super) struct Ring {
    images: Vec<Image>,
    device: Arc<Device>,
}

impl Ring {
    pub(super) fn new(device: &Arc<Device>) -> Self {
        Self {
            images: Vec::new(),
            device: device.clone(),
        }
    }

    /// An image of `width` by `height` that nobody reads.
    pub(super) fn free(&mut self, [width, height]: [u32; 2]) -> Result<Image, GpuError> {
        let extent = [width, height, 1];
        self.images.retain(|image| image.extent() == extent);
        if let Some(image) = self.images.iter().find(|image| image.is_unshared()) {
            return Ok(image.clone());
        }
        let (dim, format) = (ImageDim::D2, ImageFormat::Rgba8Unorm);
        let image = Image::new(&self.device, "B-mode", dim, extent, format)?;
        self.images.push(image.clone());
        Ok(image)
    }
}
