//! Images that the simulation writes while the window shows others.

use std::sync::Arc;

use crate::gpu::{Device, GpuError, Image, ImageDim, ImageFormat};

/// Unread images that are kept all the same, so that none has to be made for each frame. Further images
/// that the loop releases are given back.
const SPARE: usize = 2;

/// Number of sizes of which unread images are kept: levels of quality take turns.
const SIZES: usize = 3;

/// Images that the simulation writes. Those that the window still shows or keeps, or that one of its
/// submissions reads, are not touched, so that neither waits for the other.
pub(super) struct Ring {
    name: &'static str,
    images: Vec<Image>,
    /// Sizes of the last images, the newest last.
    sizes: Vec<[u32; 3]>,
    device: Arc<Device>,
}

impl Ring {
    pub(super) fn new(device: &Arc<Device>, name: &'static str) -> Self {
        Self { name, images: Vec::new(), sizes: Vec::new(), device: device.clone() }
    }

    /// Size of all images, those held by others included, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.images.iter().map(Image::bytes).sum()
    }

    /// An image of `width` by `height` that nobody reads.
    pub(super) fn free(&mut self, [width, height]: [u32; 2]) -> Result<Image, GpuError> {
        let extent = [width, height, 1];
        self.sizes.retain(|size| *size != extent);
        self.sizes.push(extent);
        if self.sizes.len() > SIZES {
            self.sizes.remove(0);
        }
        let mut spare = [0; SIZES];
        let sizes = &self.sizes;
        self.images.retain(|image| {
            if !image.is_unshared() {
                return true;
            }
            let size = sizes.iter().position(|size| *size == image.extent());
            size.is_some_and(|size| {
                spare[size] += 1;
                spare[size] <= SPARE
            })
        });
        let fits = |image: &&Image| image.extent() == extent && image.is_unshared();
        if let Some(image) = self.images.iter().find(fits) {
            return Ok(image.clone());
        }
        let (dim, format) = (ImageDim::D2, ImageFormat::Rgba8Unorm);
        let image = Image::new(&self.device, self.name, dim, extent, format)?;
        self.images.push(image.clone());
        Ok(image)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::{Ring, SPARE};
    use crate::gpu::{lone_test_device, test_device};
    use crate::model::Cine;
    use crate::model::cine::Limit;

    #[test]
    fn memory_is_that_of_the_loop_and_is_given_back_with_it() {
        let device = lone_test_device();
        let mut ring = Ring::new(&device, "B-mode");
        let frames = 12;
        let mut cine = Cine::new(Limit { frames, bytes: 1 << 30 });
        let before = device.memory().current;
        let mut full = 0;
        for count in 1..40 {
            let image = ring.free([256, 256]).unwrap();
            cine.push(image.clone(), image.bytes(), Instant::now());
            if count == frames + 1 {
                full = device.memory().current;
            }
        }
        assert_eq!(ring.images.len(), frames + 1);
        assert_eq!(device.memory().current, full, "it does not grow any more");
        cine.clear();
        ring.free([256, 256]).unwrap();
        assert_eq!(ring.images.len(), SPARE);
        // A driver may give images of one size memory of different sizes, and more than their texels need.
        let left = device.memory().current - before;
        assert!(left >= ring.bytes() && left < (full - before) / 2, "{left} of {}", full - before);
        drop(ring);
        assert_eq!(device.memory().current, before);
    }

    #[test]
    fn held_images_are_not_written() {
        let device = test_device();
        let mut ring = Ring::new(&device, "B-mode");
        let held = ring.free([8, 8]).unwrap();
        device.upload_image(&held, &[7; 256]).unwrap();
        for _ in 0..5 {
            let other = ring.free([8, 8]).unwrap();
            device.upload_image(&other, &[9; 256]).unwrap();
        }
        assert_eq!(held.read_back().unwrap(), [7; 256]);
        // Other sizes are other sets of images; held images stay as they are.
        let [small, smaller] = [[4, 4], [2, 2]].map(|size| ring.free(size).unwrap());
        drop((small, smaller));
        let before = ring.images.len();
        ring.free([4, 4]).unwrap();
        assert_eq!(ring.images.len(), before, "it was kept");
        for size in [[5, 5], [6, 6], [7, 7]] {
            ring.free(size).unwrap();
        }
        assert_eq!(ring.images.len(), 4, "what is held, and the last three sizes");
        assert_eq!(held.extent(), [8, 8, 1]);
    }
}
