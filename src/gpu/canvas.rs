//! Pictures of the window: images of the device, scaled to their places on black, and an egui interface over them. Beside the
//! window such pictures are as large as wanted.
//!
//! Images are blitted, so that their grey levels reach the screen unchanged; egui's own renderer would
//! convert them to its colour space.

use std::sync::Arc;

use ash::vk;

use super::barrier::Stage;
use super::commands::Commands;
use super::device::Device;
use super::error::{GpuError, during};
use super::frames::SubmissionSlot;
use super::image::{Image, whole};
use super::overlay::{DrawTarget, Overlay};
use super::queues::QueueUser;

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
    window: u32,
    texels: u32,
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

/// Layout, stages and accesses of a picture between two uses.
pub(super) type PictureUse = (vk::ImageLayout, vk::PipelineStageFlags, vk::AccessFlags);

/// State in which the window system hands it over: the semaphore is waited for before TRANSFER.
pub(super) const UNDEFINED: PictureUse =
    (vk::ImageLayout::UNDEFINED, vk::PipelineStageFlags::TRANSFER, vk::AccessFlags::empty());
pub(super) const COPY_TO: PictureUse = (
    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
    vk::PipelineStageFlags::TRANSFER,
    vk::AccessFlags::TRANSFER_WRITE,
);
pub(super) const DRAWN: PictureUse = (
    vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
    vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
    vk::AccessFlags::from_raw(
        vk::AccessFlags::COLOR_ATTACHMENT_READ.as_raw()
            | vk::AccessFlags::COLOR_ATTACHMENT_WRITE.as_raw(),
    ),
);
pub(super) const COPY_FROM: PictureUse = (
    vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
    vk::PipelineStageFlags::TRANSFER,
    vk::AccessFlags::TRANSFER_READ,
);
pub(super) const SHOWN: PictureUse = (
    vk::ImageLayout::PRESENT_SRC_KHR,
    vk::PipelineStageFlags::BOTTOM_OF_PIPE,
    vk::AccessFlags::empty(),
);

/// A render pass with one colour attachment that keeps the blitted images, in [`DRAWN`] before and in `left` after; its owner
/// destroys it.
pub(super) fn render_pass(
    device: &Device,
    format: vk::Format,
    left: vk::ImageLayout,
) -> Result<vk::RenderPass, GpuError> {
    let attachments = [vk::AttachmentDescription::default()
        .format(format)
        .samples(vk::SampleCountFlags::TYPE_1)
        .load_op(vk::AttachmentLoadOp::LOAD)
        .store_op(vk::AttachmentStoreOp::STORE)
        .initial_layout(DRAWN.0)
        .final_layout(left)];
    let colours = [vk::AttachmentReference::default().layout(DRAWN.0)];
    let subpasses = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&colours)];
    let info = vk::RenderPassCreateInfo::default().attachments(&attachments).subpasses(&subpasses);
    // SAFETY: the structure is complete; the owner destroys the pass.
    unsafe { device.raw.create_render_pass(&info, None) }.map_err(during("making a render pass"))
}

impl Commands<'_> {
    /// Draws images on black and the interface over them, on a picture that is in the state `from`; leaves it in [`DRAWN`].
    pub(super) fn draw(
        &mut self,
        picture: vk::Image,
        from: PictureUse,
        target: DrawTarget,
        images: &[PlacedImage<'_>],
        overlay: &mut Overlay,
        interface: &InterfaceFrame<'_>,
    ) -> Result<(), GpuError> {
        let (_, _, extent) = target;
        self.move_window(picture, from, COPY_TO);
        self.clear(picture);
        for placed in images {
            self.blit(placed, picture, extent);
        }
        self.move_window(picture, COPY_TO, DRAWN);
        overlay.draw(self, target, interface.primitives, interface.pixels_per_point)
    }

    pub(super) fn move_window(&self, image: vk::Image, from: PictureUse, to: PictureUse) {
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
            shown(sides(&placed.to), sides(&placed.within), window, texels, flipped)
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
}

/// Pass and framebuffer of a picture beside the window.
struct Canvas {
    pass: vk::RenderPass,
    framebuffer: vk::Framebuffer,
    image: Image,
    device: Arc<Device>,
}

impl Canvas {
    fn new(device: &Arc<Device>, [width, height]: [u32; 2]) -> Result<Self, GpuError> {
        let image = Image::drawn_on(device, "picture", [width, height])?;
        let format = vk::Format::R8G8B8A8_UNORM;
        let pass = render_pass(device, format, vk::ImageLayout::GENERAL)?;
        let mut made =
            Self { pass, framebuffer: vk::Framebuffer::null(), image, device: device.clone() };
        let views = [made.image.0.view];
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(pass)
            .attachments(&views)
            .width(width)
            .height(height)
            .layers(1);
        // SAFETY: the view is of the image that is kept, in the format of the pass; `Drop` destroys it.
        made.framebuffer = unsafe { device.raw.create_framebuffer(&info, None) }
            .map_err(during("making a framebuffer"))?;
        Ok(made)
    }
}

impl Drop for Canvas {
    fn drop(&mut self) {
        // SAFETY: what was drawn on it has been waited for; a null framebuffer is ignored.
        unsafe {
            self.device.raw.destroy_framebuffer(self.framebuffer, None);
            self.device.raw.destroy_render_pass(self.pass, None);
        }
    }
}

/// Draws `images` on black and the interface over them, `size` pixels large, beside the window, and returns the pixels.
/// The interface is one of a context of its own, with all its textures.
///
/// # Errors
/// A lost device, no memory, more pixels than the device's images may have.
pub fn picture(
    device: &Arc<Device>,
    size: [u32; 2],
    images: &[PlacedImage<'_>],
    mut interface: InterfaceFrame<'_>,
) -> Result<Screenshot, GpuError> {
    // Dropped in the opposite order: the pass outlives the pipeline that was made for it.
    let canvas = Canvas::new(device, size)?;
    let mut overlay = Overlay::new(device, canvas.pass)?;
    overlay.update(std::mem::take(&mut interface.textures))?;
    let mut slot = SubmissionSlot::new(device, "picture", QueueUser::Window)?;
    let mut commands = Commands::begin(&mut slot, 0)?;
    commands.scope("picture");
    let extent = vk::Extent2D { width: size[0], height: size[1] };
    let target = (canvas.pass, canvas.framebuffer, extent);
    let general = (vk::ImageLayout::GENERAL, UNDEFINED.1, UNDEFINED.2);
    let image = &canvas.image;
    commands.draw(image.0.handle, general, target, images, &mut overlay, &interface)?;
    commands.submit()?;
    slot.wait()?;
    let mut rgba = image.read_back()?;
    rgba.as_chunks_mut::<4>().0.iter_mut().for_each(|texel| texel[3] = 255);
    Ok(Screenshot { size, rgba })
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn a_part_of_an_image_is_shown_by_whole_texels() {
        // All of it; turned over.
        assert_eq!(shown([10.0, 110.0], [0.0, 200.0], 300, 50, false), ([10, 110], [0, 50]));
        assert_eq!(shown([10.0, 110.0], [0.0, 200.0], 300, 50, true), ([10, 110], [50, 0]));
        // Eightfold: from the texel in which the pane begins to the one in which it ends.
        let (to, from) = shown([-300.0, 500.0], [20.0, 101.0], 300, 100, false);
        assert_eq!((to, from), ([20, 108], [40, 51]));
        let (to, from) = shown([-300.0, 500.0], [20.0, 101.0], 300, 100, true);
        assert_eq!((to, from), ([20, 108], [60, 49]));
        // No farther than the window.
        let (to, from) = shown([-301.0, 499.0], [0.0, 300.0], 300, 100, false);
        assert_eq!((to, from), ([3, 299], [38, 75]));
        // Beside what is seen there is nothing.
        let (to, _) = shown([400.0, 500.0], [0.0, 300.0], 300, 100, false);
        assert!(to[1] <= to[0]);
    }
}
