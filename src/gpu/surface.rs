//! A window as something to present to.

use std::sync::Arc;

use ash::{khr, vk};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::Window;

use super::device::Device;
use super::error::{GpuError, during};

/// A window's surface; it keeps the window open.
pub(crate) struct Surface {
    pub(crate) handle: vk::SurfaceKHR,
    pub(crate) functions: khr::surface::Instance,
    pub(crate) format: vk::SurfaceFormatKHR,
    device: Arc<Device>,
    _window: Arc<Window>,
}

impl Surface {
    /// # Errors
    /// A window system or a device that cannot show pictures, with the remedy.
    pub(crate) fn new(device: &Arc<Device>, window: Arc<Window>) -> Result<Self, GpuError> {
        let refused = |reason: String| GpuError::Window {
            device: device.name().into(),
            reason,
        };
        let display = window
            .display_handle()
            .map_err(|e| refused(e.to_string()))?;
        let handle = window.window_handle().map_err(|e| refused(e.to_string()))?;
        let instance = &device.instance;
        // SAFETY: the handles belong to the window, which outlives the surface.
        let surface = unsafe {
            ash_window::create_surface(
                &instance.entry,
                &instance.raw,
                display.as_raw(),
                handle.as_raw(),
                None,
            )
        }
        .map_err(|code| refused(format!("the window has no Vulkan surface ({code:?})")))?;
        let mut made = Self {
            handle: surface,
            functions: khr::surface::Instance::new(&instance.entry, &instance.raw),
            format: vk::SurfaceFormatKHR::default(),
            device: device.clone(),
            _window: window,
        };
        // SAFETY: the surface is of the device's instance.
        let supported = unsafe {
            made.functions.get_physical_device_surface_support(
                device.physical,
                device.queue_family,
                surface,
            )
        };
        if !supported.map_err(during("asking whether the window can be shown"))? {
            return Err(refused("it cannot present to this window".into()));
        }
        made.format = made.choose_format()?;
        Ok(made)
    }

    /// Bytes without a colour space of their own: grey levels are shown as they are computed.
    fn choose_format(&self) -> Result<vk::SurfaceFormatKHR, GpuError> {
        // SAFETY: the surface is alive.
        let formats = unsafe {
            self.functions
                .get_physical_device_surface_formats(self.device.physical, self.handle)
        }
        .map_err(during("listing the window's formats"))?;
        let wanted = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
        let found = wanted.iter().find_map(|&format| {
            let srgb = vk::ColorSpaceKHR::SRGB_NONLINEAR;
            let fits = |f: &&vk::SurfaceFormatKHR| f.format == format && f.color_space == srgb;
            formats.iter().find(fits)
        });
        found.copied().ok_or_else(|| GpuError::Window {
            device: self.device.name().into(),
            reason: format!("it shows none of {wanted:?}, but {formats:?}"),
        })
    }

    /// Sizes and usages that the window takes now.
    pub(crate) fn capabilities(&self) -> Result<vk::SurfaceCapabilitiesKHR, GpuError> {
        // SAFETY: the surface is alive.
        unsafe {
            self.functions
                .get_physical_device_surface_capabilities(self.device.physical, self.handle)
        }
        .map_err(during("asking for the window's size"))
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        // SAFETY: swapchains of the surface are dropped before it.
        unsafe { self.functions.destroy_surface(self.handle, None) };
    }
}
