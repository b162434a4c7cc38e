//! Creation of the logical device: its queues, extensions and features.

use ash::{khr, vk};

use super::AccelSupport;
use crate::adapter::Adapter;
use crate::error::{GpuError, during};
use crate::instance::{Instance, loader_changes, loader_reads};
use crate::queues::{QueueIndex, QueuePlan};

/// Opens the logical device with the queues of `plan`, and whatever this program can use of what the adapter offers.
pub(super) fn device(
    instance: &Instance,
    adapter: &Adapter,
    plan: &QueuePlan,
    window: bool,
) -> Result<ash::Device, GpuError> {
    // The window's picture should not wait for the simulation's.
    let priority = |family, index| match window && plan.window == (QueueIndex { family, index }) {
        true => 1.0,
        false => 0.5,
    };
    let families = plan.families();
    let priorities: Vec<Vec<f32>> = (families.iter())
        .map(|&(family, count)| (0..count).map(|index| priority(family, index)).collect())
        .collect();
    let queues: Vec<_> = (families.iter().zip(&priorities))
        .map(|(&(family, _), priorities)| {
            vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(priorities)
        })
        .collect();
    let mut extensions = Vec::new();
    if adapter.portability_subset {
        extensions.push(khr::portability_subset::NAME.as_ptr());
    }
    if window {
        extensions.push(khr::swapchain::NAME.as_ptr());
    }
    let features = vk::PhysicalDeviceFeatures {
        // Out-of-bounds accesses then have a defined result instead of a random crash; it costs
        // time on a GPU, so only while validating.
        robust_buffer_access: (instance.validating && adapter.robust_buffer_access).into(),
        shader_storage_image_extended_formats: adapter.extended_storage_formats.into(),
        ..Default::default()
    };
    let mut info =
        vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&features);
    let mut address = vk::PhysicalDeviceBufferDeviceAddressFeatures::default()
        .buffer_device_address(adapter.buffer_device_address);
    let mut accel =
        vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
    let mut pipeline =
        vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
    if adapter.info.acceleration_structure {
        extensions.push(khr::acceleration_structure::NAME.as_ptr());
        extensions.push(khr::deferred_host_operations::NAME.as_ptr());
        info = info.push_next(&mut address).push_next(&mut accel);
    }
    if adapter.info.ray_query {
        extensions.push(khr::ray_query::NAME.as_ptr());
        info = info.push_next(&mut query);
    } else if adapter.info.acceleration_structure {
        extensions.push(khr::ray_tracing_pipeline::NAME.as_ptr());
        info = info.push_next(&mut pipeline);
    }
    let info = info.enabled_extension_names(&extensions);
    let _changing = loader_changes();
    // SAFETY: extensions and features were found on this device; all pointers outlive the call.
    unsafe { instance.raw.create_device(adapter.physical, &info, None) }
        .map_err(during(format!("opening the device '{}'", adapter.info.name)))
}

/// Returns what acceleration structures are made with; none where the adapter has none.
pub(super) fn accel_support(
    instance: &Instance,
    raw: &ash::Device,
    adapter: &Adapter,
) -> Option<AccelSupport> {
    if !adapter.info.acceleration_structure {
        return None;
    }
    let mut accel = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut accel);
    // SAFETY: the device offers the extension whose properties are asked for.
    unsafe {
        instance.raw.get_physical_device_properties2(adapter.physical, &mut properties);
    }
    let _reading = loader_reads();
    Some(AccelSupport {
        functions: khr::acceleration_structure::Device::new(&instance.raw, raw),
        scratch_alignment: accel.min_acceleration_structure_scratch_offset_alignment.max(1).into(),
        max_primitives: accel.max_primitive_count,
        max_instances: accel.max_instance_count,
    })
}
