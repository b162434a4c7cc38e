//! Copies: between host and device, and on the device.

use std::sync::Arc;

use ash::vk;

use super::barrier::Stage;
use super::commands::Commands;
use super::device::Device;
use super::error::GpuError;
use super::image::{Image, ImageFormat, whole};
use super::memory::{Buffer, BufferKind, POISON};

/// Most staging memory taken at a time; more bytes go in several submissions.
const CHUNK_BYTES: u64 = 32 << 20;

impl Commands<'_> {
    /// Sets every 32-bit word of a buffer.
    pub fn fill(&mut self, buffer: &Buffer, value: u32) {
        self.fill_first(buffer, buffer.size(), value);
    }

    /// Sets the 32-bit words of a buffer's first `bytes`.
    ///
    /// # Panics
    /// If there are not as many, none, or they are no multiple of 4.
    pub fn fill_first(&mut self, buffer: &Buffer, bytes: u64, value: u32) {
        assert!(bytes > 0 && bytes <= buffer.size() && bytes.is_multiple_of(4), "{bytes} bytes");
        self.uses(&buffer.0, buffer.name(), Stage::Transfer, true, "fill");
        // SAFETY: the buffer allows it, and has this many bytes, a multiple of 4.
        unsafe {
            self.device().raw.cmd_fill_buffer(self.raw(), buffer.0.handle, 0, bytes, value);
        }
    }

    /// Fills a new image, which earlier commands have moved to its layout, with [`POISON`].
    pub(crate) fn poison_image(&mut self, image: &Image) {
        self.uses(&image.0, image.name(), Stage::Transfer, true, "poison");
        let texel = match image.format() {
            ImageFormat::R32Float => f32::from_bits(POISON),
            _ => f32::from(POISON as u8) / 255.0,
        };
        let colour = vk::ClearColorValue { float32: [texel; 4] };
        let general = vk::ImageLayout::GENERAL;
        // SAFETY: the image can be copied to, is in GENERAL and kept.
        unsafe {
            self.device().raw.cmd_clear_color_image(
                self.raw(),
                image.0.handle,
                general,
                &colour,
                &[whole()],
            );
        }
    }

    /// Copies `size` bytes between buffers.
    pub fn copy(
        &mut self,
        from: (&Buffer, u64),
        to: (&Buffer, u64),
        size: u64,
    ) -> Result<(), GpuError> {
        from.0.check_range("copy out", from.1, size)?;
        to.0.check_range("copy in", to.1, size)?;
        if size == 0 {
            return Ok(());
        }
        let stage = Stage::Transfer;
        self.uses(&from.0.0, from.0.name(), stage, false, "copy");
        self.uses(&to.0.0, to.0.name(), stage, true, "copy");
        self.copy_unchecked(from, to, size);
        Ok(())
    }

    fn copy_unchecked(&self, from: (&Buffer, u64), to: (&Buffer, u64), size: u64) {
        let region = vk::BufferCopy { src_offset: from.1, dst_offset: to.1, size };
        // SAFETY: callers have checked the ranges and keep both buffers.
        unsafe {
            self.device().raw.cmd_copy_buffer(
                self.raw(),
                from.0.0.handle,
                to.0.0.handle,
                &[region],
            );
        }
    }

    /// Writes bytes from the CPU at an offset; the bytes are copied at once, so `bytes` may change after the
    /// call. Frames get their parameters by it: each slot has its own staging memory.
    pub fn write(&mut self, buffer: &Buffer, offset: u64, bytes: &[u8]) -> Result<(), GpuError> {
        buffer.check_range("write", offset, bytes.len() as u64)?;
        if bytes.is_empty() {
            return Ok(());
        }
        let (staging, at) = self.stage(bytes)?;
        self.keep(&staging.0);
        self.uses(&buffer.0, buffer.name(), Stage::Transfer, true, "write");
        self.copy_unchecked((&staging, at), (buffer, offset), bytes.len() as u64);
        Ok(())
    }

    /// Copies all texels from the start of a buffer, rows without padding.
    pub fn copy_to_image(&mut self, from: &Buffer, to: &Image) -> Result<(), GpuError> {
        from.check_range("copy to an image", 0, to.bytes())?;
        self.uses(&from.0, from.name(), Stage::Transfer, false, "copy");
        self.uses(&to.0, to.name(), Stage::Transfer, true, "copy");
        // SAFETY: the buffer holds all texels; the image is in GENERAL and kept.
        unsafe {
            self.device().raw.cmd_copy_buffer_to_image(
                self.raw(),
                from.0.handle,
                to.0.handle,
                vk::ImageLayout::GENERAL,
                &[to.0.copy_region()],
            );
        }
        Ok(())
    }

    /// Copies all texels to the start of a buffer, rows without padding.
    pub fn copy_from_image(&mut self, from: &Image, to: &Buffer) -> Result<(), GpuError> {
        to.check_range("copy from an image", 0, from.bytes())?;
        self.uses(&from.0, from.name(), Stage::Transfer, false, "copy");
        self.uses(&to.0, to.name(), Stage::Transfer, true, "copy");
        // SAFETY: the buffer has room for all texels; the image is in GENERAL and kept.
        unsafe {
            self.device().raw.cmd_copy_image_to_buffer(
                self.raw(),
                from.0.handle,
                vk::ImageLayout::GENERAL,
                to.0.handle,
                &[from.0.copy_region()],
            );
        }
        Ok(())
    }
}

impl Device {
    /// Writes bytes to the start of a buffer and waits.
    pub fn upload(self: &Arc<Self>, buffer: &Buffer, bytes: &[u8]) -> Result<(), GpuError> {
        self.upload_many(&[(buffer, 0, bytes)])
    }

    /// Writes bytes at offsets of buffers and waits; in one submission up to 32 MiB, beyond that
    /// in several, so that the staging memory stays small.
    pub fn upload_many(
        self: &Arc<Self>,
        uploads: &[(&Buffer, u64, &[u8])],
    ) -> Result<(), GpuError> {
        for (buffer, offset, bytes) in uploads {
            buffer.check_range("upload", *offset, bytes.len() as u64)?;
        }
        let chunk = CHUNK_BYTES as usize;
        let mut pieces = (uploads.iter())
            .flat_map(|&(buffer, offset, bytes)| {
                (bytes.chunks(chunk).enumerate())
                    .map(move |(i, piece)| (buffer, offset + (i * chunk) as u64, piece))
            })
            .peekable();
        while pieces.peek().is_some() {
            let (mut batch, mut size) = (Vec::new(), 0);
            while let Some(piece) =
                pieces.next_if(|p| batch.is_empty() || size + p.2.len() <= chunk)
            {
                size += piece.2.len();
                batch.push(piece);
            }
            self.upload_batch(&batch, size as u64)?;
        }
        Ok(())
    }

    fn upload_batch(
        self: &Arc<Self>,
        batch: &[(&Buffer, u64, &[u8])],
        size: u64,
    ) -> Result<(), GpuError> {
        let staging = self.buffer("staging", size, BufferKind::Upload)?;
        self.once(|commands| {
            let mut at = 0;
            for &(buffer, offset, bytes) in batch {
                // SAFETY: the buffer is new and each byte of it is written once.
                unsafe { staging.write_mapped(at, bytes) };
                commands.copy((&staging, at), (buffer, offset), bytes.len() as u64)?;
                at += bytes.len() as u64;
            }
            Ok(())
        })
    }

    /// The whole content of a buffer, after everything submitted so far.
    pub fn read_back(self: &Arc<Self>, buffer: &Buffer) -> Result<Vec<u8>, GpuError> {
        let mut bytes = vec![0; buffer.size() as usize];
        self.read_into(buffer, 0, &mut bytes)?;
        Ok(bytes)
    }

    /// The content of a buffer as values of `T`; a rest too short for a value is left out.
    pub fn read_back_as<T: bytemuck::Pod>(
        self: &Arc<Self>,
        buffer: &Buffer,
    ) -> Result<Vec<T>, GpuError> {
        let count = buffer.size() as usize / size_of::<T>();
        let mut values = vec![T::zeroed(); count];
        self.read_into(buffer, 0, bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    /// Fills `out` from an offset of a buffer, after everything submitted so far.
    pub fn read_into(
        self: &Arc<Self>,
        buffer: &Buffer,
        offset: u64,
        out: &mut [u8],
    ) -> Result<(), GpuError> {
        buffer.check_range("read back", offset, out.len() as u64)?;
        if out.is_empty() {
            return Ok(());
        }
        let size = CHUNK_BYTES.min(out.len() as u64);
        let readback = self.buffer("readback", size, BufferKind::Readback)?;
        for (i, piece) in out.chunks_mut(CHUNK_BYTES as usize).enumerate() {
            let at = offset + i as u64 * CHUNK_BYTES;
            self.once(|commands| {
                commands.copy((buffer, at), (&readback, 0), piece.len() as u64)?;
                commands.barrier(Stage::Transfer, Stage::Host);
                Ok(())
            })?;
            // SAFETY: the copy was waited for, after a barrier to the host.
            unsafe { readback.read_mapped(piece) };
        }
        Ok(())
    }

    /// Sets all texels of an image, rows without padding, and waits.
    pub fn upload_image(self: &Arc<Self>, image: &Image, bytes: &[u8]) -> Result<(), GpuError> {
        check_texels("upload", image, bytes.len() as u64)?;
        self.once(|commands| {
            let staging = commands.device().buffer("staging", image.bytes(), BufferKind::Upload)?;
            // SAFETY: the buffer is new, so no submission reads it yet.
            unsafe { staging.write_mapped(0, bytes) };
            commands.copy_to_image(&staging, image)
        })
    }
}

fn check_texels(what: &'static str, image: &Image, bytes: u64) -> Result<(), GpuError> {
    if bytes == image.bytes() {
        return Ok(());
    }
    Err(GpuError::OutOfBounds {
        what,
        name: image.name().into(),
        offset: 0,
        end: bytes,
        size: image.bytes(),
    })
}
