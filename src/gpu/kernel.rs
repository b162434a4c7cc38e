//! Compute pipelines whose layouts come from their SPIR-V.
//!
//! A driver may take seconds for a pipeline. So pipelines are made on threads of their own while the
//! caller goes on, or only when they are needed; the first dispatch waits for its own.

use std::ffi::CString;
use std::sync::{Arc, LazyLock, Once, OnceLock};

use ash::vk;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::ahead;
use super::device::Device;
use super::error::{GpuError, during};
use super::reflect::{BindingInfo, BindingKind, Reflection, reflect};

/// Size above which a module is compiled on a device of its own, words.
const LARGE_MODULE_WORDS: usize = 1024;

/// Threads that make pipelines, as many at once as there are processors, in the order of the requests. Not rayon's
/// own threads: scenes are loaded with those meanwhile.
static PIPELINE_THREADS: LazyLock<ThreadPool> = LazyLock::new(|| {
    let threads = ThreadPoolBuilder::new().thread_name(|at| format!("pipelines {at}"));
    // A panic would end the process. Who needs the pipeline makes it itself, and meets the same.
    let threads = threads.panic_handler(|_| ());
    threads.build().expect("threads for pipelines")
});

/// The Vulkan objects behind [`Kernel`].
pub(crate) struct RawKernel {
    pub(crate) name: String,
    pub(crate) reflection: Reflection,
    /// One per set, empty for unused numbers.
    pub(crate) set_layouts: Vec<vk::DescriptorSetLayout>,
    pub(crate) layout: vk::PipelineLayout,
    /// Number that is the same for the same SPIR-V and constants.
    pub(crate) id: u64,
    /// `Some` except while the kernel is created.
    pipeline: Option<Arc<Pipeline>>,
    named: Once,
    device: Arc<Device>,
}

/// A compute kernel. Clones refer to the same pipeline.
#[derive(Clone)]
pub struct Kernel(pub(crate) Arc<RawKernel>);

impl Kernel {
    /// A kernel from a SPIR-V compute module with one entry point, whose pipeline is made on another
    /// thread. `specialization` gives constants by id, each as its 32 bits.
    ///
    /// # Errors
    /// A module that does not fit the device. An error of the driver is reported by the first dispatch.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let kernel = Self::when_needed(device, name, spirv, specialization)?;
        kernel.prepare();
        Ok(kernel)
    }

    /// Like [`Self::new`], but the pipeline is not made before the first dispatch or [`Self::prepare`]:
    /// for kernels that many scenes do not need.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn when_needed(
        device: &Arc<Device>,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let problem = |problem: String| GpuError::Kernel { kernel: name.into(), problem };
        let reflection = reflect(spirv, specialization).map_err(problem)?;
        check_limits(device, &reflection).map_err(problem)?;
        let mut kernel = RawKernel {
            name: name.into(),
            reflection,
            set_layouts: Vec::new(),
            layout: vk::PipelineLayout::null(),
            id: id(spirv, specialization),
            pipeline: None,
            named: Once::new(),
            device: device.clone(),
        };
        kernel.create_layouts()?;
        let ahead = device.compiles_late()
            && device.kept.is_new(kernel.id)
            && spirv.len() > LARGE_MODULE_WORDS;
        kernel.pipeline = Some(Arc::new(Pipeline {
            ahead: ahead.then(|| [device.name().to_owned(), name.to_owned()]),
            spirv: spirv.to_vec(),
            specialization: specialization.to_vec(),
            // spirq returned the name from a NUL-terminated literal.
            entry: CString::new(kernel.reflection.entry_point.as_str()).unwrap_or_default(),
            layout: kernel.layout,
            cache: device.kept.cache(),
            raw: device.raw.clone(),
            made: OnceLock::new(),
        }));
        Ok(Self(Arc::new(kernel)))
    }

    /// The same module with other constants, as by [`Self::when_needed`].
    ///
    /// # Errors
    /// Constants that the module does not have, or that do not fit the device.
    pub fn specialized(&self, specialization: &[(u32, u32)]) -> Result<Self, GpuError> {
        let pipeline = self.0.pipeline.as_ref().expect("set at creation");
        let name = self.name();
        Self::when_needed(&self.0.device, name, &pipeline.spirv, specialization)
    }

    /// Starts making the pipeline on another thread, unless that has been started.
    pub fn prepare(&self) {
        if let Some(pipeline) = self.0.pipeline.clone() {
            // The user of the pipeline gets the result.
            PIPELINE_THREADS.spawn_fifo(move || {
                let _ = pipeline.get();
            });
        }
    }

    /// The pipeline; waits where it is being made, and makes it where nobody does.
    pub(crate) fn pipeline(&self) -> Result<vk::Pipeline, GpuError> {
        let kernel = &self.0;
        let pipeline = kernel.pipeline.as_ref().expect("set at creation");
        let made = match pipeline.made.get() {
            Some(made) => *made,
            None => {
                let _waiting = kernel.device.kept.patience([kernel.id]);
                pipeline.get()
            }
        };
        let what = || format!("creating the pipeline of '{}'", kernel.name);
        let made = made.map_err(|code| during(what())(code))?;
        kernel.named.call_once(|| kernel.device.set_name(made, &kernel.name));
        Ok(made)
    }

    /// Returns true for a kernel that has never run on this device and driver, where that is kept: its first run waits
    /// for the driver's compiler.
    pub fn is_new(&self) -> bool {
        self.0.device.kept.is_new(self.0.id)
    }

    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Number of threads of one work group per axis, as specialized.
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
    /// Returns whether it reads the number of groups: a dispatch of a part of them would give it less.
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
    if reflection.shared_bytes > limits.max_shared_bytes {
        return Err(format!(
            "its {} bytes of shared memory exceed the device's {}",
            reflection.shared_bytes, limits.max_shared_bytes
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
        return Err(format!("it needs ray queries, which '{}' lacks", device.name()));
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
            let layout = unsafe { self.device.raw.create_descriptor_set_layout(&info, None) }
                .map_err(during(format!("creating the set layout of '{}'", self.name)))?;
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
}

/// The inputs of a pipeline and, once made, the pipeline or the driver's error. It does not hold the
/// device: the kernel does, and waits for the work under way before it releases the device.
struct Pipeline {
    /// Names of the device and the kernel, where another device is to compile it first.
    ahead: Option<[String; 2]>,
    spirv: Vec<u32>,
    specialization: Vec<(u32, u32)>,
    entry: CString,
    layout: vk::PipelineLayout,
    cache: vk::PipelineCache,
    raw: ash::Device,
    made: OnceLock<Result<vk::Pipeline, vk::Result>>,
}

impl Pipeline {
    fn get(&self) -> Result<vk::Pipeline, vk::Result> {
        *self.made.get_or_init(|| self.make())
    }

    fn make(&self) -> Result<vk::Pipeline, vk::Result> {
        if let Some([device, kernel]) = &self.ahead {
            // An error there occurs here again, from the driver of the device in use.
            let _ = ahead::compile(device, kernel, &self.spirv, &self.specialization);
        }
        let info = vk::ShaderModuleCreateInfo::default().code(&self.spirv);
        // SAFETY: the words parsed as SPIR-V; the kernels of this crate are checked by spirv-val.
        // The device is alive: see the structure.
        let module = unsafe { self.raw.create_shader_module(&info, None) }?;
        let values: Vec<u32> = self.specialization.iter().map(|&(_, value)| value).collect();
        let entries: Vec<_> = (self.specialization.iter().enumerate())
            .map(|(at, &(id, _))| {
                vk::SpecializationMapEntry::default().constant_id(id).offset(4 * at as u32).size(4)
            })
            .collect();
        let constants = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(&values));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(&self.entry)
            .specialization_info(&constants);
        let info = vk::ComputePipelineCreateInfo::default()
            // A dispatch may be cut into pieces.
            .flags(vk::PipelineCreateFlags::DISPATCH_BASE)
            .stage(stage)
            .layout(self.layout);
        // SAFETY: module, layout and constants are alive during the call; the layout was reflected
        // from the module; the cache synchronises itself.
        let created = unsafe { self.raw.create_compute_pipelines(self.cache, &[info], None) };
        // SAFETY: a pipeline does not need its module any more.
        unsafe { self.raw.destroy_shader_module(module, None) };
        created.map(|made| made[0]).map_err(|(_, code)| code)
    }
}

/// A number that is the same for the same SPIR-V and constants, also in another process.
fn id(spirv: &[u32], specialization: &[(u32, u32)]) -> u64 {
    let crc = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
    let mut digest = crc.digest();
    digest.update(bytemuck::cast_slice(spirv));
    for &(id, value) in specialization {
        digest.update(bytemuck::cast_slice(&[id, value]));
    }
    digest.finalize()
}

impl Drop for RawKernel {
    fn drop(&mut self) {
        // Work under way is waited for; work not begun never will be.
        let made = (self.pipeline.as_ref())
            .and_then(|p| p.made.get_or_init(|| Err(vk::Result::NOT_READY)).ok());
        // SAFETY: submissions keep the kernels they use alive; null handles are ignored.
        unsafe {
            self.device.raw.destroy_pipeline(made.unwrap_or_default(), None);
            self.device.raw.destroy_pipeline_layout(self.layout, None);
            for &layout in &self.set_layouts {
                self.device.raw.destroy_descriptor_set_layout(layout, None);
            }
        }
    }
}
