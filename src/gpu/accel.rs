//! The common part of bottom and top level: the structure itself, its geometry and sizes, scratch
//! memory, compacted sizes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;

use super::commands::Commands;
use super::device::{AccelSupport, Device};
use super::error::{GpuError, during};
use super::memory::{Buffer, BufferKind};

/// The Vulkan structure behind [`Blas`] and [`super::Tlas`].
pub(crate) struct RawAccel {
    pub(crate) handle: vk::AccelerationStructureKHR,
    pub(crate) name: String,
    pub(crate) buffer: Buffer,
    /// Number of builds and refits of a structure that changes; a top level must be built after the last.
    builds: AtomicU64,
    device: Arc<Device>,
}

impl RawAccel {
    pub(crate) fn new(
        device: &Arc<Device>,
        name: &str,
        ty: vk::AccelerationStructureTypeKHR,
        size: u64,
    ) -> Result<Self, GpuError> {
        let accel = device.require_accel()?;
        let buffer = device.buffer(name, size, BufferKind::AccelerationStructure)?;
        let info = vk::AccelerationStructureCreateInfoKHR::default()
            .buffer(buffer.0.handle)
            .size(size)
            .ty(ty);
        // SAFETY: the buffer has the usage and the size, and lives as long as the structure.
        let handle = unsafe { accel.functions.create_acceleration_structure(&info, None) }
            .map_err(during(format!("creating the structure '{name}'")))?;
        device.set_name(handle, name);
        Ok(Self {
            handle,
            name: name.into(),
            buffer,
            builds: AtomicU64::new(0),
            device: device.clone(),
        })
    }

    /// Counts a build or refit that makes the top levels over this structure stale.
    pub(crate) fn note_build(&self) {
        self.builds.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn builds(&self) -> u64 {
        self.builds.load(Ordering::Relaxed)
    }

    pub(crate) fn address(&self) -> vk::DeviceAddress {
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default()
            .acceleration_structure(self.handle);
        let accel = self.device.require_accel().expect("checked at creation");
        // SAFETY: the structure is alive.
        unsafe { accel.functions.get_acceleration_structure_device_address(&info) }
    }
}

impl Drop for RawAccel {
    fn drop(&mut self) {
        if let Some(accel) = &self.device.accel {
            // SAFETY: submissions and top levels keep what they use alive.
            unsafe {
                accel.functions.destroy_acceleration_structure(self.handle, None);
            }
        }
    }
}

/// Geometry of opaque triangles: packed single-precision vertices and 32-bit indices at these addresses.
pub(crate) fn triangles<'a>(
    vertices: vk::DeviceAddress,
    vertex_count: u32,
    indices: vk::DeviceAddress,
) -> vk::AccelerationStructureGeometryKHR<'a> {
    let at = |device_address| vk::DeviceOrHostAddressConstKHR { device_address };
    let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
        .vertex_format(vk::Format::R32G32B32_SFLOAT)
        .vertex_data(at(vertices))
        .vertex_stride(12)
        .max_vertex(vertex_count - 1)
        .index_type(vk::IndexType::UINT32)
        .index_data(at(indices));
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
        .flags(vk::GeometryFlagsKHR::OPAQUE)
}

/// Memory that a build of one geometry of `count` primitives needs.
pub(crate) fn build_sizes<'a>(
    accel: &AccelSupport,
    info: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    count: u32,
) -> vk::AccelerationStructureBuildSizesInfoKHR<'a> {
    let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
    // SAFETY: addresses are ignored in a size query; one geometry, one count.
    unsafe {
        accel.functions.get_acceleration_structure_build_sizes(
            vk::AccelerationStructureBuildTypeKHR::DEVICE,
            info,
            &[count],
            &mut sizes,
        );
    }
    sizes
}

/// Scratch memory whose address is aligned as the device asks.
pub(crate) struct Scratch {
    pub(crate) buffer: Buffer,
    pub(crate) address: vk::DeviceAddress,
}

impl Scratch {
    pub(crate) fn new(device: &Arc<Device>, bytes: u64) -> Result<Self, GpuError> {
        let alignment = device.require_accel()?.scratch_alignment;
        let buffer = device.buffer("scratch", bytes + alignment, BufferKind::Scratch)?;
        let address = buffer.device_address().next_multiple_of(alignment);
        Ok(Self { buffer, address })
    }
}

/// Records a build of `count` primitives, or a refit where `info` says so.
///
/// # Safety
/// The geometry of `info` has that many primitives in memory that can be read; `structure` and
/// `scratch` are as large as `build_sizes` says for it, and a refitted structure was built with the
/// same topology; the submission keeps all of them alive.
pub(crate) unsafe fn record_build(
    commands: &Commands<'_>,
    info: vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
    structure: &RawAccel,
    scratch: &Scratch,
    count: u32,
) -> Result<(), GpuError> {
    let mut info = info
        .dst_acceleration_structure(structure.handle)
        .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.address });
    if info.mode == vk::BuildAccelerationStructureModeKHR::UPDATE {
        info = info.src_acceleration_structure(structure.handle);
    }
    let range = vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count);
    let accel = structure.device.require_accel()?;
    // SAFETY: the caller's promise.
    unsafe {
        accel.functions.cmd_build_acceleration_structures(commands.raw(), &[info], &[&[range]]);
    }
    Ok(())
}

/// Queries for the sizes after compaction.
pub(crate) struct CompactedSizes {
    pool: vk::QueryPool,
    count: u32,
    device: Arc<Device>,
}

impl CompactedSizes {
    const TYPE: vk::QueryType = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;

    pub(crate) fn new(device: &Arc<Device>, count: u32) -> Result<Self, GpuError> {
        let info = vk::QueryPoolCreateInfo::default().query_type(Self::TYPE).query_count(count);
        // SAFETY: acceleration structures are on (checked by the caller); `Drop` destroys it.
        let pool = unsafe { device.raw.create_query_pool(&info, None) }
            .map_err(during("creating the queries for compacted sizes"))?;
        Ok(Self { pool, count, device: device.clone() })
    }

    pub(crate) fn record(
        &self,
        commands: &Commands<'_>,
        structures: &[Arc<RawAccel>],
    ) -> Result<(), GpuError> {
        let accel = self.device.require_accel()?;
        let handles: Vec<_> = structures.iter().map(|s| s.handle).collect();
        // SAFETY: the pool has one query per structure and lives until `once` returns.
        unsafe {
            let raw = commands.raw();
            let device = &self.device.raw;
            device.cmd_reset_query_pool(raw, self.pool, 0, self.count);
            accel.functions.cmd_write_acceleration_structures_properties(
                raw,
                &handles,
                Self::TYPE,
                self.pool,
                0,
            );
        }
        Ok(())
    }

    pub(crate) fn read(&self) -> Result<Vec<u64>, GpuError> {
        let mut sizes = vec![0_u64; self.count as usize];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: the submission that wrote the queries has finished.
        unsafe { self.device.raw.get_query_pool_results(self.pool, 0, &mut sizes, flags) }
            .map_err(during("reading the compacted sizes"))?;
        Ok(sizes)
    }
}

impl Drop for CompactedSizes {
    fn drop(&mut self) {
        // SAFETY: `once` has waited for the only submission that uses the pool.
        unsafe { self.device.raw.destroy_query_pool(self.pool, None) };
    }
}
