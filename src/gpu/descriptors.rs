//! Bindings of a dispatch: checked against the kernel, written into descriptor sets.

use std::sync::Arc;

use ash::vk;

use super::commands::Binding;
use super::device::Device;
use super::error::{GpuError, during};
use super::image::{Filter, ImageDim};
use super::kernel::Kernel;
use super::memory::BufferKind;
use super::reflect::{BindingInfo, BindingKind};

/// Number of descriptor sets of one pool; a frame has some tens of dispatches.
const SETS_PER_POOL: u32 = 128;

/// Pools of one slot: reset together; one more is made when all are full.
pub(crate) struct DescriptorPools {
    pools: Vec<vk::DescriptorPool>,
    /// Index of the pool in use.
    current: usize,
    device: Arc<Device>,
}

impl DescriptorPools {
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        Self { pools: Vec::new(), current: 0, device: device.clone() }
    }

    /// Frees all sets; no submission may still use them.
    pub(crate) fn reset(&mut self) -> Result<(), GpuError> {
        self.current = 0;
        for &pool in &self.pools {
            // SAFETY: the slot's submission has been waited for.
            unsafe {
                let flags = vk::DescriptorPoolResetFlags::empty();
                self.device.raw.reset_descriptor_pool(pool, flags)
            }
            .map_err(during("resetting a descriptor pool"))?;
        }
        Ok(())
    }

    /// Allocates one set per layout.
    pub(crate) fn allocate(
        &mut self,
        layouts: &[vk::DescriptorSetLayout],
    ) -> Result<Vec<vk::DescriptorSet>, GpuError> {
        if layouts.is_empty() {
            return Ok(Vec::new());
        }
        loop {
            let is_new = self.current == self.pools.len();
            if is_new {
                self.grow()?;
            }
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(self.pools[self.current])
                .set_layouts(layouts);
            // SAFETY: pool and layouts are alive; a full pool is reported (Vulkan 1.1).
            match unsafe { self.device.raw.allocate_descriptor_sets(&info) } {
                Ok(sets) => return Ok(sets),
                Err(vk::Result::ERROR_OUT_OF_POOL_MEMORY | vk::Result::ERROR_FRAGMENTED_POOL)
                    if !is_new =>
                {
                    self.current += 1
                }
                Err(code) => return Err(during("allocating descriptor sets")(code)),
            }
        }
    }

    fn grow(&mut self) -> Result<(), GpuError> {
        let size = |ty, per_set: u32| vk::DescriptorPoolSize {
            ty,
            descriptor_count: SETS_PER_POOL * per_set,
        };
        let mut sizes = vec![
            size(vk::DescriptorType::STORAGE_BUFFER, 8),
            size(vk::DescriptorType::UNIFORM_BUFFER, 2),
            size(vk::DescriptorType::STORAGE_IMAGE, 2),
            size(vk::DescriptorType::SAMPLED_IMAGE, 2),
            size(vk::DescriptorType::COMBINED_IMAGE_SAMPLER, 2),
            size(vk::DescriptorType::SAMPLER, 2),
        ];
        if self.device.supports_ray_query() {
            sizes.push(size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR, 1));
        }
        let info =
            vk::DescriptorPoolCreateInfo::default().max_sets(SETS_PER_POOL).pool_sizes(&sizes);
        // SAFETY: the sizes name only types that the device knows; `Drop` destroys the pool.
        let pool = unsafe { self.device.raw.create_descriptor_pool(&info, None) }
            .map_err(during("creating a descriptor pool"))?;
        self.pools.push(pool);
        Ok(())
    }
}

impl Drop for DescriptorPools {
    fn drop(&mut self) {
        for &pool in &self.pools {
            // SAFETY: the slot waits for its submission before it drops its pools.
            unsafe { self.device.raw.destroy_descriptor_pool(pool, None) };
        }
    }
}

impl Binding<'_> {
    /// A sentence with the reason why `self` does not fit `info`, if so.
    fn misfit(&self, info: &BindingInfo, device: &Device) -> Option<String> {
        let fits = match self {
            Self::Buffer(_) => {
                matches!(info.kind, BindingKind::StorageBuffer | BindingKind::UniformBuffer)
            }
            Self::Image(_) => {
                matches!(info.kind, BindingKind::StorageImage | BindingKind::SampledImage)
            }
            Self::Sampled(..) => info.kind == BindingKind::ImageAndSampler,
            Self::Sampler(_) => info.kind == BindingKind::Sampler,
            Self::Tlas(_) => info.kind == BindingKind::AccelerationStructure,
        };
        if !fits {
            return Some(format!("{self} was given"));
        }
        match self {
            Self::Buffer(buffer) => {
                let limit = device.limits().max_uniform_buffer_bytes;
                if buffer.kind() != BufferKind::Storage {
                    return Some(format!("{self} is of kind {:?}, not Storage", buffer.kind()));
                }
                (info.kind == BindingKind::UniformBuffer && buffer.size() > limit).then(|| {
                    format!("{self} of {} bytes exceeds the limit of {limit}", buffer.size())
                })
            }
            Self::Image(image) | Self::Sampled(image, _) => {
                let dimensions = match image.dim() {
                    ImageDim::D2 => 2,
                    ImageDim::D3 => 3,
                };
                if dimensions != info.image_dimensions {
                    return Some(format!(
                        "{self} has {dimensions} axes, the kernel's has {}",
                        info.image_dimensions
                    ));
                }
                if info.kind == BindingKind::StorageImage && !image.0.storage {
                    let format = image.format();
                    return Some(format!("this device does not write images of {format:?}"));
                }
                match self {
                    Self::Sampled(_, sampler)
                        if sampler.0.filter == Filter::Linear && !image.filters_linearly() =>
                    {
                        let format = image.format();
                        Some(format!("this device does not filter images of {format:?}"))
                    }
                    _ => None,
                }
            }
            Self::Tlas(tlas) if !tlas.is_built() => Some(format!("{self} has not been built")),
            Self::Sampler(_) | Self::Tlas(_) => None,
        }
    }
}

/// Fails unless `bindings` fit the kernel one by one.
pub(crate) fn check(
    device: &Device,
    kernel: &Kernel,
    bindings: &[Binding<'_>],
) -> Result<(), GpuError> {
    let infos = kernel.bindings();
    let refuse = |binding: String, problem: String| GpuError::Binding {
        kernel: kernel.name().into(),
        binding,
        problem,
    };
    if infos.len() != bindings.len() {
        let names: Vec<_> = infos.iter().map(ToString::to_string).collect();
        return Err(refuse(
            format!("{} bindings", bindings.len()),
            format!("it has {}: {}", infos.len(), names.join(", ")),
        ));
    }
    for (info, binding) in infos.iter().zip(bindings) {
        if let Some(problem) = binding.misfit(info, device) {
            return Err(refuse(info.to_string(), problem));
        }
    }
    Ok(())
}

/// Writes checked bindings into the sets.
pub(crate) fn write(
    device: &Device,
    kernel: &Kernel,
    bindings: &[Binding<'_>],
    sets: &[vk::DescriptorSet],
) {
    // The writes point into these, so each is complete before the first write is made.
    let buffers: Vec<_> = (bindings.iter())
        .map(|binding| match binding {
            Binding::Buffer(buffer) => {
                [vk::DescriptorBufferInfo::default().buffer(buffer.0.handle).range(vk::WHOLE_SIZE)]
            }
            _ => Default::default(),
        })
        .collect();
    let images: Vec<_> = (bindings.iter())
        .map(|binding| {
            let general = vk::DescriptorImageInfo::default().image_layout(vk::ImageLayout::GENERAL);
            [match binding {
                Binding::Image(image) => general.image_view(image.0.view),
                Binding::Sampled(image, sampler) => {
                    general.image_view(image.0.view).sampler(sampler.0.handle)
                }
                Binding::Sampler(sampler) => general.sampler(sampler.0.handle),
                Binding::Buffer(_) | Binding::Tlas(_) => general,
            }]
        })
        .collect();
    let structures: Vec<_> = (bindings.iter())
        .map(|binding| match binding {
            Binding::Tlas(tlas) => [tlas.handle()],
            _ => Default::default(),
        })
        .collect();
    let mut traced: Vec<_> = (structures.iter())
        .map(|handle| {
            vk::WriteDescriptorSetAccelerationStructureKHR::default()
                .acceleration_structures(handle)
        })
        .collect();
    let writes: Vec<_> = (kernel.bindings().iter().zip(&mut traced).enumerate())
        .map(|(at, (info, traced))| {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(sets[info.set as usize])
                .dst_binding(info.binding)
                .descriptor_type(info.kind.descriptor_type());
            match info.kind {
                BindingKind::StorageBuffer | BindingKind::UniformBuffer => {
                    write.buffer_info(&buffers[at])
                }
                BindingKind::AccelerationStructure => write.descriptor_count(1).push_next(traced),
                _ => write.image_info(&images[at]),
            }
        })
        .collect();
    // SAFETY: `check` matched kinds and numbers; the sets are new and not in use; all objects are
    // alive and kept by the submission.
    unsafe { device.raw.update_descriptor_sets(&writes, &[]) };
}
