//! The painter of a window: what its pictures consist of is in `canvas`.

use std::sync::Arc;

use ash::vk;
use winit::window::Window;

use super::barrier::Stage;
use super::canvas::{
    COPY_FROM, DRAWN, InterfaceFrame, PlacedImage, SHOWN, Screenshot, UNDEFINED, render_pass,
};
use super::commands::Commands;
use super::device::Device;
use super::error::{GpuError, during};
use super::frames::{FRAMES_IN_FLIGHT, SubmissionSlot};
use super::memory::{Buffer, BufferKind};
use super::overlay::Overlay;
use super::queues::QueueUser;
use super::surface::Surface;
use super::swapchain::{AcquireResult, Swapchain};

/// Result of painting.
pub enum Painted {
    /// The picture is on its way to the screen; with its pixels where they were asked for.
    Shown(Option<Screenshot>),
    /// Nothing was drawn: the window has no area, or the window system has no picture free.
    Skipped,
}

/// Painter of one window.
pub struct Painter {
    overlay: Overlay,
    swapchain: Option<Swapchain>,
    slots: [SubmissionSlot; FRAMES_IN_FLIGHT],
    /// One per slot: signalled when its picture is free for drawing.
    free: [vk::Semaphore; FRAMES_IN_FLIGHT],
    pass: vk::RenderPass,
    next: u64,
    surface: Surface,
    device: Arc<Device>,
}

impl Painter {
    /// A painter for a window and a device that was opened with [`super::DeviceOptions::window`].
    ///
    /// # Errors
    /// A device that cannot show pictures in this window, with the remedy.
    pub fn new(device: &Arc<Device>, window: Arc<Window>) -> Result<Self, GpuError> {
        let surface = Surface::new(device, window)?;
        let pass = render_pass(device, surface.format.format, DRAWN.0)?;
        let slot = |name| SubmissionSlot::new(device, name, QueueUser::Window);
        let mut made = Self {
            overlay: Overlay::new(device, pass)?,
            swapchain: None,
            slots: [slot("window 0")?, slot("window 1")?],
            free: [vk::Semaphore::null(); FRAMES_IN_FLIGHT],
            pass,
            next: 0,
            surface,
            device: device.clone(),
        };
        for semaphore in &mut made.free {
            // SAFETY: no precondition; `Drop` destroys it.
            *semaphore = unsafe { device.raw.create_semaphore(&Default::default(), None) }
                .map_err(during("making the window's semaphores"))?;
        }
        Ok(made)
    }

    /// Draws `images` on black and the interface over them, `size` pixels large, and shows it.
    /// Waits until the frame before the last is on the screen. With `shot` it waits for this one,
    /// too, and returns its pixels.
    ///
    /// # Errors
    /// A lost device, no memory, a window system that does not allow reading its pictures.
    pub fn paint(
        &mut self,
        size: [u32; 2],
        images: &[PlacedImage<'_>],
        mut interface: InterfaceFrame<'_>,
        shot: bool,
    ) -> Result<Painted, GpuError> {
        let slot = self.next as usize % FRAMES_IN_FLIGHT;
        self.slots[slot].wait()?;
        self.overlay.update(std::mem::take(&mut interface.textures))?;
        let Some(index) = self.acquire(size, slot)? else {
            return Ok(Painted::Skipped);
        };
        let chain = self.swapchain.as_mut().expect("a picture was acquired");
        if shot && !chain.readable {
            return Err(GpuError::Window {
                device: self.device.name().into(),
                reason: "its pictures cannot be read back".into(),
            });
        }
        let (extent, picture) = (chain.extent, &chain.pictures[index]);
        let image = picture.image;
        let mut commands = Commands::begin(&mut self.slots[slot], self.next)?;
        commands.scope("window");
        let target = (self.pass, picture.framebuffer, extent);
        commands.draw(image, UNDEFINED, target, images, &mut self.overlay, &interface)?;
        let read = match shot {
            true => {
                let bytes = 4 * u64::from(extent.width) * u64::from(extent.height);
                let buffer = (self.device).buffer("window", bytes, BufferKind::Readback)?;
                commands.move_window(image, DRAWN, COPY_FROM);
                commands.read_window(image, extent, &buffer);
                commands.move_window(image, COPY_FROM, SHOWN);
                Some(buffer)
            }
            false => {
                commands.move_window(image, DRAWN, SHOWN);
                None
            }
        };
        let free = [(self.free[slot], vk::PipelineStageFlags::TRANSFER)];
        commands.submit_between(&free, &[picture.drawn])?;
        chain.present(index)?;
        self.next += 1;
        let Some(buffer) = read else {
            return Ok(Painted::Shown(None));
        };
        self.slots[slot].wait()?;
        Ok(Painted::Shown(Some(self.shot(&buffer, extent))))
    }

    /// The next picture, of a new swapchain where the window has changed; none where none is available.
    fn acquire(&mut self, size: [u32; 2], slot: usize) -> Result<Option<usize>, GpuError> {
        // A window that is being dragged may change again before the picture is there.
        for _ in 0..3 {
            if self.swapchain.as_ref().is_none_or(|s| s.is_stale(size)) {
                self.wait()?;
                let old = self.swapchain.take();
                let (device, surface) = (&self.device, &self.surface);
                self.swapchain = Swapchain::new(device, surface, size, self.pass, old.as_ref())?;
            }
            let Some(chain) = &mut self.swapchain else {
                return Ok(None);
            };
            match chain.acquire(self.free[slot])? {
                AcquireResult::Picture(index) => return Ok(Some(index)),
                AcquireResult::NotNow => return Ok(None),
                AcquireResult::OutOfDate => chain.forget(),
            }
        }
        Ok(None)
    }

    fn shot(&self, buffer: &Buffer, extent: vk::Extent2D) -> Screenshot {
        let mut rgba = vec![0; buffer.size() as usize];
        // SAFETY: the copy was waited for, after a barrier to the host.
        unsafe { buffer.read_mapped(&mut rgba) };
        let swapped = self.surface.format.format == vk::Format::B8G8R8A8_UNORM;
        for texel in rgba.chunks_exact_mut(4) {
            if swapped {
                texel.swap(0, 2);
            }
            texel[3] = 255;
        }
        Screenshot { size: [extent.width, extent.height], rgba }
    }

    /// Waits until no work of the window is under way.
    fn wait(&mut self) -> Result<(), GpuError> {
        for slot in &mut self.slots {
            slot.wait()?;
        }
        let queue = self.device.queues.lock(QueueUser::Window);
        // SAFETY: the guard keeps other threads off the queue. Presentations have no fence.
        unsafe { self.device.raw.queue_wait_idle(*queue) }
            .map_err(super::swapchain::lost_or("waiting for the window"))
    }
}

impl Drop for Painter {
    fn drop(&mut self) {
        // A lost device has nothing under way.
        let _ = self.wait();
        self.swapchain = None;
        let raw = &self.device.raw;
        // SAFETY: the device is done with them; null handles are ignored. The overlay's pipeline
        // does not need the pass any more.
        unsafe {
            for &semaphore in &self.free {
                raw.destroy_semaphore(semaphore, None);
            }
            raw.destroy_render_pass(self.pass, None);
        }
    }
}

impl Commands<'_> {
    fn read_window(&mut self, image: vk::Image, extent: vk::Extent2D, to: &Buffer) {
        self.uses(&to.0, to.name(), Stage::Transfer, true, "read the window");
        let region = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(extent.into())];
        // SAFETY: the buffer has room for the picture, which is in the layout of copies.
        unsafe {
            let raw = &self.device().raw;
            raw.cmd_copy_image_to_buffer(self.raw(), image, COPY_FROM.0, to.0.handle, &region);
        }
        self.barrier(Stage::Transfer, Stage::Host);
    }
}
