//! Pipelines of a device, whose layouts come from their SPIR-V: each is made once, whoever asks for it, and kept for the
//! next who does. Opening another scene, or another image of the same, makes none again.
//!
//! A driver may take seconds for a pipeline. So pipelines are made on threads of their own while the
//! caller goes on, or only when they are needed; the first dispatch waits for its own.

use std::collections::HashMap;
use std::ffi::CString;
use std::sync::{Arc, LazyLock, Once};

use ash::vk;
use parking_lot::Mutex;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::ahead;
use super::device::Device;
use super::error::{GpuError, during};
use super::reflect::{BindingKind, Reflection, reflect};

/// Size above which a module is compiled on a device of its own in this process, words; in another process all are.
const LARGE_MODULE_WORDS: usize = 1024;

/// Number of pipelines from which on those that nobody uses are destroyed when another is asked for. All scenes that
/// ship, with every quality, need fewer; kernels that an author edits are new with each edit.
const MOST: usize = 256;

/// Threads that make pipelines, as many at once as there are processors, in the order of the requests. Not rayon's
/// own threads: scenes are loaded with those meanwhile.
static PIPELINE_THREADS: LazyLock<ThreadPool> = LazyLock::new(|| {
    let threads = ThreadPoolBuilder::new().thread_name(|at| format!("pipelines {at}"));
    // A panic would end the process. Who needs the pipeline makes it itself, and meets the same.
    let threads = threads.panic_handler(|_| ());
    threads.build().expect("threads for pipelines")
});

/// A pipeline and its layouts, which are there from the beginning; the pipeline itself once it is made. Destroyed by
/// [`Pipelines`]: a thread that makes pipelines may hold it longer than there is a device.
pub(crate) struct Pipeline {
    /// Number that is the same for the same SPIR-V and constants.
    pub(crate) id: u64,
    pub(crate) reflection: Reflection,
    /// One per set, empty for unused numbers.
    pub(crate) set_layouts: Vec<vk::DescriptorSetLayout>,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) spirv: Vec<u32>,
    /// Whether it has the name of the kernel that was the first to use it.
    pub(crate) named: Once,
    specialization: Vec<(u32, u32)>,
    entry: CString,
    /// Names of the device and the kernel, where another device is to compile it first.
    ahead: Option<[String; 2]>,
    cache: vk::PipelineCache,
    /// Locked while it is being made.
    made: Mutex<Made>,
    raw: ash::Device,
}

/// State of a pipeline.
enum Made {
    NotYet,
    Yes(vk::Pipeline),
    /// Its device ends.
    Never,
}

/// Reason why a pipeline was not made.
pub(crate) enum NotMade {
    Vulkan(vk::Result),
    /// The driver's compiler ended its process, which is not this one.
    Compiler(ahead::Died),
}

impl NotMade {
    /// The error of a kernel on a device.
    pub(crate) fn of(self, device: &Device, kernel: &str) -> GpuError {
        match self {
            Self::Vulkan(code) => during(format!("creating the pipeline of '{kernel}'"))(code),
            Self::Compiler(died) => died.of(device, &format!("on the kernel '{kernel}'")),
        }
    }
}

/// All pipelines of a device.
#[derive(Default)]
pub(crate) struct Pipelines(Mutex<HashMap<u64, Arc<Pipeline>>>);

impl Pipelines {
    /// The pipeline of a module with these constants, which may not be made yet.
    pub(crate) fn get(
        &self,
        device: &Device,
        name: &str,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Arc<Pipeline>, GpuError> {
        let id = id(spirv, specialization);
        let mut held = self.0.lock();
        if let Some(pipeline) = held.get(&id) {
            return Ok(pipeline.clone());
        }
        if held.len() >= MOST {
            // A thread that makes one counts as its user.
            let unused = held.extract_if(|_, pipeline| Arc::strong_count(pipeline) == 1);
            // SAFETY: nobody else has it, and nobody can get it while the lock is held; submissions keep what they use.
            unused.for_each(|(_, pipeline)| unsafe { pipeline.destroy() });
        }
        let pipeline = Arc::new(Pipeline::new(device, name, id, spirv, specialization)?);
        held.insert(id, pipeline.clone());
        Ok(pipeline)
    }

    /// Destroys all of them.
    ///
    /// # Safety
    /// The device is alive, has nothing left to do and is not used any more.
    pub(crate) unsafe fn destroy(&self) {
        // SAFETY: by the contract above.
        self.0.lock().drain().for_each(|(_, pipeline)| unsafe { pipeline.destroy() });
    }
}

impl Pipeline {
    fn new(
        device: &Device,
        name: &str,
        id: u64,
        spirv: &[u32],
        specialization: &[(u32, u32)],
    ) -> Result<Self, GpuError> {
        let problem = |problem: String| GpuError::Kernel { kernel: name.into(), problem };
        let reflection = reflect(spirv, specialization).map_err(problem)?;
        check_limits(device, &reflection).map_err(problem)?;
        let worth_it = ahead::has_compiler() || spirv.len() > LARGE_MODULE_WORDS;
        let ahead = device.compiles_late() && device.kept.is_new(id) && worth_it;
        let mut pipeline = Self {
            id,
            // spirq returned the name from a NUL-terminated literal.
            entry: CString::new(reflection.entry_point.as_str()).unwrap_or_default(),
            reflection,
            set_layouts: Vec::new(),
            layout: vk::PipelineLayout::null(),
            spirv: spirv.to_vec(),
            named: Once::new(),
            specialization: specialization.to_vec(),
            ahead: ahead.then(|| [device.name().to_owned(), name.to_owned()]),
            cache: device.kept.cache(),
            made: Mutex::new(Made::NotYet),
            raw: device.raw.clone(),
        };
        let created = pipeline.create_layouts(name);
        if created.is_err() {
            // SAFETY: nobody else has seen it.
            unsafe { pipeline.destroy() };
        }
        created.map(|()| pipeline)
    }

    fn create_layouts(&mut self, name: &str) -> Result<(), GpuError> {
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
            // SAFETY: the numbers are unique; [`Self::destroy`] destroys the layout.
            let layout = unsafe { self.raw.create_descriptor_set_layout(&info, None) }
                .map_err(during(format!("creating the set layout of '{}'", name)))?;
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
        self.layout = unsafe { self.raw.create_pipeline_layout(&info, None) }
            .map_err(during(format!("creating the layout of '{}'", name)))?;
        Ok(())
    }

    /// Starts making it on another thread, unless that has been done.
    pub(crate) fn prepare(self: &Arc<Self>) {
        if self.is_made() {
            return;
        }
        let pipeline = self.clone();
        // The user of the pipeline gets the result.
        PIPELINE_THREADS.spawn_fifo(move || {
            let _ = pipeline.make_once();
        });
    }

    /// Returns whether it is made: nobody has to wait for it.
    pub(crate) fn is_made(&self) -> bool {
        self.made.try_lock().is_some_and(|made| matches!(*made, Made::Yes(_)))
    }

    /// The pipeline; waits where it is being made, and makes it where nobody does. After an error the next call tries
    /// again.
    pub(crate) fn make_once(&self) -> Result<vk::Pipeline, NotMade> {
        let mut made = self.made.lock();
        match *made {
            Made::Yes(pipeline) => Ok(pipeline),
            Made::Never => Err(NotMade::Vulkan(vk::Result::NOT_READY)),
            Made::NotYet => {
                let pipeline = self.make()?;
                *made = Made::Yes(pipeline);
                Ok(pipeline)
            }
        }
    }

    fn make(&self) -> Result<vk::Pipeline, NotMade> {
        if let Some([device, kernel]) = &self.ahead {
            let job = ahead::KernelJob {
                device: device.clone(),
                kernel: kernel.clone(),
                spirv: self.spirv.clone(),
                specialization: self.specialization.clone(),
            };
            ahead::compile(job).map_err(NotMade::Compiler)?;
        }
        let info = vk::ShaderModuleCreateInfo::default().code(&self.spirv);
        // SAFETY: the words parsed as SPIR-V; the kernels of this crate are checked by spirv-val.
        // The device is alive: it waits for this before it ends, and after that nothing is made.
        let module =
            unsafe { self.raw.create_shader_module(&info, None) }.map_err(NotMade::Vulkan)?;
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
        created.map(|made| made[0]).map_err(|(_, code)| NotMade::Vulkan(code))
    }

    /// Destroys it; waits where it is being made. Work not begun never will be.
    ///
    /// # Safety
    /// The device is alive, and neither it nor anybody else uses the pipeline any more.
    unsafe fn destroy(&self) {
        let made = std::mem::replace(&mut *self.made.lock(), Made::Never);
        // SAFETY: by the contract above; null handles are ignored.
        unsafe {
            if let Made::Yes(pipeline) = made {
                self.raw.destroy_pipeline(pipeline, None);
            }
            self.raw.destroy_pipeline_layout(self.layout, None);
            for &layout in &self.set_layouts {
                self.raw.destroy_descriptor_set_layout(layout, None);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Kernel, lone_test_device};

    fn add(device: &Arc<Device>, factor: u32) -> Kernel {
        let spirv: Vec<u32> =
            bytemuck::pod_collect_to_vec(include_bytes!("../../tests/gpu/add.spv"));
        Kernel::when_needed(device, "add", &spirv, &[(0, 32), (1, factor)]).unwrap()
    }

    #[test]
    fn a_pipeline_is_made_once_and_waits_for_the_next_who_needs_it() {
        let device = lone_test_device();
        let first = add(&device, 1);
        let made = first.pipeline().unwrap();
        assert_eq!(add(&device, 1).pipeline().unwrap(), made);
        assert_ne!(add(&device, 2).pipeline().unwrap(), made, "another constant");
        drop(first);
        assert_eq!(add(&device, 1).pipeline().unwrap(), made);
        assert_eq!(device.validation_messages(), [""; 0]);
    }

    #[test]
    fn what_nobody_uses_makes_room() {
        let device = lone_test_device();
        let used = add(&device, 0);
        let made = used.pipeline().unwrap();
        for factor in 1..3 * MOST as u32 {
            add(&device, factor);
            assert!(device.pipelines.0.lock().len() <= MOST);
        }
        assert_eq!(add(&device, 0).pipeline().unwrap(), made, "in use");
        assert_eq!(device.validation_messages(), [""; 0]);
    }
}
