//! The acquired volume as 3D textures, one for each of its times.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::gpu::{Device, GpuError, Image, ImageDim, ImageFormat};
use crate::scene::Acquired;
use crate::scene::fusion::TEXTURE_BUDGET as BUDGET;
use crate::volume::Voxels;

/// The textures and the meaning of their texels, which is the same at all times.
pub(crate) struct VolumeTexture {
    /// One texture per time, all on the device, so that changing the time costs nothing.
    pub(crate) images: Vec<Image>,
    /// Texel indices from voxel indices.
    pub(crate) texel_from_voxel: DAffine3,
    /// Stored values are `scale * texel + offset`.
    pub(crate) scale: f64,
    /// See `scale`.
    pub(crate) offset: f64,
    /// A warning for the user, if detail was lost on the way.
    pub(crate) warning: Option<String>,
}

/// Texels of one format.
struct Texels {
    format: ImageFormat,
    bytes: Vec<u8>,
    scale: f64,
    offset: f64,
}

impl VolumeTexture {
    /// Uploads the voxels of all times. Volumes beyond the device's limit or [`BUDGET`] are first averaged
    /// over blocks of whole voxels, in the same way at all times.
    ///
    /// # Errors
    /// A device error.
    pub(crate) fn new(device: &Arc<Device>, acquired: &Acquired) -> Result<Self, GpuError> {
        let limit = device.limits().max_image_3d as usize;
        let block = block(acquired, limit, BUDGET);
        let size = std::array::from_fn(|i| acquired.size[i].div_ceil(block[i]));
        let whole = block == [1; 3];
        let (mut images, mut meaning) = (Vec::with_capacity(acquired.volumes.len()), (1.0, 0.0));
        for voxels in &acquired.volumes {
            let averaged = (!whole).then(|| average(voxels, acquired.size, block, size));
            let voxels = averaged.as_ref().unwrap_or(voxels);
            let (image, texels) = match make(device, size, texels(voxels, acquired)) {
                // Not every device supports 16-bit images.
                Err(GpuError::Unsupported { .. }) => make(device, size, floats(voxels, acquired))?,
                made => made?,
            };
            images.push(image);
            meaning = (texels.scale, texels.offset);
        }
        let (scale, offset) = meaning;
        let step = DVec3::from(block.map(|n| n as f64));
        // The middle of the first block.
        let voxel_from_texel =
            DAffine3::from_translation((step - 1.0) / 2.0) * DAffine3::from_scale(step);
        let warning = (!whole).then(|| {
            let [x, y, z] = acquired.size;
            let [a, b, c] = size;
            let times = match acquired.volumes.len() {
                1 => String::new(),
                count => format!(" at {count} times"),
            };
            format!(
                "the volume of {x} x {y} x {z} voxels{times} is larger than this device holds (at \
                 most {limit} along an axis, {} MiB in all): averaged to {a} x {b} x {c}",
                BUDGET >> 20
            )
        });
        Ok(Self { images, texel_from_voxel: voxel_from_texel.inverse(), scale, offset, warning })
    }
}

impl VolumeTexture {
    /// Texels along each axis.
    pub(crate) fn extent(&self) -> [u32; 3] {
        self.images[0].extent()
    }

    /// Bytes of all textures.
    pub(crate) fn bytes(&self) -> u64 {
        self.images.iter().map(Image::bytes).sum()
    }

    /// The texels of one time as a kernel fetches them, floats.
    pub(crate) fn read(&self, time: usize) -> Result<Vec<u8>, GpuError> {
        let image = &self.images[time];
        let bytes = image.read_back()?;
        let floats: Vec<f32> = match image.format() {
            ImageFormat::R8Unorm => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
            ImageFormat::R16Unorm => {
                let words: Vec<u16> = bytemuck::pod_collect_to_vec(&bytes);
                words.iter().map(|&w| f32::from(w) / 65535.0).collect()
            }
            ImageFormat::R32Float | ImageFormat::Rgba8Unorm => return Ok(bytes),
        };
        Ok(bytemuck::cast_slice(&floats).to_vec())
    }
}

fn make(
    device: &Arc<Device>,
    size: [usize; 3],
    texels: Texels,
) -> Result<(Image, Texels), GpuError> {
    let extent = size.map(|n| n as u32);
    let image = Image::new(device, "acquired volume", ImageDim::D3, extent, texels.format)?;
    device.upload_image(&image, &texels.bytes)?;
    Ok((image, texels))
}

/// Bytes of a texel for these voxels.
fn texel_bytes(voxels: &Voxels) -> u64 {
    match voxels {
        Voxels::U8(_) | Voxels::I8(_) => 1,
        Voxels::U16(_) | Voxels::I16(_) => 2,
        Voxels::F32(_) => 4,
    }
}

/// The block of voxels along each axis that one texel stands for, such that each texture has at most `limit`
/// texels along an axis and all have at most `budget` bytes. Where blocks must grow, they grow along the axis
/// with the most texels.
fn block(acquired: &Acquired, limit: usize, budget: u64) -> [usize; 3] {
    let mut block = acquired.size.map(|n| n.div_ceil(limit));
    loop {
        let texels: [usize; 3] = std::array::from_fn(|i| acquired.size[i].div_ceil(block[i]));
        let each = texels.iter().map(|&n| n as u64).product::<u64>();
        let bytes = acquired.volumes.iter().map(|v| each * texel_bytes(v));
        if bytes.sum::<u64>() <= budget {
            return block;
        }
        let longest = (0..3).max_by_key(|&i| texels[i]).expect("three axes");
        block[longest] += 1;
    }
}

/// Means over blocks of voxels; those at the far ends may hold fewer.
fn average(voxels: &Voxels, whole: [usize; 3], block: [usize; 3], size: [usize; 3]) -> Voxels {
    let [x, y, _] = whole;
    let mut means = Vec::with_capacity(size.iter().product());
    let along = |axis: usize, at: usize| {
        let first = at * block[axis];
        first..(first + block[axis]).min(whole[axis])
    };
    for c in 0..size[2] {
        for b in 0..size[1] {
            for a in 0..size[0] {
                let (mut sum, mut count) = (0.0, 0.0);
                for k in along(2, c) {
                    for j in along(1, b) {
                        for i in along(0, a) {
                            sum += voxels.get(i + x * (j + y * k));
                            count += 1.0;
                        }
                    }
                }
                means.push(sum / count);
            }
        }
    }
    // The type of the voxels is kept, because the texture's size was computed with it.
    match voxels {
        Voxels::U8(_) => Voxels::U8(means.iter().map(|v| v.round() as u8).collect()),
        Voxels::I8(_) => Voxels::I8(means.iter().map(|v| v.round() as i8).collect()),
        Voxels::U16(_) => Voxels::U16(means.iter().map(|v| v.round() as u16).collect()),
        Voxels::I16(_) => Voxels::I16(means.iter().map(|v| v.round() as i16).collect()),
        Voxels::F32(_) => Voxels::F32(means.iter().map(|&v| v as f32).collect()),
    }
}

/// The voxels in the smallest format that holds them exactly.
fn texels(voxels: &Voxels, acquired: &Acquired) -> Texels {
    let (bytes, lowest) = match voxels {
        Voxels::U8(v) => (v.clone(), 0.0),
        Voxels::I8(v) => (v.iter().map(|&x| (x as u8) ^ 0x80).collect(), -128.0),
        Voxels::U16(v) => (bytemuck::cast_slice(v).to_vec(), 0.0),
        Voxels::I16(v) => {
            let shifted: Vec<u16> = v.iter().map(|&x| (x as u16) ^ 0x8000).collect();
            (bytemuck::cast_slice(&shifted).to_vec(), -32768.0)
        }
        Voxels::F32(_) => return floats(voxels, acquired),
    };
    let (format, scale) = match texel_bytes(voxels) {
        1 => (ImageFormat::R8Unorm, 255.0),
        _ => (ImageFormat::R16Unorm, 65535.0),
    };
    Texels { format, bytes, scale, offset: lowest }
}

/// The voxels as floats; NaN and infinities become black.
fn floats(voxels: &Voxels, acquired: &Acquired) -> Texels {
    let values = (0..voxels.len()).map(|i| match voxels.get(i) {
        v if v.is_finite() => v as f32,
        _ => acquired.black as f32,
    });
    Texels {
        format: ImageFormat::R32Float,
        bytes: bytemuck::cast_slice(&values.collect::<Vec<f32>>()).to_vec(),
        scale: 1.0,
        offset: 0.0,
    }
}

#[cfg(test)]
mod tests;
