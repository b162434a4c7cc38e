//! 2D and 3D images, always in the GENERAL layout, and samplers.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;

use super::barrier::Stage;
use super::device::Device;
use super::error::{GpuError, during};
use super::memory::{BufferKind, CountedMemory};

/// Number of axes of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageDim {
    /// Width and height.
    D2,
    /// Width, height and depth.
    D3,
}

/// Texel formats in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// One byte, 0..1 (`r8`). Lavapipe filters it with an error of up to 2.8e-3.
    R8Unorm,
    /// Two bytes, 0..1 (`r16`).
    R16Unorm,
    /// One float (`r32f`).
    R32Float,
    /// Four bytes, 0..1 (`rgba8`).
    Rgba8Unorm,
}

impl ImageFormat {
    /// Number of bytes of one texel.
    pub const fn texel_bytes(self) -> u64 {
        match self {
            Self::R8Unorm => 1,
            Self::R16Unorm => 2,
            Self::R32Float | Self::Rgba8Unorm => 4,
        }
    }

    const fn vk(self) -> vk::Format {
        match self {
            Self::R8Unorm => vk::Format::R8_UNORM,
            Self::R16Unorm => vk::Format::R16_UNORM,
            Self::R32Float => vk::Format::R32_SFLOAT,
            Self::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
        }
    }
}

/// The Vulkan image behind [`Image`].
pub(crate) struct RawImage {
    pub(crate) handle: vk::Image,
    pub(crate) view: vk::ImageView,
    pub(crate) name: String,
    pub(crate) storage: bool,
    extent: [u32; 3],
    dim: ImageDim,
    format: ImageFormat,
    filterable: bool,
    /// `Some` except while the image is created or dropped.
    memory: Option<CountedMemory>,
    device: Arc<Device>,
}

/// A named image without mip levels, sampled and, where the format allows, written by kernels.
/// Clones refer to the same memory.
#[derive(Clone)]
pub struct Image(pub(crate) Arc<RawImage>);

impl Image {
    /// Makes an image of `extent` texels (depth 1 in 2D); its content is undefined.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        dim: ImageDim,
        extent: [u32; 3],
        format: ImageFormat,
    ) -> Result<Self, GpuError> {
        Self::with_usage(device, name, dim, extent, format, vk::ImageUsageFlags::empty())
    }

    /// Makes an image of four bytes a texel on which an interface can be drawn.
    #[cfg(feature = "window")]
    pub(crate) fn drawn_on(
        device: &Arc<Device>,
        name: &str,
        [width, height]: [u32; 2],
    ) -> Result<Self, GpuError> {
        let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT;
        let extent = [width, height, 1];
        Self::with_usage(device, name, ImageDim::D2, extent, ImageFormat::Rgba8Unorm, usage)
    }

    fn with_usage(
        device: &Arc<Device>,
        name: &str,
        dim: ImageDim,
        extent: [u32; 3],
        format: ImageFormat,
        also: vk::ImageUsageFlags,
    ) -> Result<Self, GpuError> {
        check_extent(device, name, dim, extent)?;
        // SAFETY: the physical device belongs to the instance.
        let properties = unsafe {
            device.instance.raw.get_physical_device_format_properties(device.physical, format.vk())
        };
        let features = properties.optimal_tiling_features;
        use vk::{FormatFeatureFlags as Feature, ImageUsageFlags as Usage};
        if !features
            .contains(Feature::SAMPLED_IMAGE | Feature::TRANSFER_SRC | Feature::TRANSFER_DST)
        {
            return Err(GpuError::Unsupported {
                device: device.name().into(),
                feature: format!("images of {format:?} for '{name}'"),
            });
        }
        let storage = features.contains(Feature::STORAGE_IMAGE);
        let mut usage = also | Usage::SAMPLED | Usage::TRANSFER_SRC | Usage::TRANSFER_DST;
        if storage {
            usage |= Usage::STORAGE;
        }
        let sharing = device.queues.sharing();
        let mut info = vk::ImageCreateInfo::default()
            .image_type(match dim {
                ImageDim::D2 => vk::ImageType::TYPE_2D,
                ImageDim::D3 => vk::ImageType::TYPE_3D,
            })
            .format(format.vk())
            .extent(extent_3d(extent))
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // The simulation writes what the window shows.
        if let Some(families) = &sharing {
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(families);
        }
        // SAFETY: extent, format and usage were checked against the device.
        let handle = unsafe { device.raw.create_image(&info, None) }
            .map_err(during(format!("creating the image '{name}'")))?;
        let mut raw = RawImage {
            handle,
            view: vk::ImageView::null(),
            name: name.into(),
            storage,
            extent,
            dim,
            format,
            filterable: features.contains(Feature::SAMPLED_IMAGE_FILTER_LINEAR),
            memory: None,
            device: device.clone(),
        };
        raw.bind_and_view()?;
        device.set_name(handle, name);
        let image = Self(Arc::new(raw));
        device.once(|commands| {
            commands.make_general(&image);
            if device.is_validating() {
                commands.poison_image(&image);
            }
            Ok(())
        })?;
        Ok(image)
    }

    /// Returns whether there is no other clone, not even of a submission that was not waited for.
    pub fn is_unshared(&self) -> bool {
        Arc::strong_count(&self.0) == 1
    }

    /// All its texels without padding, after everything submitted so far.
    ///
    /// # Errors
    /// No memory; a lost device.
    pub fn read_back(&self) -> Result<Vec<u8>, GpuError> {
        let device = &self.0.device;
        let readback = device.buffer("readback", self.bytes(), BufferKind::Readback)?;
        device.once(|commands| {
            commands.copy_from_image(self, &readback)?;
            commands.barrier(Stage::Transfer, Stage::Host);
            Ok(())
        })?;
        let mut bytes = vec![0; self.bytes() as usize];
        // SAFETY: the copy was waited for, after a barrier to the host.
        unsafe { readback.read_mapped(&mut bytes) };
        Ok(bytes)
    }

    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Width, height and depth in texels.
    pub fn extent(&self) -> [u32; 3] {
        self.0.extent
    }

    /// Number of axes.
    pub fn dim(&self) -> ImageDim {
        self.0.dim
    }

    /// Texel format.
    pub fn format(&self) -> ImageFormat {
        self.0.format
    }

    /// Size of all texels without padding, in bytes.
    pub fn bytes(&self) -> u64 {
        let texels: u64 = self.0.extent.iter().map(|&n| u64::from(n)).product();
        texels * self.0.format.texel_bytes()
    }

    /// Returns whether a sampler with [`Filter::Linear`] may be used with it.
    pub fn filters_linearly(&self) -> bool {
        self.0.filterable
    }
}

impl RawImage {
    fn bind_and_view(&mut self) -> Result<(), GpuError> {
        let raw = &self.device.raw;
        // SAFETY: the image was just made from this device.
        let requirements = unsafe { raw.get_image_memory_requirements(self.handle) };
        let location = MemoryLocation::GpuOnly;
        let memory = CountedMemory::new(&self.device, &self.name, requirements, location, false)?;
        let (block, offset) = memory.bind();
        // SAFETY: the memory fulfils the image's requirements and is owned by it from here on.
        unsafe { raw.bind_image_memory(self.handle, block, offset) }
            .map_err(during(format!("binding memory to the image '{}'", self.name)))?;
        self.memory = Some(memory);
        let info = vk::ImageViewCreateInfo::default()
            .image(self.handle)
            .view_type(match self.dim {
                ImageDim::D2 => vk::ImageViewType::TYPE_2D,
                ImageDim::D3 => vk::ImageViewType::TYPE_3D,
            })
            .format(self.format.vk())
            .subresource_range(whole());
        // SAFETY: the image is bound and the view matches its type and format.
        self.view = unsafe { raw.create_image_view(&info, None) }
            .map_err(during(format!("creating the view of '{}'", self.name)))?;
        Ok(())
    }

    /// The copy of all texels from or to the start of a buffer without padding.
    pub(crate) fn copy_region(&self) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(extent_3d(self.extent))
    }
}

impl Drop for RawImage {
    fn drop(&mut self) {
        // SAFETY: submissions keep what they use alive; a null view is ignored.
        unsafe {
            self.device.raw.destroy_image_view(self.view, None);
            self.device.raw.destroy_image(self.handle, None);
        }
    }
}

/// The one level and layer that every image here has.
pub(crate) fn whole() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}

fn extent_3d([width, height, depth]: [u32; 3]) -> vk::Extent3D {
    vk::Extent3D { width, height, depth }
}

fn check_extent(
    device: &Device,
    name: &str,
    dim: ImageDim,
    extent: [u32; 3],
) -> Result<(), GpuError> {
    let (limit_name, limit, depth) = match dim {
        ImageDim::D2 => ("maxImageDimension2D", device.limits().max_image_2d, 1),
        ImageDim::D3 => {
            let limit = device.limits().max_image_3d;
            ("maxImageDimension3D", limit, limit)
        }
    };
    let fits = extent[0] <= limit && extent[1] <= limit && extent[2] <= depth;
    if fits && extent.iter().all(|&n| n > 0) {
        return Ok(());
    }
    Err(GpuError::TooLarge {
        name: name.into(),
        what: format!("{extent:?} texels (1 at least)"),
        limit_name,
        limit: format!("{limit} x {limit} x {depth}"),
    })
}

/// Interpolation of a sampler between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear between neighbours.
    Linear,
}

/// Value of a sampler outside the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AddressMode {
    /// The texel at the edge.
    ClampToEdge,
    /// Zero.
    Zero,
}

pub(crate) struct RawSampler {
    pub(crate) handle: vk::Sampler,
    pub(crate) filter: Filter,
    device: Arc<Device>,
}

/// A sampler with normalised coordinates.
#[derive(Clone)]
pub struct Sampler(pub(crate) Arc<RawSampler>);

impl Sampler {
    /// Makes a sampler with the same rule on all axes.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        filter: Filter,
        address: AddressMode,
    ) -> Result<Self, GpuError> {
        let vk_filter = match filter {
            Filter::Nearest => vk::Filter::NEAREST,
            Filter::Linear => vk::Filter::LINEAR,
        };
        let vk_address = match address {
            AddressMode::ClampToEdge => vk::SamplerAddressMode::CLAMP_TO_EDGE,
            AddressMode::Zero => vk::SamplerAddressMode::CLAMP_TO_BORDER,
        };
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk_filter)
            .min_filter(vk_filter)
            .address_mode_u(vk_address)
            .address_mode_v(vk_address)
            .address_mode_w(vk_address)
            .border_color(vk::BorderColor::FLOAT_TRANSPARENT_BLACK);
        // SAFETY: the structure is complete and uses no optional feature.
        let handle = unsafe { device.raw.create_sampler(&info, None) }
            .map_err(during(format!("creating the sampler '{name}'")))?;
        device.set_name(handle, name);
        Ok(Self(Arc::new(RawSampler { handle, filter, device: device.clone() })))
    }
}

impl Drop for RawSampler {
    fn drop(&mut self) {
        // SAFETY: submissions keep what they use alive.
        unsafe { self.device.raw.destroy_sampler(self.handle, None) };
    }
}
