//! The physical devices of the machine: abilities, what is missing, and the choice of one.

use std::ffi::{CStr, CString};
use std::fmt::Write as _;
use std::sync::Once;

use ash::{khr, vk};

use super::error::{GpuError, during};
use super::instance::{Instance, loader_changes, loader_reads};
use super::queues::QueuePlan;

/// Kinds of device, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A GPU lent to a virtual machine.
    Virtual,
    /// A software driver such as lavapipe.
    Cpu,
    /// None of these.
    Other,
}

impl std::fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Cpu => "CPU",
            Self::Other => "other",
        })
    }
}

/// One physical device as `insonify info` lists it.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Position in the loader's list; what `--device INDEX` takes.
    pub index: usize,
    /// Name given by the driver.
    pub name: String,
    /// Kind of the device.
    pub kind: AdapterKind,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version, such as "1.4.305".
    pub api_version: String,
    /// Size of the largest device-local heap in bytes.
    pub memory_bytes: u64,
    /// True where the kernel with hardware ray queries can run.
    pub ray_query: bool,
    /// True where acceleration structures can be built (even where ray queries are absent).
    pub acceleration_structure: bool,
    /// True where the kernels can run at all.
    pub usable: bool,
    /// Missing abilities, each with its consequence; empty where nothing useful is missing.
    pub lacks: Vec<String>,
}

/// A physical device with the features that this layer may enable.
pub(crate) struct Adapter {
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) info: DeviceInfo,
    pub(crate) properties: vk::PhysicalDeviceProperties,
    pub(crate) families: Vec<vk::QueueFamilyProperties>,
    pub(crate) driver: vk::DriverId,
    pub(crate) buffer_device_address: bool,
    /// Ray-tracing pipelines: not used, but structures may only be built where they or ray queries
    /// are enabled (VUID-vkGetAccelerationStructureBuildSizesKHR-rayTracingPipeline-03617). Drivers
    /// without ray-tracing cores have them alone.
    pub(crate) ray_tracing_pipeline: bool,
    pub(crate) robust_buffer_access: bool,
    /// True where kernels can write R8 and R16 images.
    pub(crate) extended_storage_formats: bool,
    /// True where pictures can be shown in a window.
    pub(crate) swapchain: bool,
    /// VK_KHR_portability_subset must be enabled where it is offered.
    pub(crate) portability_subset: bool,
}

/// Devices of a machine, and its faults.
#[derive(Clone, Debug)]
pub struct Found {
    /// Every device, usable or not, in the loader's order.
    pub devices: Vec<DeviceInfo>,
    /// Sentences about drivers that the loader could not load, each with the cause.
    pub driver_faults: Vec<String>,
}

/// The Vulkan devices of the machine, and the drivers that could not be loaded.
pub fn list_devices() -> Result<Found, GpuError> {
    let instance = Instance::new(false, false)?;
    let devices = adapters(&instance)?.into_iter().map(|a| a.info).collect();
    Ok(Found { devices, driver_faults: instance.driver_faults.clone() })
}

/// A row per device, for error messages.
fn table(adapters: &[Adapter]) -> String {
    let mut text = String::new();
    for Adapter { info, .. } in adapters {
        let _ = writeln!(
            text,
            "  {}: {} ({}, {}, Vulkan {}){}",
            info.index,
            info.name,
            info.kind,
            info.driver,
            info.api_version,
            if info.usable { "" } else { " - not usable" }
        );
    }
    text
}

/// Notes that were made.
static SEVERAL: Once = Once::new();
static FAULT: Once = Once::new();

/// Notes for the user what is so for all devices that this process opens.
fn note_once(made: &Once, text: impl FnOnce() -> String) {
    made.call_once(|| insonify_base::output::note(text()));
}

/// Test of a device and one of its queue families: true where it can present to the window.
pub(crate) type Presents<'a> = dyn Fn(vk::PhysicalDevice, u32) -> bool + 'a;

/// The device named by `selector` (index, or part of the name in any case), or the best usable one, with the
/// queues to take. For a window, devices that can show pictures in it come first.
pub(crate) fn choose(
    instance: &Instance,
    selector: Option<&str>,
    presents: Option<&Presents<'_>>,
) -> Result<(Adapter, QueuePlan), GpuError> {
    let plan = |adapter: &Adapter| match presents {
        None => QueuePlan::alone(&adapter.families),
        Some(presents) => {
            let here = |family| adapter.swapchain && presents(adapter.physical, family);
            QueuePlan::with_window(&adapter.families, here)
        }
    };
    let mut adapters = adapters(instance)?;
    let chosen = match selector {
        Some(selector) => {
            let wanted = selector.to_lowercase();
            let found = match selector.parse::<usize>() {
                Ok(index) => (index < adapters.len()).then_some(index),
                Err(_) => {
                    let fits = |i: &usize| adapters[*i].info.name.to_lowercase().contains(&wanted);
                    let all: Vec<_> = (0..adapters.len()).filter(fits).collect();
                    if let [first, _, ..] = all[..] {
                        note_once(&SEVERAL, || {
                            format!(
                                "{} devices are called `{selector}`: number {first} is taken, and others by their numbers",
                                all.len()
                            )
                        });
                    }
                    all.first().copied()
                }
            };
            let refuse = |problem: String| GpuError::UnknownDevice {
                selector: selector.into(),
                problem,
                available: table(&adapters),
            };
            let found = found.ok_or_else(|| refuse("is unknown".into()))?;
            let info = &adapters[found].info;
            if !info.usable {
                return Err(refuse(format!("cannot be used: {}", info.lacks.join("; "))));
            }
            Some(found)
        }
        None => (0..adapters.len()).filter(|&i| adapters[i].info.usable).min_by_key(|&i| {
            let adapter = &adapters[i];
            let shows = plan(adapter).is_some();
            (!shows, rank(adapter.info.kind, adapter.driver))
        }),
    };
    match chosen {
        Some(index) => {
            let adapter = adapters.swap_remove(index);
            if let (AdapterKind::Cpu, Some(fault)) =
                (adapter.info.kind, instance.driver_faults.first())
            {
                note_once(&FAULT, || {
                    format!("warning: images are made on the processor: {fault}; install it again")
                });
            }
            match plan(&adapter) {
                Some(plan) => Ok((adapter, plan)),
                None => Err(GpuError::Window {
                    device: adapter.info.name,
                    reason: "it cannot present to this window".into(),
                }),
            }
        }
        None if adapters.is_empty() => Err(GpuError::no_device(&instance.driver_faults)),
        None => Err(GpuError::NoDevice { seen: format!(", of these:\n{}", table(&adapters)) }),
    }
}

/// Rank of a device; the lower, the better. Dozen, which runs on Direct3D 12, comes last: it reports the kind of
/// the device below it, and does less than the driver beside it.
fn rank(kind: AdapterKind, driver: vk::DriverId) -> (bool, AdapterKind) {
    (driver == vk::DriverId::MESA_DOZEN, kind)
}

fn adapters(instance: &Instance) -> Result<Vec<Adapter>, GpuError> {
    let changing = loader_changes();
    // SAFETY: the instance is alive.
    let physical = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(during("listing the Vulkan devices"))?;
    drop(changing);
    physical
        .into_iter()
        .enumerate()
        .map(|(index, physical)| probe(instance, index, physical))
        .collect()
}

fn probe(
    instance: &Instance,
    index: usize,
    physical: vk::PhysicalDevice,
) -> Result<Adapter, GpuError> {
    // SAFETY: `physical` was just listed by this instance.
    let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
    // The device may offer more than the instance was made for; only the lesser may be used.
    let version = properties.api_version.min(instance.api_version);
    let at_least_1_1 = version >= vk::API_VERSION_1_1;
    let at_least_1_2 = version >= vk::API_VERSION_1_2;
    let extensions = device_extensions(instance, physical)?;
    let has = |name: &CStr| extensions.iter().any(|e| e.as_c_str() == name);

    let mut address = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
    let mut accel = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let has_accel = at_least_1_2
        && has(khr::acceleration_structure::NAME)
        && has(khr::deferred_host_operations::NAME);
    let has_query = has_accel && has(khr::ray_query::NAME);
    let has_pipeline = has_accel && has(khr::ray_tracing_pipeline::NAME);
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if at_least_1_2 {
        features = features.push_next(&mut address);
    }
    if has_accel {
        features = features.push_next(&mut accel);
    }
    if has_query {
        features = features.push_next(&mut query);
    }
    if has_pipeline {
        features = features.push_next(&mut pipeline);
    }
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut properties2 = vk::PhysicalDeviceProperties2::default();
    if at_least_1_2 {
        properties2 = properties2.push_next(&mut driver);
    }
    if at_least_1_1 {
        // SAFETY: both calls are core in 1.1; each structure in the chains is offered by the device.
        unsafe {
            instance.raw.get_physical_device_features2(physical, &mut features);
            instance.raw.get_physical_device_properties2(physical, &mut properties2);
        }
    }
    let core = features.features;
    let buffer_device_address = address.buffer_device_address == vk::TRUE;
    let ray_tracing_pipeline = pipeline.ray_tracing_pipeline == vk::TRUE;
    let acceleration_structure = accel.acceleration_structure == vk::TRUE
        && buffer_device_address
        && (query.ray_query == vk::TRUE || ray_tracing_pipeline);
    let ray_query = query.ray_query == vk::TRUE && acceleration_structure;

    // SAFETY: `physical` belongs to this instance.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    let family = QueuePlan::alone(&families).map(|plan| plan.work.family as usize);
    let timestamp_bits = family.map_or(0, |f| families[f].timestamp_valid_bits);

    let mut lacks = Vec::new();
    if !at_least_1_1 {
        lacks.push("Vulkan 1.1: cannot be used".into());
    }
    if family.is_none() {
        lacks.push("a queue for compute: cannot be used".into());
    }
    if timestamp_bits == 0 {
        lacks.push("timestamps: stages are not timed".into());
    }
    if !acceleration_structure {
        lacks.push("acceleration structures: the compute tracer is used".into());
    } else if !ray_query {
        lacks.push("ray queries: the compute tracer is used".into());
    }
    Ok(Adapter {
        physical,
        info: DeviceInfo {
            index,
            name: text(properties.device_name_as_c_str().ok()),
            kind: kind(properties.device_type),
            driver: driver_text(&driver, properties.driver_version),
            api_version: version_text(properties.api_version),
            memory_bytes: device_memory(instance, physical),
            ray_query,
            acceleration_structure,
            usable: at_least_1_1 && family.is_some(),
            lacks,
        },
        properties,
        families,
        driver: driver.driver_id,
        buffer_device_address,
        ray_tracing_pipeline,
        robust_buffer_access: core.robust_buffer_access == vk::TRUE,
        extended_storage_formats: core.shader_storage_image_extended_formats == vk::TRUE,
        swapchain: has(khr::swapchain::NAME),
        portability_subset: has(khr::portability_subset::NAME),
    })
}

fn device_extensions(
    instance: &Instance,
    physical: vk::PhysicalDevice,
) -> Result<Vec<CString>, GpuError> {
    let _reading = loader_reads();
    // SAFETY: `physical` belongs to this instance.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }
        .map_err(during("listing the device extensions"))?;
    Ok(extensions
        .iter()
        .filter_map(|e| e.extension_name_as_c_str().ok().map(CStr::to_owned))
        .collect())
}

fn device_memory(instance: &Instance, physical: vk::PhysicalDevice) -> u64 {
    // SAFETY: `physical` belongs to this instance.
    let memory = unsafe { instance.raw.get_physical_device_memory_properties(physical) };
    memory
        .memory_heaps_as_slice()
        .iter()
        .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(|heap| heap.size)
        .max()
        .unwrap_or(0)
}

fn kind(kind: vk::PhysicalDeviceType) -> AdapterKind {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => AdapterKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => AdapterKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => AdapterKind::Virtual,
        vk::PhysicalDeviceType::CPU => AdapterKind::Cpu,
        _ => AdapterKind::Other,
    }
}

fn text(name: Option<&CStr>) -> String {
    name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn version_text(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}

/// Name and version of the driver. Vulkan 1.2 gives the name; older drivers only a number of their own making.
fn driver_text(driver: &vk::PhysicalDeviceDriverProperties<'_>, version: u32) -> String {
    let name = text(driver.driver_name_as_c_str().ok());
    let info = text(driver.driver_info_as_c_str().ok());
    if name.is_empty() {
        format!("driver version {version:#x}")
    } else {
        format!("{name} {info}").trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use ash::vk::DriverId;

    use super::{AdapterKind, rank};

    #[test]
    fn a_driver_on_another_programming_interface_comes_last() {
        let mut devices = [
            (AdapterKind::Discrete, DriverId::MESA_DOZEN),
            (AdapterKind::Cpu, DriverId::MESA_LLVMPIPE),
            (AdapterKind::Integrated, DriverId::INTEL_OPEN_SOURCE_MESA),
            (AdapterKind::Discrete, DriverId::NVIDIA_PROPRIETARY),
        ];
        devices.sort_by_key(|&(kind, driver)| rank(kind, driver));
        let drivers = devices.map(|(_, driver)| driver);
        let best = [DriverId::NVIDIA_PROPRIETARY, DriverId::INTEL_OPEN_SOURCE_MESA];
        let worst = [DriverId::MESA_LLVMPIPE, DriverId::MESA_DOZEN];
        assert_eq!(drivers, [best, worst].concat()[..]);
    }
}
