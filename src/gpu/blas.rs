//! Bottom-level acceleration structures: built in batches, compacted.

use std::sync::Arc;

use ash::vk;

use super::accel::{CompactedSizes, RawAccel, Scratch, build_sizes, triangles};
use super::barrier::Stage;
use super::build_times::BuildTimes;
use super::device::Device;
use super::error::GpuError;
use super::memory::{Buffer, BufferKind};

/// Bytes of input and scratch memory that one batch of builds may hold at a time.
const BATCH_BYTES: u64 = 64 << 20;

/// One mesh to be built.
#[derive(Clone, Copy, Debug)]
pub struct BlasInput<'a> {
    /// Name for messages and tools.
    pub name: &'a str,
    /// Vertices in the node's frame, in mm.
    pub positions: &'a [[f32; 3]],
    /// Three vertex numbers per triangle.
    pub triangles: &'a [[u32; 3]],
}

impl BlasInput<'_> {
    pub(crate) fn check(&self, device: &Device) -> Result<(), GpuError> {
        let problem = if self.triangles.is_empty() {
            "it has no triangles".into()
        } else if self.triangles.len() as u64 > device.require_accel()?.max_primitives {
            format!("its {} triangles exceed the device", self.triangles.len())
        } else if let Some(t) = (self.triangles.iter())
            .position(|t| t.iter().any(|&v| v as usize >= self.positions.len()))
        {
            let (triangle, vertices) = (self.triangles[t], self.positions.len());
            format!("triangle {t} is {triangle:?}, of {vertices} vertices")
        } else {
            return Ok(());
        };
        Err(GpuError::Geometry { name: self.name.into(), problem })
    }

    fn input_bytes(&self) -> u64 {
        (size_of_val(self.positions) + size_of_val(self.triangles)) as u64
    }
}

/// Options of a build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlasOptions {
    /// Spends build time on fast rays; otherwise the build is fast and rays are slower.
    pub fast_trace: bool,
    /// Copies the structure into as little memory as it needs.
    pub compact: bool,
}

impl Default for BlasOptions {
    fn default() -> Self {
        Self { fast_trace: true, compact: true }
    }
}

impl BlasOptions {
    fn flags(self) -> vk::BuildAccelerationStructureFlagsKHR {
        use vk::BuildAccelerationStructureFlagsKHR as Flags;
        let speed =
            if self.fast_trace { Flags::PREFER_FAST_TRACE } else { Flags::PREFER_FAST_BUILD };
        let compact = if self.compact { Flags::ALLOW_COMPACTION } else { Flags::empty() };
        speed | compact
    }
}

/// A bottom-level structure of one mesh with opaque triangles. Clones refer to the same memory.
#[derive(Clone)]
pub struct Blas(pub(crate) Arc<RawAccel>);

/// A mesh between its size query and its build.
struct PlannedBuild<'a> {
    input: BlasInput<'a>,
    structure_bytes: u64,
    scratch_bytes: u64,
}

impl Blas {
    /// Builds all meshes, in the order given. Vertices and triangles are on the device only while
    /// a batch (64 MiB, or one larger mesh) is built.
    pub fn build_many(
        device: &Arc<Device>,
        inputs: &[BlasInput<'_>],
        options: BlasOptions,
    ) -> Result<Vec<Self>, GpuError> {
        Self::build_timed(device, inputs, options).map(|(built, _)| built)
    }

    /// Like [`Self::build_many`]; also returns times and sizes.
    pub(crate) fn build_timed(
        device: &Arc<Device>,
        inputs: &[BlasInput<'_>],
        options: BlasOptions,
    ) -> Result<(Vec<Self>, BuildTimes), GpuError> {
        let mut times = BuildTimes::default();
        let mut done = Vec::with_capacity(inputs.len());
        let (mut batch, mut bytes) = (Vec::new(), 0);
        for input in inputs {
            input.check(device)?;
            let planned = plan(device, *input, options)?;
            let needed = input.input_bytes() + planned.scratch_bytes;
            if !batch.is_empty() && bytes + needed > BATCH_BYTES {
                done.extend(build_batch(device, &batch, options, &mut times)?);
                batch.clear();
                bytes = 0;
            }
            bytes += needed;
            batch.push(planned);
        }
        if !batch.is_empty() {
            done.extend(build_batch(device, &batch, options, &mut times)?);
        }
        times.compacted_bytes = done.iter().map(Self::bytes).sum();
        Ok((done, times))
    }

    /// Name of the mesh.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Size in device memory in bytes.
    pub fn bytes(&self) -> u64 {
        self.0.buffer.size()
    }
}

/// The geometry of a mesh whose vertices begin at `address`; its triangles follow.
fn geometry<'a>(input: &BlasInput<'_>, address: u64) -> vk::AccelerationStructureGeometryKHR<'a> {
    let indices = address + size_of_val(input.positions) as u64;
    triangles(address, input.positions.len() as u32, indices)
}

fn build_info<'a>(
    geometry: &'a vk::AccelerationStructureGeometryKHR<'a>,
    options: BlasOptions,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
        .flags(options.flags())
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(std::slice::from_ref(geometry))
}

fn plan<'a>(
    device: &Device,
    input: BlasInput<'a>,
    options: BlasOptions,
) -> Result<PlannedBuild<'a>, GpuError> {
    let accel = device.require_accel()?;
    let geometry = geometry(&input, 0);
    let info = build_info(&geometry, options);
    let sizes = build_sizes(accel, &info, input.triangles.len() as u32);
    Ok(PlannedBuild {
        input,
        structure_bytes: sizes.acceleration_structure_size,
        scratch_bytes: sizes.build_scratch_size.next_multiple_of(accel.scratch_alignment),
    })
}

fn build_batch(
    device: &Arc<Device>,
    batch: &[PlannedBuild<'_>],
    options: BlasOptions,
    times: &mut BuildTimes,
) -> Result<Vec<Blas>, GpuError> {
    let input_bytes = batch.iter().map(|p| p.input.input_bytes()).sum();
    let inputs = device.buffer("BLAS input", input_bytes, BufferKind::BuildInput)?;
    let mut uploads: Vec<(&Buffer, u64, &[u8])> = Vec::new();
    let (mut at, mut starts) = (0, Vec::new());
    for planned in batch {
        starts.push(at);
        let positions: &[u8] = bytemuck::cast_slice(planned.input.positions);
        let triangles = bytemuck::cast_slice(planned.input.triangles);
        uploads.push((&inputs, at, positions));
        uploads.push((&inputs, at + positions.len() as u64, triangles));
        at += planned.input.input_bytes();
    }
    device.upload_many(&uploads)?;

    let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let structures = (batch.iter())
        .map(|p| RawAccel::new(device, p.input.name, bottom, p.structure_bytes).map(Arc::new))
        .collect::<Result<Vec<_>, _>>()?;
    let sizes = CompactedSizes::new(device, batch.len() as u32)?;
    times.bytes += structures.iter().map(|s| s.buffer.size()).sum::<u64>();
    times.build_ms += record_builds(device, batch, options, &inputs, &starts, &structures, &sizes)?;
    drop(inputs);
    if options.compact {
        let (compacted, ms) = compact(device, &structures, &sizes.read()?)?;
        times.compact_ms += ms;
        Ok(compacted)
    } else {
        Ok(structures.into_iter().map(Blas).collect())
    }
}

/// Builds a batch; returns milliseconds.
fn record_builds(
    device: &Arc<Device>,
    batch: &[PlannedBuild<'_>],
    options: BlasOptions,
    inputs: &Buffer,
    starts: &[u64],
    structures: &[Arc<RawAccel>],
    sizes: &CompactedSizes,
) -> Result<f64, GpuError> {
    let accel = device.require_accel()?;
    let scratch = Scratch::new(device, batch.iter().map(|p| p.scratch_bytes).sum())?;
    let base = inputs.device_address();
    let geometries: Vec<_> = (batch.iter().zip(starts))
        .map(|(planned, start)| geometry(&planned.input, base + start))
        .collect();
    let mut scratch_at = scratch.address;
    let infos: Vec<_> = (geometries.iter().zip(batch).zip(structures))
        .map(|((geometry, planned), structure)| {
            let address = scratch_at;
            scratch_at += planned.scratch_bytes;
            build_info(geometry, options)
                .dst_acceleration_structure(structure.handle)
                .scratch_data(vk::DeviceOrHostAddressKHR { device_address: address })
        })
        .collect();
    let ranges: Vec<_> = (batch.iter())
        .map(|planned| {
            [vk::AccelerationStructureBuildRangeInfoKHR::default()
                .primitive_count(planned.input.triangles.len() as u32)]
        })
        .collect();
    let ranges: Vec<&[_]> = ranges.iter().map(<[_; 1]>::as_slice).collect();
    let ((), timings) = device.once_timed(|commands| {
        commands.scope("build");
        // SAFETY: inputs, scratch and structures have the sizes that the device asked for and
        // live until `once` returns, which waits; vertex numbers were checked.
        unsafe {
            accel.functions.cmd_build_acceleration_structures(commands.raw(), &infos, &ranges);
        }
        if options.compact {
            commands.barrier(Stage::Build, Stage::Build);
            commands.scope("sizes");
            sizes.record(commands, structures)?;
        }
        Ok(())
    })?;
    Ok(timings.of("build"))
}

/// Copies each structure into one of the size it needs; also returns milliseconds.
fn compact(
    device: &Arc<Device>,
    structures: &[Arc<RawAccel>],
    sizes: &[u64],
) -> Result<(Vec<Blas>, f64), GpuError> {
    let accel = device.require_accel()?;
    let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
    let compacted = (structures.iter().zip(sizes))
        .map(|(old, &size)| RawAccel::new(device, &old.name, bottom, size))
        .collect::<Result<Vec<_>, _>>()?;
    let ((), timings) = device.once_timed(|commands| {
        commands.scope("compact");
        for (old, new) in structures.iter().zip(&compacted) {
            let info = vk::CopyAccelerationStructureInfoKHR::default()
                .src(old.handle)
                .dst(new.handle)
                .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
            // SAFETY: the source was built for compaction, the target has the size reported, and
            // both live until `once` returns.
            unsafe {
                accel.functions.cmd_copy_acceleration_structure(commands.raw(), &info);
            }
        }
        Ok(())
    })?;
    let compacted = compacted.into_iter().map(|raw| Blas(Arc::new(raw)));
    Ok((compacted.collect(), timings.of("compact")))
}
