//! Compute pipelines whose layouts come from their SPIR-V.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;

use super::device::Device;
use super::error::{GpuError, during};
use super::reflect::{BindingInfo, BindingKind, Reflection, reflect};

/// The Vulkan objects behind [`Kernel`].
pub(crate) struct RawKernel {
    pub(crate) name: String,
    pub(crate) reflection: Reflection,
    /// One per set, empty for numbers that are not used.
    pub(crate) set_layouts: Vec<vk::DescriptorSetLayout>,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) pipeline: vk::Pipeline,
    device: Arc<Device>,
}

/// A compute kernel. Clones refer to the same pipeline.
#[derive(Clone)]
pub struct Kernel(pub(crate) Arc<RawKernel>);

impl Kernel {
    /// Makes a pipeline from a SPIR-V compute module with one entry point. `specialization` gives
    /// constants by id, each as its 32 bits.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let problem = |problem: String| GpuError::Kernel {
            kernel: name.into(),
            problem,
        };
        let reflection = reflect(spirv, specialization).map_err(problem)?;
        check_limits(device, &reflection).map_err(problem)?;
        let mut kernel = RawKernel {
            name: name.into(),
            reflection,
            set_layouts: Vec::new(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
            device: device.clone(),
        };
        kernel.create_layouts()?;
        kernel.create_pipeline(spirv, specialization)?;
        device.set_name(kernel.pipeline, name);
        Ok(Self(Arc::new(kernel)))
    }

    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Threads of one work group per axis, as specialized.
    pub fn local_size(&self) -> [u32; 3] {
        self.0.reflection.local_size
    }

    /// Bindings in the order in which a dispatch takes them: by set, then number.
    pub fn bindings(&self) -> &[BindingInfo] {
        &self.0.reflection.bindings
    }

    /// Size of the push-constant block in bytes, 0 without one.
    pub fn push_constant_bytes(&self) -> usize {
        self.0.reflection.push_constant_bytes as usize
    }
}

impl Kernel {
    /// Whether it asks how many groups there are: a dispatch of part of them would tell it less.
    pub(crate) fn counts_groups(&self) -> bool {
        self.0.reflection.counts_groups
    }
}

fn check_limits(device: &Device, reflection: &Reflection) -> Result<(), String> {
    let limits = device.limits();
    let size = reflection.local_size;
    let threads = size.iter().map(|&n| u64::from(n)).product::<u64>();
    let too_wide = (0..3).any(|axis| size[axis] > limits.max_group_size[axis]);
    if threads == 0 || too_wide || threads > limits.max_group_threads.into() {
        return Err(format!(
            "its work group of {size:?} threads does not fit the device's {:?}, {} in all",
            limits.max_group_size, limits.max_group_threads
        ));
    }
    if reflection.push_constant_bytes > limits.max_push_constant_bytes {
        return Err(format!(
            "its push constants of {} bytes exceed the device's {}",
            reflection.push_constant_bytes, limits.max_push_constant_bytes
        ));
    }
    let buffers = (reflection.bindings.iter())
        .filter(|binding| binding.kind == BindingKind::StorageBuffer)
        .count();
    if buffers > limits.max_storage_buffers as usize {
        return Err(format!(
            "its {buffers} storage buffers exceed the device's {}",
            limits.max_storage_buffers
        ));
    }
    let traces = (reflection.bindings.iter())
        .any(|binding| binding.kind == BindingKind::AccelerationStructure);
    if traces && !device.supports_ray_query() {
        return Err(format!(
            "it needs ray queries, which '{}' lacks",
            device.name()
        ));
    }
    Ok(())
}

impl RawKernel {
    fn create_layouts(&mut self) -> Result<(), GpuError> {
        let sets = (self.reflection.bindings.last()).map_or(0, |binding| binding.set + 1);
        for set in 0..sets {
            let bindings: Vec<_> = (self.reflection.bindings.iter())
                .filter(|binding| binding.set == set)
                .map(|binding| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(binding.binding)
                        .descriptor_type(binding.kind.descriptor_type())
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            // SAFETY: the numbers are unique; `Drop` destroys the layout.
            let layout =
                unsafe { self.device.raw.create_descriptor_set_layout(&info, None) }.map_err(
                    during(format!("creating the set layout of '{}'", self.name)),
                )?;
            self.set_layouts.push(layout);
        }
        let ranges = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(self.reflection.push_constant_bytes)];
        let used = usize::from(self.reflection.push_constant_bytes > 0);
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&self.set_layouts)
            .push_constant_ranges(&ranges[..used]);
        // SAFETY: the set layouts are alive and the range lies within the limit.
        self.layout = unsafe { self.device.raw.create_pipeline_layout(&info, None) }
            .map_err(during(format!("creating the layout of '{}'", self.name)))?;
        Ok(())
    }

    fn create_pipeline(
        &mut self,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<(), GpuError> {
        let device = &self.device.raw;
        let info = vk::ShaderModuleCreateInfo::default().code(spirv);
        // SAFETY: the words parsed as SPIR-V; the kernels of this crate are checked by spirv-val.
        let module = unsafe { device.create_shader_module(&info, None) }
            .map_err(during(format!("creating the module of '{}'", self.name)))?;
        let values: Vec<u32> = specialization.iter().map(|&(_, value)| value).collect();
        let entries: Vec<_> = (specialization.iter().enumerate())
            .map(|(at, &(id, _))| {
                vk::SpecializationMapEntry::default()
                    .constant_id(id)
                    .offset(4 * at as u32)
                    .size(4)
            })
            .collect();
        let constants = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(&values));
        // spirq returned the name from a NUL-terminated literal.
        let entry = CString::new(self.reflection.entry_point.as_str()).unwrap_or_default();
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(&entry)
            .specialization_info(&constants);
        let flags = match self.device.queues.are_shared() {
            true => vk::PipelineCreateFlags::DISPATCH_BASE,
            false => vk::PipelineCreateFlags::empty(),
        };
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(flags)
            .stage(stage)
            .layout(self.layout);
        // SAFETY: module, layout and constants are alive during the call; the layout was
        // reflected from the module.
        let created =
            unsafe { device.create_compute_pipelines(self.device.pipeline_cache, &[info], None) };
        // SAFETY: a pipeline does not need its module any more.
        unsafe { device.destroy_shader_module(module, None) };
        let pipelines = created
            .map_err(|(_, code)| code)
            .map_err(during(format!("creating the pipeline of '{}'", self.name)))?;
        self.pipeline = pipelines[0];
        Ok(())
    }
}

impl Drop for RawKernel {
    fn drop(&mut self) {
        // SAFETY: submissions keep the kernels they use alive; null handles are ignored.
        unsafe {
            self.device.raw.destroy_pipeline(self.pipeline, None);
            self.device.raw.destroy_pipeline_layout(self.layout, None);
            for &layout in &self.set_layouts {
                self.device.raw.destroy_descriptor_set_layout(layout, None);
            }
        }
    }
}
