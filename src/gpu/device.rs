//! The logical device: features, queue, allocator, object names.

mod create;
mod testing;

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use parking_lot::Mutex;

use super::adapter::{self, AdapterKind, DeviceInfo};
use super::ahead;
use super::error::GpuError;
use super::instance::{Instance, ValidationLog, loader_changes, loader_reads};
use super::kept::{self, PipelineStore};
use super::memory::{MemoryUse, MemoryUseCounter};
use super::pipelines::Pipelines;
use super::queues::Queues;

pub use testing::{LoneDevice, TestDevice, lone_device, lone_test_device, test_device};

/// Size of the blocks that the allocator takes from the driver. Its default of 256 MiB would make the memory
/// of a small scene look like that of a large one; larger buffers get a block of their own anyway.
const DEVICE_BLOCK_BYTES: u64 = 32 << 20;
const HOST_BLOCK_BYTES: u64 = 16 << 20;

/// The number that is remembered where the driver has built acceleration structures and lived: "lives", as bytes.
const STRUCTURES_TRIED: u64 = 0x6c69_7665_7300_0000;

/// Makes the test whether a device can show pictures in a window; it is dropped before the instance. The error is the
/// window system's message.
pub(super) type Showing<'a> = &'a dyn Fn(&Instance) -> Result<Box<adapter::Presents<'a>>, String>;

/// Options for opening a device.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Index in [`super::list_devices`] or part of a name in any case; `None` takes the best.
    pub selector: Option<String>,
    /// Turns the validation layers on, or fails where they are not installed. The environment
    /// variable `INSONIFY_VALIDATE=1` does the same.
    pub validate: bool,
    /// Folder in which compiled kernels are kept from one start to the next, such as
    /// [`super::cache_folder`]; without it only the driver keeps them, if it does.
    pub kept_in: Option<PathBuf>,
    /// Leaves ray queries off although the device has them; acceleration structures can still be built
    /// where it has ray-tracing pipelines.
    pub without_ray_query: bool,
    /// Leaves acceleration structures and ray queries off although the device has them.
    pub without_acceleration_structures: bool,
}

/// The limits that kernels and buffers are checked against.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest storage buffer, in bytes.
    pub max_storage_buffer_bytes: u64,
    /// Largest uniform buffer, in bytes.
    pub max_uniform_buffer_bytes: u64,
    /// Most storage buffers that one kernel may bind; at least 4 everywhere.
    pub max_storage_buffers: u32,
    /// Largest side of a 2D image, in texels.
    pub max_image_2d: u32,
    /// Largest side of a 3D image, in texels.
    pub max_image_3d: u32,
    /// Largest push-constant block, in bytes; at least 128 everywhere.
    pub max_push_constant_bytes: u32,
    /// Most work groups of one dispatch, per axis.
    pub max_group_count: [u32; 3],
    /// Most threads of one work group, per axis.
    pub max_group_size: [u32; 3],
    /// Most threads of one work group in all.
    pub max_group_threads: u32,
    /// Largest shared memory of one work group, in bytes.
    pub max_shared_bytes: u32,
}

/// Properties of the device for acceleration structures.
pub(crate) struct AccelSupport {
    pub(crate) functions: khr::acceleration_structure::Device,
    pub(crate) scratch_alignment: u64,
    pub(crate) max_primitives: u64,
    pub(crate) max_instances: u64,
}

/// An open Vulkan device. Everything made from it keeps it alive.
pub struct Device {
    pub(crate) raw: ash::Device,
    /// Nanoseconds per timestamp tick; 0 where the queue has no timestamps.
    pub(crate) timestamp_period_ns: f64,
    /// Valid bits of timestamps on all queues; 0 where one has none.
    pub(crate) timestamp_bits: u32,
    pub(crate) accel: Option<AccelSupport>,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) memory_use: MemoryUseCounter,
    pub(crate) kept: PipelineStore,
    pub(crate) pipelines: Pipelines,
    ray_query: bool,
    /// Outcome of the trial of acceleration structures, once they are needed.
    structures: OnceLock<Result<(), ahead::Died>>,
    /// True for Mesa's driver for the processor.
    jit: bool,
    info: DeviceInfo,
    limits: Limits,
    debug: Option<ext::debug_utils::Device>,
    pub(crate) queues: Queues,
    /// `None` only while the device is dropped.
    allocator: Mutex<Option<Allocator>>,
    pub(crate) instance: Instance,
}

impl Device {
    /// Opens the chosen device with one compute queue.
    ///
    /// # Errors
    /// No such device, or no usable one; missing parts for validation.
    pub fn new(options: &DeviceOptions) -> Result<Arc<Self>, GpuError> {
        Self::open(options, asked_to_validate(options), None)
    }

    /// Opens the chosen device to compile kernels on it, never with validation: each kernel is made once more on the
    /// device that needs it, and there it is validated. The layers of 1.3.239 keep all instances and devices of a process
    /// in one table, which they change without a lock; whatever another thread calls meanwhile reads it.
    pub(super) fn for_compiling(options: &DeviceOptions) -> Result<Arc<Self>, GpuError> {
        Self::open(options, false, None)
    }

    /// Opens the chosen device; with a `window`, the best one that can show pictures in it.
    pub(super) fn open(
        options: &DeviceOptions,
        validate: bool,
        window: Option<Showing<'_>>,
    ) -> Result<Arc<Self>, GpuError> {
        // Before the driver makes its folders.
        let jit_forgotten = kept::llvmpipe_has_nothing();
        let instance = Instance::new(validate, window.is_some())?;
        let presents = window.map(|showing| showing(&instance)).transpose();
        let presents = presents.map_err(|reason| GpuError::Window {
            device: options.selector.clone().unwrap_or_else(|| "any device".into()),
            reason,
        })?;
        let (mut adapter, plan) =
            adapter::choose(&instance, options.selector.as_deref(), presents.as_deref())?;
        drop(presents);
        let without = options.without_acceleration_structures;
        adapter.info.ray_query &= !(options.without_ray_query || without);
        let traces = adapter.info.ray_query || adapter.ray_tracing_pipeline;
        adapter.info.acceleration_structure &= traces && !without;
        let raw = create::device(&instance, &adapter, &plan, window.is_some())?;
        let queues = Queues::new(&raw, plan, window.is_some());
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: adapter.physical,
            debug_settings: Default::default(),
            buffer_device_address: adapter.info.acceleration_structure,
            allocation_sizes: gpu_allocator::AllocationSizes::new(
                DEVICE_BLOCK_BYTES,
                HOST_BLOCK_BYTES,
            ),
        });
        let jit = adapter.driver == vk::DriverId::MESA_LLVMPIPE;
        let kept = PipelineStore::new(
            &raw,
            &adapter.properties,
            &adapter.info.name,
            options.kept_in.as_deref(),
            jit_forgotten && jit,
        );
        let (allocator, kept) = match (allocator, kept) {
            (Ok(allocator), Ok(kept)) => (allocator, kept),
            (allocator, kept) => {
                drop(allocator);
                let _changing = loader_changes();
                // SAFETY: nothing made from the device is left but a cache, which goes first.
                unsafe {
                    if let Ok(kept) = kept {
                        kept.destroy();
                    }
                    raw.destroy_device(None);
                }
                return Err(GpuError::Vulkan {
                    code: vk::Result::ERROR_INITIALIZATION_FAILED,
                    what: "creating the allocator and the pipeline cache".into(),
                });
            }
        };
        let accel = create::accel_support(&instance, &raw, &adapter);
        let reading = loader_reads();
        let debug =
            (instance.debug_utils).then(|| ext::debug_utils::Device::new(&instance.raw, &raw));
        drop(reading);
        let limits = &adapter.properties.limits;
        let bits = |family: u32| adapter.families[family as usize].timestamp_valid_bits;
        Ok(Arc::new(Self {
            timestamp_period_ns: f64::from(limits.timestamp_period),
            timestamp_bits: bits(plan.work.family).min(bits(plan.window.family)),
            accel,
            physical: adapter.physical,
            memory_use: MemoryUseCounter::default(),
            kept,
            pipelines: Pipelines::default(),
            ray_query: adapter.info.ray_query,
            structures: OnceLock::new(),
            jit,
            limits: Limits {
                max_storage_buffer_bytes: limits.max_storage_buffer_range.into(),
                max_uniform_buffer_bytes: limits.max_uniform_buffer_range.into(),
                max_storage_buffers: limits.max_per_stage_descriptor_storage_buffers,
                max_image_2d: limits.max_image_dimension2_d,
                max_image_3d: limits.max_image_dimension3_d,
                max_push_constant_bytes: limits.max_push_constants_size,
                max_group_count: limits.max_compute_work_group_count,
                max_group_size: limits.max_compute_work_group_size,
                max_group_threads: limits.max_compute_work_group_invocations,
                max_shared_bytes: limits.max_compute_shared_memory_size,
            },
            debug,
            queues,
            allocator: Mutex::new(Some(allocator)),
            info: adapter.info,
            raw,
            instance,
        }))
    }

    /// Properties of the device, and what it lacks.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Estimate of the threads that the device runs at once: a dispatch with fewer leaves part of it idle. Vulkan
    /// does not tell; the largest GPUs have room for a quarter of a million. Drivers without a GPU run one
    /// work group per core: a few for each, so that all cores end at about the same time.
    pub fn threads_at_once(&self) -> u32 {
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
        match self.info.kind {
            AdapterKind::Cpu => 256 * cores,
            _ => 1 << 18,
        }
    }

    /// Name given by the driver.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Driver name and version.
    pub fn driver(&self) -> &str {
        &self.info.driver
    }

    /// Vulkan version of the device, such as "1.4.305".
    pub fn api_version(&self) -> &str {
        &self.info.api_version
    }

    /// Limits that kernels and buffers are checked against.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Returns whether kernels with ray queries can run.
    pub fn supports_ray_query(&self) -> bool {
        self.ray_query
    }

    /// Returns whether acceleration structures can be built.
    pub fn supports_acceleration_structure(&self) -> bool {
        self.accel.is_some()
    }

    /// Returns whether the window has to wait for submissions of the simulation: both have one queue.
    pub fn shares_queue(&self) -> bool {
        self.queues.are_shared()
    }

    /// Returns whether the validation layers are on.
    pub fn is_validating(&self) -> bool {
        self.instance.validating
    }

    /// Warnings and errors of the validation layers so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.log.messages()
    }

    /// The list behind [`Self::validation_messages`]; it outlives the device.
    pub fn validation_log(&self) -> ValidationLog {
        self.instance.log.clone()
    }

    /// Bytes of buffers, images and acceleration structures, now and at most so far.
    pub fn memory(&self) -> MemoryUse {
        self.memory_use.read()
    }

    /// Returns true for a number given to [`Self::remember`] for this device and driver, at this start or
    /// an earlier one.
    pub fn remembers(&self, what: u64) -> bool {
        self.kept.knows(what)
    }

    /// Returns true for a driver that compiles a kernel only when it first runs, and then keeps it for every device.
    pub(crate) fn compiles_late(&self) -> bool {
        self.jit && !kept::llvmpipe_has_nothing()
    }

    /// Keeps a number for later starts, if a folder for that is set.
    pub fn remember(&self, what: u64) {
        self.kept.learn([what]);
    }

    /// Acceleration-structure functions, or an error naming the device. Mesa's driver for the processor is first tried in
    /// another process, once for a device, driver and width of vectors where that is kept.
    pub(crate) fn require_accel(&self) -> Result<&AccelSupport, GpuError> {
        let accel = self.accel.as_ref().ok_or_else(|| GpuError::Unsupported {
            device: self.info.name.clone(),
            feature: "acceleration structures (VK_KHR_acceleration_structure), or they are off"
                .into(),
        })?;
        let tried = self.structures.get_or_init(|| {
            if !self.jit || !self.kept.keeps() || self.remembers(STRUCTURES_TRIED) {
                return Ok(());
            }
            ahead::build_structures(&self.info.name)?;
            self.remember(STRUCTURES_TRIED);
            Ok(())
        });
        match tried {
            Ok(()) => Ok(accel),
            Err(died) => Err(died.of(self, "while it built acceleration structures")),
        }
    }

    /// Runs `work` with the allocator.
    pub(crate) fn with_allocator<T>(&self, work: impl FnOnce(&mut Allocator) -> T) -> T {
        let mut allocator = self.allocator.lock();
        work(allocator.as_mut().expect("the device is alive"))
    }

    /// Names a Vulkan object for validation messages and profilers.
    pub(crate) fn set_name<T: vk::Handle>(&self, handle: T, name: &str) {
        let Some(debug) = &self.debug else { return };
        // A name is never worth an error: a NUL inside it only shortens it, and a failure of the
        // call leaves the object nameless.
        let text = CString::new(name.split('\0').next().unwrap_or_default()).unwrap_or_default();
        let info =
            vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&text);
        let _listed = loader_reads();
        // SAFETY: the handle was made from this device by the caller and is alive.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }

    /// Begins a named region of a command buffer (for profilers; without a profiler's own layer nothing reads it).
    /// Nothing is named while validating: the layers before 1.3.242 keep the regions of all command buffers in one map
    /// and erase from it without the lock that their other functions hold (`EraseCmdDebugUtilsLabel`), so that two threads
    /// who drop and record command buffers end the process. An empty map is safe.
    pub(crate) fn begin_label(&self, commands: vk::CommandBuffer, name: &str) {
        let Some(debug) = self.labels() else { return };
        let text = CString::new(name.split('\0').next().unwrap_or_default()).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(&text);
        // SAFETY: the caller is recording `commands`.
        unsafe { debug.cmd_begin_debug_utils_label(commands, &label) };
    }

    /// Ends the region begun last.
    pub(crate) fn end_label(&self, commands: vk::CommandBuffer) {
        let Some(debug) = self.labels() else { return };
        // SAFETY: the caller is recording `commands` and has begun a region.
        unsafe { debug.cmd_end_debug_utils_label(commands) };
    }

    fn labels(&self) -> Option<&ext::debug_utils::Device> {
        self.debug.as_ref().filter(|_| !self.is_validating())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let allocator = self.allocator.get_mut().take();
        // SAFETY: everything made from the device holds it alive, so nothing is left but the pipelines, the cache
        // and the allocator's blocks. A lost device may be destroyed without waiting.
        unsafe {
            let _ = self.raw.device_wait_idle();
            // Before the lock: one that is being made on a device of its own needs it to end.
            self.pipelines.destroy();
        }
        let _changing = loader_changes();
        drop(allocator);
        // SAFETY: as above.
        unsafe {
            self.kept.destroy();
            self.raw.destroy_device(None);
        }
    }
}

/// Returns whether the options or the environment ask for validation.
pub(super) fn asked_to_validate(options: &DeviceOptions) -> bool {
    options.validate || std::env::var_os("INSONIFY_VALIDATE").is_some_and(|v| v == "1")
}
