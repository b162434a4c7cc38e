//! Buffers: creation, names, the count of bytes in use, release.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Device;
use super::error::{GpuError, during};

/// Bytes that buffers, images and acceleration structures take from the allocator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUse {
    /// Bytes in use now.
    pub current: u64,
    /// Most bytes in use at one time since the device was opened.
    pub peak: u64,
}

#[derive(Default)]
pub(crate) struct MemoryUseCounter {
    current: AtomicU64,
    peak: AtomicU64,
}

impl MemoryUseCounter {
    fn add(&self, bytes: u64) {
        let now = self.current.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.peak.fetch_max(now, Ordering::Relaxed);
    }

    fn remove(&self, bytes: u64) {
        self.current.fetch_sub(bytes, Ordering::Relaxed);
    }

    pub(crate) fn read(&self) -> MemoryUse {
        MemoryUse {
            current: self.current.load(Ordering::Relaxed),
            peak: self.peak.load(Ordering::Relaxed),
        }
    }
}

/// Content of fresh memory while validating: a kernel that reads unwritten memory then differs from one that
/// does not. Large as a number, far from 0 as a float, and no valid index.
pub(crate) const POISON: u32 = 0xcdcd_cdcd;

/// Purpose of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferKind {
    /// In device memory, read and written by kernels (as storage or uniform block) and copies; read
    /// by builds where the device has acceleration structures.
    Storage,
    /// Vertices, indices and instances of acceleration-structure builds, in device memory.
    BuildInput,
    /// Working memory of acceleration-structure builds.
    Scratch,
    /// Holds an acceleration structure.
    AccelerationStructure,
    /// In host memory, written by the CPU, read by copies.
    Upload,
    /// In host memory, written by copies, read by the CPU.
    Readback,
}

impl BufferKind {
    /// Usage flags; `accel` is true where acceleration structures are on, without which their flags are unknown.
    fn usage(self, accel: bool) -> vk::BufferUsageFlags {
        use vk::BufferUsageFlags as Usage;
        let build_input =
            Usage::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR | Usage::SHADER_DEVICE_ADDRESS;
        match self {
            Self::Storage => {
                let kernels = Usage::STORAGE_BUFFER
                    | Usage::UNIFORM_BUFFER
                    | Usage::TRANSFER_SRC
                    | Usage::TRANSFER_DST;
                if accel { kernels | build_input } else { kernels }
            }
            Self::BuildInput => build_input | Usage::TRANSFER_DST,
            Self::Scratch => Usage::STORAGE_BUFFER | Usage::SHADER_DEVICE_ADDRESS,
            Self::AccelerationStructure => {
                Usage::ACCELERATION_STRUCTURE_STORAGE_KHR | Usage::SHADER_DEVICE_ADDRESS
            }
            Self::Upload => Usage::TRANSFER_SRC,
            Self::Readback => Usage::TRANSFER_DST,
        }
    }

    fn location(self) -> MemoryLocation {
        match self {
            // Copies are read once, so host memory is good enough: the small part of the device's memory that
            // the CPU can write stays free.
            Self::Upload | Self::Readback => MemoryLocation::GpuToCpu,
            _ => MemoryLocation::GpuOnly,
        }
    }
}

/// Memory bound to a buffer or image; counted while it lives.
pub(crate) struct CountedMemory {
    allocation: Allocation,
    device: Arc<Device>,
}

impl CountedMemory {
    pub(crate) fn new(
        device: &Arc<Device>,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Self, GpuError> {
        let allocation = device
            .with_allocator(|allocator| {
                allocator.allocate(&AllocationCreateDesc {
                    name,
                    requirements,
                    location,
                    linear,
                    allocation_scheme: AllocationScheme::GpuAllocatorManaged,
                })
            })
            .map_err(|error| GpuError::Allocation {
                name: name.into(),
                bytes: requirements.size,
                reason: error.to_string(),
            })?;
        device.memory_use.add(allocation.size());
        Ok(Self { allocation, device: device.clone() })
    }

    pub(crate) fn bind(&self) -> (vk::DeviceMemory, u64) {
        // SAFETY: the handle is only used to bind a buffer or image that is dropped before `self`.
        (unsafe { self.allocation.memory() }, self.allocation.offset())
    }
}

impl Drop for CountedMemory {
    fn drop(&mut self) {
        self.device.memory_use.remove(self.allocation.size());
        let allocation = std::mem::take(&mut self.allocation);
        // Freeing fails only for a block that this allocator does not know: a bug.
        self.device
            .with_allocator(|allocator| allocator.free(allocation))
            .expect("the allocation came from this device");
    }
}

/// The Vulkan buffer behind [`Buffer`].
pub(crate) struct RawBuffer {
    pub(crate) handle: vk::Buffer,
    pub(crate) name: String,
    pub(crate) size: u64,
    pub(crate) kind: BufferKind,
    /// `Some` except while the buffer is created or dropped.
    memory: Option<CountedMemory>,
    device: Arc<Device>,
}

/// A named buffer. Clones refer to the same memory, which is released when the last clone is dropped
/// and no submission uses it any more.
#[derive(Clone)]
pub struct Buffer(pub(crate) Arc<RawBuffer>);

impl Buffer {
    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Size in bytes, a multiple of 4.
    pub fn size(&self) -> u64 {
        self.0.size
    }

    /// Purpose given at creation.
    pub fn kind(&self) -> BufferKind {
        self.0.kind
    }

    /// Fails unless `len` bytes from `offset` lie inside.
    pub(crate) fn check_range(
        &self,
        what: &'static str,
        offset: u64,
        len: u64,
    ) -> Result<(), GpuError> {
        let end = offset.saturating_add(len);
        if end <= self.size() {
            return Ok(());
        }
        Err(GpuError::OutOfBounds {
            what,
            name: self.0.name.clone(),
            offset,
            end,
            size: self.size(),
        })
    }

    /// Copies `bytes` into an upload buffer.
    ///
    /// # Safety
    /// No submission that has not been waited for may read the bytes from `offset` on.
    pub(crate) unsafe fn write_mapped(&self, offset: u64, bytes: &[u8]) {
        let mapped = self.mapped();
        assert!(offset + bytes.len() as u64 <= self.size());
        // SAFETY: the range lies inside the mapping (asserted), the caller keeps the device off
        // it, and `bytes` is ordinary host memory, so the two do not overlap.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped.add(offset as usize), bytes.len());
        }
    }

    /// Copies `out.len()` bytes from the start of a readback buffer.
    ///
    /// # Safety
    /// The submission that writes them must have been waited for, with a barrier to the host.
    pub(crate) unsafe fn read_mapped(&self, out: &mut [u8]) {
        let mapped = self.mapped();
        assert!(out.len() as u64 <= self.size());
        // SAFETY: as above, with source and target exchanged.
        unsafe { std::ptr::copy_nonoverlapping(mapped, out.as_mut_ptr(), out.len()) };
    }

    fn mapped(&self) -> *mut u8 {
        let memory = self.0.memory.as_ref().expect("bound at creation");
        let pointer = memory.allocation.mapped_ptr();
        pointer.expect("upload and readback memory is mapped").as_ptr().cast()
    }

    /// Address on the device; only for kinds that builds use, where acceleration structures are on.
    pub(crate) fn device_address(&self) -> vk::DeviceAddress {
        let info = vk::BufferDeviceAddressInfo::default().buffer(self.0.handle);
        // SAFETY: the buffer has the usage flag, and its feature is on wherever acceleration
        // structures are supported.
        unsafe { self.0.device.raw.get_buffer_device_address(&info) }
    }
}

impl Drop for RawBuffer {
    fn drop(&mut self) {
        // SAFETY: submissions keep what they use alive, so the device is done with the buffer.
        unsafe { self.device.raw.destroy_buffer(self.handle, None) };
    }
}

impl Device {
    /// Makes a buffer of `size` bytes (rounded up to a multiple of 4, at least 4); its content is
    /// undefined.
    ///
    /// # Errors
    /// A size or kind that the device does not have; no memory.
    pub fn buffer(
        self: &Arc<Self>,
        name: &str,
        size: u64,
        kind: BufferKind,
    ) -> Result<Buffer, GpuError> {
        if matches!(
            kind,
            BufferKind::BuildInput | BufferKind::Scratch | BufferKind::AccelerationStructure
        ) {
            self.require_accel()?;
        }
        // fill() works on words, and a buffer of no bytes cannot exist.
        let size = size.max(4).next_multiple_of(4);
        let limit = self.limits().max_storage_buffer_bytes;
        if kind == BufferKind::Storage && size > limit {
            return Err(GpuError::TooLarge {
                name: name.into(),
                what: format!("{size} bytes"),
                limit_name: "maxStorageBufferRange",
                limit: format!("{limit} bytes"),
            });
        }
        let info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(kind.usage(self.supports_acceleration_structure()))
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the size is positive; usages that need an extension were refused above
        // where it is absent.
        let handle = unsafe { self.raw.create_buffer(&info, None) }
            .map_err(during(format!("creating the buffer '{name}'")))?;
        let mut raw =
            RawBuffer { handle, name: name.into(), size, kind, memory: None, device: self.clone() };
        // SAFETY: the buffer was just made from this device.
        let requirements = unsafe { self.raw.get_buffer_memory_requirements(handle) };
        let memory = CountedMemory::new(self, name, requirements, kind.location(), true)?;
        let (block, offset) = memory.bind();
        // SAFETY: the memory fulfils the buffer's requirements and is owned by it from here on.
        unsafe { self.raw.bind_buffer_memory(handle, block, offset) }
            .map_err(during(format!("binding memory to the buffer '{name}'")))?;
        raw.memory = Some(memory);
        self.set_name(handle, name);
        let buffer = Buffer(Arc::new(raw));
        if kind == BufferKind::Storage && self.is_validating() {
            // Fresh memory is often zero on one device and never on another.
            self.once(|commands| {
                commands.fill(&buffer, POISON);
                Ok(())
            })?;
        }
        Ok(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::BufferKind;
    use crate::{Image, ImageDim, ImageFormat, lone_test_device};

    #[test]
    fn fresh_memory_is_poisoned_while_validating() {
        let device = lone_test_device();
        let buffer = device.buffer("fresh", 1000, BufferKind::Storage).unwrap();
        assert_eq!(device.read_back(&buffer).unwrap(), [0xcd; 1000]);
        for format in [ImageFormat::R8Unorm, ImageFormat::R16Unorm, ImageFormat::R32Float] {
            let image = Image::new(&device, "fresh", ImageDim::D3, [5, 4, 3], format).unwrap();
            let bytes = image.read_back().unwrap();
            assert!(bytes.iter().all(|&b| b == 0xcd), "{format:?}: {bytes:x?}");
        }
        assert_eq!(device.validation_messages(), [""; 0]);
    }
}
