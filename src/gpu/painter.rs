//! The painter of a window: images of the device, and an egui interface over them.
//!
//! Images are blitted, so that their grey levels reach the screen unchanged; egui's own renderer would
//! convert them to its colour space.

use std::sync::Arc;

use ash::vk;
use winit::window::Window;

use super::barrier::Stage;
use super::commands::Commands;
use super::device::Device;
use super::error::{GpuError, during};
use super::frames::{FRAMES_IN_FLIGHT, SubmissionSlot};
use super::image::{Image, whole};
use super::memory::{Buffer, BufferKind};
use super::overlay::Overlay;
use super::queues::QueueUser;
use super::surface::Surface;
use super::swapchain::{AcquireResult, Swapchain};

/// An image and its place in the window.
pub struct PlacedImage<'a> {
    /// The image.
    pub image: &'a Image,
    /// Place in pixels of the window: left, top, right, bottom.
    pub to: [f32; 4],
    /// The part of the window in which it is seen, to the next whole texel outside.
    pub within: [f32; 4],
    /// Left and right, up and down are exchanged.
    pub flipped: [bool; 2],
}

/// Pixels of the window and texels of an image along an axis, first and last: of an image from `low` to `high`, of which
/// as many whole texels are shown as reach into `seen` and none beyond the window.
fn shown(
    [low, high]: [f32; 2],
    seen: [f32; 2],
    (window, texels): (u32, u32),
    flipped: bool,
) -> ([i32; 2], [i32; 2]) {
    let texel = (high - low) / texels as f32;
    let pixel = |at: i32| (low + at as f32 * texel).round() as i32;
    let at = |place: f32| (place.clamp(low, high) - low) / texel;
    // A texel that is touched by a rounding alone is not seen.
    let (mut first, mut last) =
        ((at(seen[0]) + 1e-3).floor() as i32, (at(seen[1]) - 1e-3).ceil() as i32);
    while first < last && pixel(first) < 0 {
        first += 1;
    }
    while first < last && pixel(last) > window as i32 {
        last -= 1;
    }
    let all = texels as i32;
    let from = if flipped { [all - first, all - last] } else { [first, last] };
    ([pixel(first), pixel(last)], from)
}

/// One interface frame.
pub struct InterfaceFrame<'a> {
    /// Pixels per point of the primitives.
    pub pixels_per_point: f32,
    /// Shapes in the order of drawing.
    pub primitives: &'a [egui::ClippedPrimitive],
    /// Textures that have changed.
    pub textures: egui::TexturesDelta,
}

/// The pixels of a window.
pub struct Screenshot {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// RGBA, row by row, opaque.
    pub rgba: Vec<u8>,
}

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
        let pass = render_pass(device, surface.format.format)?;
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
        interface: InterfaceFrame<'_>,
        shot: bool,
    ) -> Result<Painted, GpuError> {
        let slot = self.next as usize % FRAMES_IN_FLIGHT;
        self.slots[slot].wait()?;
        self.overlay.update(interface.textures)?;
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
        commands.move_window(image, UNDEFINED, COPY_TO);
        commands.clear(image);
        for placed in images {
            commands.blit(placed, image, extent);
        }
        commands.move_window(image, COPY_TO, DRAWN);
        let (primitives, scale) = (interface.primitives, interface.pixels_per_point);
        let target = (self.pass, picture.framebuffer, extent);
        self.overlay.draw(&commands, target, primitives, scale)?;
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

    /// Returns whether the pixels of the window can be read.
    pub fn can_be_read(&self) -> bool {
        self.swapchain.as_ref().is_some_and(|chain| chain.readable)
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

/// Layout, stages and accesses of a picture between two uses.
type PictureUse = (vk::ImageLayout, vk::PipelineStageFlags, vk::AccessFlags);

/// State in which the window system hands it over: the semaphore is waited for before TRANSFER.
const UNDEFINED: PictureUse =
    (vk::ImageLayout::UNDEFINED, vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::empty());
const COPY_TO: PictureUse = (
    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
    vk::PipelineStageFlags::TRANSFER,
    vk::AccessFlags::TRANSFER_WRITE,
);
const DRAWN: PictureUse = (
    vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
    vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
    vk::AccessFlags::from_raw(
        vk::AccessFlags::COLOR_ATTACHMENT_READ.as_raw()
            | vk::AccessFlags::COLOR_ATTACHMENT_WRITE.as_raw(),
    ),
);
const COPY_FROM: PictureUse = (
    vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
    vk::PipelineStageFlags::TRANSFER,
    vk::AccessFlags::TRANSFER_READ,
);
const SHOWN: PictureUse = (
    vk::ImageLayout::PRESENT_SRC_KHR,
    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
    vk::AccessFlags::empty(),
);

/// A render pass with one colour attachment that keeps the blitted images, in [`DRAWN`] before and after.
fn render_pass(device: &Device, format: vk::Format) -> Result<vk::RenderPass, GpuError> {
    let attachments = [vk::AttachmentDescription::default()
        .format(format)
        .samples(vk::SampleCountFlags::TYPE_1)
        .load_op(vk::AttachmentLoadOp::LOAD)
        .store_op(vk::AttachmentStoreOp::STORE)
        .initial_layout(DRAWN.0)
        .final_layout(DRAWN.0)];
    let colours = [vk::AttachmentReference::default().layout(DRAWN.0)];
    let subpasses = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&colours)];
    let info = vk::RenderPassCreateInfo::default().attachments(&attachments).subpasses(&subpasses);
    // SAFETY: the structure is complete; the painter destroys the pass.
    unsafe { device.raw.create_render_pass(&info, None) }
        .map_err(during("making the window's render pass"))
}

impl Commands<'_> {
    fn move_window(&self, image: vk::Image, from: PictureUse, to: PictureUse) {
        let barrier = [vk::ImageMemoryBarrier::default()
            .image(image)
            .old_layout(from.0)
            .new_layout(to.0)
            .src_access_mask(from.2)
            .dst_access_mask(to.2)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .subresource_range(whole())];
        let (raw, none) = (&self.device().raw, vk::DependencyFlags::empty());
        // SAFETY: the picture is acquired; layouts follow each other as the painter records them.
        unsafe { raw.cmd_pipeline_barrier(self.raw(), from.1, to.1, none, &[], &[], &barrier) };
    }

    fn clear(&self, image: vk::Image) {
        let black = vk::ClearColorValue { float32: [0.0, 0.0, 0.0, 1.0] };
        // SAFETY: the picture is acquired and in the layout of copies.
        unsafe {
            let raw = &self.device().raw;
            raw.cmd_clear_color_image(self.raw(), image, COPY_TO.0, &black, &[whole()]);
        }
        // The cleared area is written again by blits.
        self.move_window(image, COPY_TO, COPY_TO);
    }

    /// Scales an image, linearly, onto the part of its place that lies in the window.
    fn blit(&mut self, placed: &PlacedImage<'_>, window: vk::Image, extent: vk::Extent2D) {
        let [width, height, _] = placed.image.extent();
        let axis = |axis: usize, window: u32, texels: u32| {
            let sides = |r: &[f32; 4]| [r[axis], r[axis + 2]];
            let flipped = placed.flipped[axis];
            shown(sides(&placed.to), sides(&placed.within), (window, texels), flipped)
        };
        let (x, from_x) = axis(0, extent.width, width);
        let (y, from_y) = axis(1, extent.height, height);
        let empty = |to: [i32; 2], from: [i32; 2]| to[1] <= to[0] || from[0] == from[1];
        if empty(x, from_x) || empty(y, from_y) {
            return;
        }
        let corners = |x: [i32; 2], y: [i32; 2]| {
            let corner = |i: usize| vk::Offset3D { x: x[i], y: y[i], z: i as i32 };
            [corner(0), corner(1)]
        };
        let layers = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        };
        let region = [vk::ImageBlit {
            src_subresource: layers,
            src_offsets: corners(from_x, from_y),
            dst_subresource: layers,
            dst_offsets: corners(x, y),
        }];
        let image = placed.image;
        self.uses(&image.0, image.name(), Stage::Transfer, false, "blit");
        // SAFETY: both regions lie inside their images; the source is in GENERAL and kept, the
        // picture in the layout of copies. Vulkan demands linear blits of eight-bit colours.
        unsafe {
            self.device().raw.cmd_blit_image(
                self.raw(),
                image.0.handle,
                vk::ImageLayout::GENERAL,
                window,
                COPY_TO.0,
                &region,
                vk::Filter::LINEAR,
            );
        }
        self.move_window(window, COPY_TO, COPY_TO);
    }

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

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn a_part_of_an_image_is_shown_by_whole_texels() {
        // All of it; turned over.
        assert_eq!(shown([10.0, 110.0], [0.0, 200.0], (300, 50), false), ([10, 110], [0, 50]));
        assert_eq!(shown([10.0, 110.0], [0.0, 200.0], (300, 50), true), ([10, 110], [50, 0]));
        // Eightfold: from the texel in which the pane begins to the one in which it ends.
        let (to, from) = shown([-300.0, 500.0], [20.0, 101.0], (300, 100), false);
        assert_eq!((to, from), ([20, 108], [40, 51]));
        let (to, from) = shown([-300.0, 500.0], [20.0, 101.0], (300, 100), true);
        assert_eq!((to, from), ([20, 108], [60, 49]));
        // No farther than the window.
        let (to, from) = shown([-301.0, 499.0], [0.0, 300.0], (300, 100), false);
        assert_eq!((to, from), ([3, 299], [38, 75]));
        // Beside what is seen there is nothing.
        let (to, _) = shown([400.0, 500.0], [0.0, 300.0], (300, 100), false);
        assert!(to[1] <= to[0]);
    }
}
