//! The top-level acceleration structure: meshes and their places, rebuilt or refitted per frame.

use std::sync::Arc;

use ash::vk;

use super::accel::{RawAccel, Scratch, build_sizes, record_build};
use super::barrier::Stage;
use super::blas::Blas;
use super::commands::Commands;
use super::device::Device;
use super::error::GpuError;
use super::memory::{Buffer, BufferKind};

/// Size of VkAccelerationStructureInstanceKHR.
const INSTANCE_BYTES: usize = 64;

/// One mesh in the world.
#[derive(Clone, Copy)]
pub struct TlasInstance<'a> {
    /// The mesh.
    pub blas: &'a Blas,
    /// World from node, three rows of four.
    pub transform: [[f32; 4]; 3],
    /// Value that the kernel reads as `rayQueryGetIntersectionInstanceCustomIndexEXT`; 24 bits.
    pub custom_index: u32,
    /// Mask of the instance: rays whose mask shares no bit with it pass.
    pub mask: u8,
}

impl TlasInstance<'_> {
    /// The layout of VkAccelerationStructureInstanceKHR.
    fn bytes(&self) -> [u8; INSTANCE_BYTES] {
        // Both sides of a face count, whatever the ray's flags, and none is transparent.
        let flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE
            | vk::GeometryInstanceFlagsKHR::FORCE_OPAQUE;
        let mut bytes = [0; INSTANCE_BYTES];
        bytes[..48].copy_from_slice(bytemuck::bytes_of(&self.transform));
        let index_mask = self.custom_index | u32::from(self.mask) << 24;
        bytes[48..52].copy_from_slice(&index_mask.to_ne_bytes());
        bytes[52..56].copy_from_slice(&(flags.as_raw() << 24).to_ne_bytes());
        bytes[56..].copy_from_slice(&self.blas.0.address().to_ne_bytes());
        bytes
    }
}

/// A top-level structure for up to a fixed number of instances.
pub struct Tlas {
    structure: Arc<RawAccel>,
    instances: Buffer,
    scratch: Scratch,
    capacity: u32,
    /// The meshes that the structure refers to.
    bottom: Arc<Vec<Blas>>,
    /// Total number of builds of those meshes at the last build.
    bottom_builds: u64,
    /// Number of instances of the last build.
    built: Option<u32>,
}

impl Tlas {
    /// Reserves memory for up to `capacity` instances; it must be built before it is bound.
    pub fn new(device: &Arc<Device>, name: &str, capacity: u32) -> Result<Self, GpuError> {
        let accel = device.require_accel()?;
        if u64::from(capacity) > accel.max_instances {
            return Err(GpuError::TooLarge {
                name: name.into(),
                what: format!("{capacity} instances"),
                limit_name: "maxInstanceCount",
                limit: accel.max_instances.to_string(),
            });
        }
        let geometry = geometry(0);
        let info = build_info(&geometry, vk::BuildAccelerationStructureModeKHR::BUILD);
        let sizes = build_sizes(accel, &info, capacity);
        let top = vk::AccelerationStructureTypeKHR::TOP_LEVEL;
        let structure = RawAccel::new(device, name, top, sizes.acceleration_structure_size)?;
        let scratch = sizes.build_scratch_size.max(sizes.update_scratch_size);
        // The address of instances must be a multiple of 16; one instance more leaves the room.
        let bytes = (u64::from(capacity) + 1) * INSTANCE_BYTES as u64;
        let instances =
            device.buffer(&format!("{name} instances"), bytes, BufferKind::BuildInput)?;
        Ok(Self {
            structure: Arc::new(structure),
            instances,
            scratch: Scratch::new(device, scratch)?,
            capacity,
            bottom: Arc::default(),
            bottom_builds: 0,
            built: None,
        })
    }

    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.structure.name
    }

    /// Size of structure, instances and scratch in device memory, in bytes.
    pub fn bytes(&self) -> u64 {
        self.structure.buffer.size() + self.instances.size() + self.scratch.buffer.size()
    }

    /// Records a build from scratch, after the builds of meshes before it in the submission. A
    /// barrier from Build to Compute must come before rays, and one from Compute to Build after
    /// earlier rays of the same submission.
    pub fn build(
        &mut self,
        commands: &mut Commands<'_>,
        instances: &[TlasInstance<'_>],
    ) -> Result<(), GpuError> {
        let mode = vk::BuildAccelerationStructureModeKHR::BUILD;
        self.record(commands, instances, mode)
    }

    /// Records a refit: cheaper, but rays get slower as instances move away from their places at the last
    /// build. It needs as many instances as that build; otherwise it builds. Barriers as for
    /// [`Self::build`].
    pub fn refit(
        &mut self,
        commands: &mut Commands<'_>,
        instances: &[TlasInstance<'_>],
    ) -> Result<(), GpuError> {
        let mode = if self.built == Some(instances.len() as u32) {
            vk::BuildAccelerationStructureModeKHR::UPDATE
        } else {
            vk::BuildAccelerationStructureModeKHR::BUILD
        };
        self.record(commands, instances, mode)
    }

    fn record(
        &mut self,
        commands: &mut Commands<'_>,
        instances: &[TlasInstance<'_>],
        mode: vk::BuildAccelerationStructureModeKHR,
    ) -> Result<(), GpuError> {
        self.check(instances)?;
        let bytes: Vec<u8> = instances.iter().flat_map(TlasInstance::bytes).collect();
        let address = self.instances.device_address().next_multiple_of(16);
        let start = address - self.instances.device_address();
        commands.write(&self.instances, start, &bytes)?;
        commands.barrier(Stage::Transfer, Stage::Build);
        // Meshes may have been built in the same submission.
        commands.barrier(Stage::Build, Stage::Build);
        // The last submission may still trace the meshes that are replaced here: it keeps them.
        self.bottom = Arc::new(instances.iter().map(|i| i.blas.clone()).collect());
        self.bottom_builds = self.count_bottom_builds();
        let count = instances.len() as u32;
        self.built = Some(count);

        let name = self.structure.name.clone();
        let stage = Stage::Build;
        commands.uses(&self.instances.0, self.instances.name(), stage, false, "build");
        commands.uses(&self.scratch.buffer.0, "scratch", stage, true, "build");
        commands.uses(&self.structure, &name, stage, true, "build");
        commands.keep(&self.bottom);
        for blas in self.bottom.iter() {
            commands.note(&blas.0, blas.name(), stage, false, "build");
        }
        let geometry = geometry(address);
        let info = build_info(&geometry, mode);
        // SAFETY: all memory was sized for `capacity` instances, which `check` compares; the
        // submission keeps the structure, its memory and the meshes alive.
        unsafe { record_build(commands, info, &self.structure, &self.scratch, count) }
    }

    fn check(&self, instances: &[TlasInstance<'_>]) -> Result<(), GpuError> {
        let problem = if instances.len() > self.capacity as usize {
            format!("{} instances, room for {}", instances.len(), self.capacity)
        } else if let Some(i) = instances.iter().find(|i| i.custom_index >> 24 != 0) {
            format!("custom index {} exceeds 24 bits", i.custom_index)
        } else {
            return Ok(());
        };
        Err(GpuError::Geometry { name: self.name().into(), problem })
    }

    pub(crate) fn handle(&self) -> vk::AccelerationStructureKHR {
        self.structure.handle
    }

    pub(crate) fn structure(&self) -> &Arc<RawAccel> {
        &self.structure
    }

    pub(crate) fn bottom(&self) -> &Arc<Vec<Blas>> {
        &self.bottom
    }

    fn count_bottom_builds(&self) -> u64 {
        self.bottom.iter().map(|blas| blas.0.builds()).sum()
    }

    /// Returns whether a mesh was built or refitted after the last build or refit of this.
    pub(crate) fn is_stale(&self) -> bool {
        self.bottom_builds != self.count_bottom_builds()
    }

    pub(crate) fn is_built(&self) -> bool {
        self.built.is_some()
    }
}

fn geometry<'a>(address: u64) -> vk::AccelerationStructureGeometryKHR<'a> {
    let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
        .data(vk::DeviceOrHostAddressConstKHR { device_address: address });
    vk::AccelerationStructureGeometryKHR::default()
        .geometry_type(vk::GeometryTypeKHR::INSTANCES)
        .geometry(vk::AccelerationStructureGeometryDataKHR { instances })
}

fn build_info<'a>(
    geometry: &'a vk::AccelerationStructureGeometryKHR<'a>,
    mode: vk::BuildAccelerationStructureModeKHR,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    use vk::BuildAccelerationStructureFlagsKHR as Flags;
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::TOP_LEVEL)
        .flags(Flags::PREFER_FAST_TRACE | Flags::ALLOW_UPDATE)
        .mode(mode)
        .geometries(std::slice::from_ref(geometry))
}
