//! The Vulkan surface of a window.

use std::sync::Arc;

use ash::{khr, vk};
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::Window;

use super::device::{Device, DeviceOptions, asked_to_validate};
use super::error::{GpuError, during};
use super::instance::{Instance, loader_reads};
use super::queues::QueueUser;

/// The surface of `window` for `instance`, and the functions that take one; the caller destroys it, before the window.
fn surface_of(
    instance: &Instance,
    window: &Window,
) -> Result<(vk::SurfaceKHR, khr::surface::Instance), String> {
    let display = window.display_handle().map_err(|e| e.to_string())?;
    let handle = window.window_handle().map_err(|e| e.to_string())?;
    let _reading = loader_reads();
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
    .map_err(|code| format!("the window has no Vulkan surface ({code:?})"))?;
    Ok((surface, khr::surface::Instance::new(&instance.entry, &instance.raw)))
}

/// Finds devices and queue families that can show pictures in a window; used before a device is opened.
pub(crate) struct PresentProbe<'a> {
    handle: vk::SurfaceKHR,
    functions: khr::surface::Instance,
    _window: &'a Window,
}

impl<'a> PresentProbe<'a> {
    /// Makes a probe; drop it before the instance.
    ///
    /// # Errors
    /// The window system's message.
    pub(crate) fn new(instance: &Instance, window: &'a Window) -> Result<Self, String> {
        let (handle, functions) = surface_of(instance, window)?;
        Ok(Self { handle, functions, _window: window })
    }

    /// Returns whether `family` of a device of the probe's instance can; false for a device that does not answer.
    pub(crate) fn presents(&self, physical: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: surface and device are of one instance, and the device has that family.
        let answer = unsafe {
            self.functions.get_physical_device_surface_support(physical, family, self.handle)
        };
        answer.unwrap_or(false)
    }
}

impl Drop for PresentProbe<'_> {
    fn drop(&mut self) {
        let _reading = loader_reads();
        // SAFETY: nothing was made of the surface.
        unsafe { self.functions.destroy_surface(self.handle, None) };
    }
}

impl Device {
    /// Opens the chosen device, or the best one that can show pictures in `window`, with a queue for the
    /// simulation and one for the window ([`super::Painter`]), which may be the same.
    ///
    /// # Errors
    /// Those of [`Self::new`]; a device that cannot show pictures in this window.
    pub fn for_window(options: &DeviceOptions, window: &Window) -> Result<Arc<Self>, GpuError> {
        Self::open(
            options,
            asked_to_validate(options),
            Some(&|instance| {
                let probe = PresentProbe::new(instance, window)?;
                Ok(Box::new(move |physical, family| probe.presents(physical, family)))
            }),
        )
    }
}

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
        let refused = |reason: String| GpuError::Window { device: device.name().into(), reason };
        let instance = &device.instance;
        let (surface, functions) = surface_of(instance, &window).map_err(refused)?;
        let mut made = Self {
            handle: surface,
            functions,
            format: vk::SurfaceFormatKHR::default(),
            device: device.clone(),
            _window: window,
        };
        // SAFETY: the surface is of the device's instance.
        let supported = unsafe {
            made.functions.get_physical_device_surface_support(
                device.physical,
                device.queues.family(QueueUser::Window),
                surface,
            )
        };
        if !supported.map_err(during("asking whether the window can be shown"))? {
            return Err(refused("it cannot present to this window".into()));
        }
        made.format = made.choose_format()?;
        Ok(made)
    }

    /// The format: bytes without a colour space of their own, so that grey levels are shown as computed.
    fn choose_format(&self) -> Result<vk::SurfaceFormatKHR, GpuError> {
        // SAFETY: the surface is alive.
        let formats = unsafe {
            self.functions.get_physical_device_surface_formats(self.device.physical, self.handle)
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

    /// The newest picture without tearing where the window system offers that, else one picture after the
    /// other, which every device has: that waits for the screen, one or two refreshes longer.
    pub(crate) fn present_mode(&self) -> Result<vk::PresentModeKHR, GpuError> {
        // SAFETY: the surface is alive.
        let modes = unsafe {
            self.functions
                .get_physical_device_surface_present_modes(self.device.physical, self.handle)
        }
        .map_err(during("asking how the window shows pictures"))?;
        Ok(match modes.contains(&vk::PresentModeKHR::MAILBOX) {
            true => vk::PresentModeKHR::MAILBOX,
            false => vk::PresentModeKHR::FIFO,
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
        let _reading = loader_reads();
        // SAFETY: swapchains of the surface are dropped before it.
        unsafe { self.functions.destroy_surface(self.handle, None) };
    }
}
