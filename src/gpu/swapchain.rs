//! The pictures of a window, shown one after the other.

use std::sync::Arc;

use ash::{khr, vk};

use super::device::Device;
use super::error::{GpuError, during};
use super::image::whole;
use super::instance::loader_reads;
use super::queues::QueueUser;
use super::surface::Surface;

/// Longest wait for the window system, ns: it may hold back the pictures of a window that it does not show.
const ACQUIRE_NS: u64 = 100_000_000;

/// Result of acquiring a picture.
pub(crate) enum AcquireResult {
    /// Number of the picture.
    Picture(usize),
    /// The window has changed: a new swapchain is needed.
    OutOfDate,
    /// The window system has no picture free.
    NotNow,
}

/// One picture of the window.
pub(crate) struct WindowPicture {
    pub(crate) image: vk::Image,
    view: vk::ImageView,
    pub(crate) framebuffer: vk::Framebuffer,
    /// Signalled when the picture is drawn. Each picture has its own: only its return shows that the window
    /// system has waited for it.
    pub(crate) drawn: vk::Semaphore,
}

/// Pictures of one size.
pub(crate) struct Swapchain {
    pub(crate) extent: vk::Extent2D,
    pub(crate) pictures: Vec<WindowPicture>,
    /// True where pictures can be copied from.
    pub(crate) readable: bool,
    /// True where the window system would like another size, but still shows the present one.
    stale: bool,
    functions: khr::swapchain::Device,
    handle: vk::SwapchainKHR,
    device: Arc<Device>,
}

impl Swapchain {
    /// Pictures for `surface` as it is now, of `wanted` pixels where it does not set the size itself; none
    /// while it has no area. Takes the place of `old`, of which nothing may be under way.
    pub(crate) fn new(
        device: &Arc<Device>,
        surface: &Surface,
        wanted: [u32; 2],
        pass: vk::RenderPass,
        old: Option<&Self>,
    ) -> Result<Option<Self>, GpuError> {
        let can = surface.capabilities()?;
        let extent = match can.current_extent.width {
            u32::MAX => vk::Extent2D {
                width: wanted[0].clamp(can.min_image_extent.width, can.max_image_extent.width),
                height: wanted[1].clamp(can.min_image_extent.height, can.max_image_extent.height),
            },
            _ => can.current_extent,
        };
        if extent.width == 0 || extent.height == 0 {
            return Ok(None);
        }
        let most = match can.max_image_count {
            0 => u32::MAX,
            most => most,
        };
        let needed = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_DST;
        if !can.supported_usage_flags.contains(needed) {
            return Err(GpuError::Window {
                device: device.name().into(),
                reason: "pictures cannot be copied to this window".into(),
            });
        }
        let source = vk::ImageUsageFlags::TRANSFER_SRC;
        let readable = can.supported_usage_flags.contains(source);
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.handle)
            .min_image_count((can.min_image_count + 1).min(most))
            .image_format(surface.format.format)
            .image_color_space(surface.format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(if readable { needed | source } else { needed })
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(can.current_transform)
            .composite_alpha(match can.supported_composite_alpha.contains(opaque) {
                true => opaque,
                false => vk::CompositeAlphaFlagsKHR::INHERIT,
            })
            .present_mode(surface.present_mode()?)
            .clipped(true)
            .old_swapchain(old.map_or(vk::SwapchainKHR::null(), |old| old.handle));
        let reading = loader_reads();
        let functions = khr::swapchain::Device::new(&device.instance.raw, &device.raw);
        // SAFETY: sizes and usages are those that the surface takes.
        let handle = unsafe { functions.create_swapchain(&info, None) }
            .map_err(during("making the window's pictures"))?;
        drop(reading);
        let mut made = Self {
            extent,
            pictures: Vec::new(),
            readable,
            stale: false,
            functions,
            handle,
            device: device.clone(),
        };
        // SAFETY: the swapchain was just made.
        let images = unsafe { made.functions.get_swapchain_images(handle) }
            .map_err(during("listing the window's pictures"))?;
        for image in images {
            made.add(image, surface.format.format, pass)
                .map_err(during("making the window's views"))?;
        }
        Ok(Some(made))
    }

    fn add(
        &mut self,
        image: vk::Image,
        format: vk::Format,
        pass: vk::RenderPass,
    ) -> Result<(), vk::Result> {
        self.device.set_name(image, "window");
        self.pictures.push(WindowPicture {
            image,
            view: vk::ImageView::null(),
            framebuffer: vk::Framebuffer::null(),
            drawn: vk::Semaphore::null(),
        });
        let picture = self.pictures.last_mut().expect("just added");
        let raw = &self.device.raw;
        let view = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(whole());
        // SAFETY: the image is of the swapchain, the view matches the render pass; `Drop` destroys
        // what was made.
        unsafe {
            picture.view = raw.create_image_view(&view, None)?;
            let views = [picture.view];
            let framebuffer = vk::FramebufferCreateInfo::default()
                .render_pass(pass)
                .attachments(&views)
                .width(self.extent.width)
                .height(self.extent.height)
                .layers(1);
            picture.framebuffer = raw.create_framebuffer(&framebuffer, None)?;
            picture.drawn = raw.create_semaphore(&Default::default(), None)?;
        }
        Ok(())
    }

    /// Returns whether a new swapchain of `size` pixels should be made.
    pub(crate) fn is_stale(&self, size: [u32; 2]) -> bool {
        self.stale || [self.extent.width, self.extent.height] != size
    }

    /// Marks the swapchain as stale, so that a new one is made.
    pub(crate) fn forget(&mut self) {
        self.stale = true;
    }

    /// The next picture to draw on, free once `free` is signalled.
    pub(crate) fn acquire(&mut self, free: vk::Semaphore) -> Result<AcquireResult, GpuError> {
        // SAFETY: the semaphore has been waited for since its last use.
        let acquired = unsafe {
            let none = vk::Fence::null();
            self.functions.acquire_next_image(self.handle, ACQUIRE_NS, free, none)
        };
        match acquired {
            Ok((index, suboptimal)) => {
                self.stale |= suboptimal;
                Ok(AcquireResult::Picture(index as usize))
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(AcquireResult::OutOfDate),
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(AcquireResult::NotNow),
            Err(code) => Err(lost_or("acquiring a picture of the window")(code)),
        }
    }

    /// Shows a picture once it is drawn.
    pub(crate) fn present(&mut self, index: usize) -> Result<(), GpuError> {
        let (chains, indices) = ([self.handle], [index as u32]);
        let drawn = [self.pictures[index].drawn];
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&drawn)
            .swapchains(&chains)
            .image_indices(&indices);
        let queue = self.device.queues.lock(QueueUser::Window);
        // SAFETY: the picture was acquired, and its drawing is submitted and signals the semaphore.
        match unsafe { self.functions.queue_present(*queue, &info) } {
            Ok(suboptimal) => self.stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.stale = true,
            Err(code) => return Err(lost_or("showing a picture in the window")(code)),
        }
        Ok(())
    }
}

/// Turns a lost device into an error of its own, which has a remedy.
pub(crate) fn lost_or(what: &'static str) -> impl Fn(vk::Result) -> GpuError {
    move |code| match code {
        vk::Result::ERROR_DEVICE_LOST => GpuError::DeviceLost {
            what: what.into(),
            last_pass: "none".into(),
            passes: "the window".into(),
        },
        code => during(what)(code),
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        let raw = &self.device.raw;
        // SAFETY: the owner has waited for the queue; null handles are ignored.
        unsafe {
            for picture in &self.pictures {
                raw.destroy_semaphore(picture.drawn, None);
                raw.destroy_framebuffer(picture.framebuffer, None);
                raw.destroy_image_view(picture.view, None);
            }
            self.functions.destroy_swapchain(self.handle, None);
        }
    }
}
