//! Bottom-level structures of meshes that change on the device: rebuilt or refitted within a frame
//! from vertices that its kernels have written.

use std::sync::{Arc, Weak};

use ash::vk;

use super::accel::{RawAccel, Scratch, build_sizes, record_build, triangles};
use super::barrier::Stage;
use super::blas::Blas;
use super::commands::Commands;
use super::device::Device;
use super::error::GpuError;
use super::memory::{Buffer, BufferKind, RawBuffer};

/// Place of a mesh on the device: in storage buffers that may hold others too.
#[derive(Clone, Copy)]
pub struct DynamicSource<'a> {
    /// Packed positions, three floats each, mm.
    pub vertices: &'a Buffer,
    /// Position of index 0.
    pub first_vertex: u32,
    /// Number of positions from there on; every index is below it.
    pub vertex_count: u32,
    /// Packed triangles, three 32-bit indices each.
    pub triangles: &'a Buffer,
    /// The mesh's first triangle.
    pub first_triangle: u32,
    /// Number of its triangles.
    pub triangle_count: u32,
}

/// Properties that a refit may not change.
struct BuiltTopology {
    /// The buffer of the triangles, which may have been dropped.
    triangles: Weak<RawBuffer>,
    first_triangle: u32,
    triangle_count: u32,
    vertex_count: u32,
}

/// A bottom-level structure with memory for one mesh of limited size, to be built anew and refitted
/// any number of times. It is made for opaque triangles.
pub struct DynamicBlas {
    blas: Blas,
    scratch: Scratch,
    max_triangles: u32,
    max_vertices: u32,
    fast_trace: bool,
    built: Option<BuiltTopology>,
}

impl DynamicBlas {
    /// Reserves memory for a mesh of up to `max_triangles` triangles whose indices lie below
    /// `max_vertices`; it must be built before it is placed. `fast_trace` spends build time on fast
    /// rays; otherwise the build is fast and rays are slower.
    ///
    /// # Errors
    /// The device has no acceleration structures, or none of this size, or no memory.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        max_triangles: u32,
        max_vertices: u32,
        fast_trace: bool,
    ) -> Result<Self, GpuError> {
        let accel = device.require_accel()?;
        if max_triangles == 0 || max_vertices == 0 {
            return Err(problem(name, "it has no triangles".into()));
        }
        if u64::from(max_triangles) > accel.max_primitives {
            let text = format!("its {max_triangles} triangles exceed the device");
            return Err(problem(name, text));
        }
        let geometry = triangles(0, max_vertices, 0);
        let info = build_info(&geometry, fast_trace, vk::BuildAccelerationStructureModeKHR::BUILD);
        let sizes = build_sizes(accel, &info, max_triangles);
        let bottom = vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL;
        let structure = RawAccel::new(device, name, bottom, sizes.acceleration_structure_size)?;
        let scratch = sizes.build_scratch_size.max(sizes.update_scratch_size);
        Ok(Self {
            blas: Blas(Arc::new(structure)),
            scratch: Scratch::new(device, scratch)?,
            max_triangles,
            max_vertices,
            fast_trace,
            built: None,
        })
    }

    /// The structure, to be placed in a [`super::Tlas`]; that must be built or refitted after every
    /// build and refit of this.
    pub fn blas(&self) -> &Blas {
        &self.blas
    }

    /// Size of structure and scratch memory in device memory, in bytes.
    pub fn bytes(&self) -> u64 {
        self.blas.bytes() + self.scratch.buffer.size()
    }

    /// Records a build from scratch; size and triangles of the mesh may differ from the last. It waits
    /// for the dispatches and copies before it in the submission, and builds of top levels wait for
    /// it; builds of several meshes run side by side.
    ///
    /// # Errors
    /// The mesh does not lie within its buffers, or exceeds the reserved size.
    pub fn build(
        &mut self,
        commands: &mut Commands<'_>,
        source: DynamicSource<'_>,
    ) -> Result<(), GpuError> {
        self.check(source)?;
        let mode = vk::BuildAccelerationStructureModeKHR::BUILD;
        self.record(commands, source, mode)
    }

    /// Records a refit: the boxes follow the vertices and keep their triangles. Cheaper, but
    /// rays get slower the further neighbours have parted since the build. Waits as [`Self::build`].
    ///
    /// The triangles must be those of the build, unchanged; their vertices may be rewritten or lie
    /// elsewhere (`first_vertex`). They must be finite, or not finite where they were not at the
    /// build: on the device nothing checks that.
    ///
    /// # Errors
    /// Nothing was built, or the range of triangles or the number of vertices differs.
    pub fn refit(
        &mut self,
        commands: &mut Commands<'_>,
        source: DynamicSource<'_>,
    ) -> Result<(), GpuError> {
        self.check(source)?;
        let refuse = |text| Err(problem(self.blas.name(), text));
        let Some(built) = &self.built else {
            return refuse("it is refitted and has not been built".into());
        };
        if !built.is_of(source) {
            return refuse(format!(
                "a refit of {} triangles from {} on of {} vertices in '{}', after a build of {} from \
                 {} on of {} vertices: build it anew",
                source.triangle_count,
                source.first_triangle,
                source.vertex_count,
                source.triangles.name(),
                built.triangle_count,
                built.first_triangle,
                built.vertex_count
            ));
        }
        let mode = vk::BuildAccelerationStructureModeKHR::UPDATE;
        self.record(commands, source, mode)
    }

    fn check(&self, source: DynamicSource<'_>) -> Result<(), GpuError> {
        let refuse = |text| Err(problem(self.blas.name(), text));
        for buffer in [source.vertices, source.triangles] {
            if buffer.kind() != BufferKind::Storage {
                let (name, kind) = (buffer.name(), buffer.kind());
                return refuse(format!("the buffer '{name}' is of kind {kind:?}, not Storage"));
            }
        }
        let range = |buffer: &Buffer, first: u32, count: u32| {
            buffer.check_range("build from", 12 * u64::from(first), 12 * u64::from(count))
        };
        range(source.vertices, source.first_vertex, source.vertex_count)?;
        range(source.triangles, source.first_triangle, source.triangle_count)?;
        if source.triangle_count == 0 || source.vertex_count == 0 {
            return refuse("it has no triangles".into());
        }
        if source.triangle_count > self.max_triangles || source.vertex_count > self.max_vertices {
            return refuse(format!(
                "{} triangles of {} vertices, room for {} of {}",
                source.triangle_count, source.vertex_count, self.max_triangles, self.max_vertices
            ));
        }
        Ok(())
    }

    fn record(
        &mut self,
        commands: &mut Commands<'_>,
        source: DynamicSource<'_>,
        mode: vk::BuildAccelerationStructureModeKHR,
    ) -> Result<(), GpuError> {
        commands.barrier(Stage::Compute, Stage::Build);
        commands.barrier(Stage::Transfer, Stage::Build);
        self.built = Some(BuiltTopology::new(source));
        let stage = Stage::Build;
        for buffer in [source.vertices, source.triangles] {
            commands.uses(&buffer.0, buffer.name(), stage, false, "build");
        }
        commands.uses(&self.scratch.buffer.0, "scratch", stage, true, "build");
        let structure = &self.blas.0;
        commands.uses(structure, &structure.name, stage, true, "build");
        structure.note_build();
        let vertices = source.vertices.device_address() + 12 * u64::from(source.first_vertex);
        let indices = source.triangles.device_address() + 12 * u64::from(source.first_triangle);
        let geometry = triangles(vertices, source.vertex_count, indices);
        let info = build_info(&geometry, self.fast_trace, mode);
        // SAFETY: `check` has compared the mesh with its buffers and with the size for which
        // structure and scratch were made; a refit has the topology of the build (`refit`); the
        // submission keeps all of them alive. Indices beyond the vertices are the caller's breach of
        // contract, which robust buffer access does not cover.
        unsafe { record_build(commands, info, structure, &self.scratch, source.triangle_count) }
    }
}

impl BuiltTopology {
    fn new(source: DynamicSource<'_>) -> Self {
        Self {
            triangles: Arc::downgrade(&source.triangles.0),
            first_triangle: source.first_triangle,
            triangle_count: source.triangle_count,
            vertex_count: source.vertex_count,
        }
    }

    fn is_of(&self, source: DynamicSource<'_>) -> bool {
        let other = Self::new(source);
        self.triangles.ptr_eq(&other.triangles)
            && self.first_triangle == other.first_triangle
            && self.triangle_count == other.triangle_count
            && self.vertex_count == other.vertex_count
    }
}

fn problem(name: &str, problem: String) -> GpuError {
    GpuError::Geometry { name: name.into(), problem }
}

fn build_info<'a>(
    geometry: &'a vk::AccelerationStructureGeometryKHR<'a>,
    fast_trace: bool,
    mode: vk::BuildAccelerationStructureModeKHR,
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    use vk::BuildAccelerationStructureFlagsKHR as Flags;
    let speed = if fast_trace { Flags::PREFER_FAST_TRACE } else { Flags::PREFER_FAST_BUILD };
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL)
        .flags(Flags::ALLOW_UPDATE | speed)
        .mode(mode)
        .geometries(std::slice::from_ref(geometry))
}
