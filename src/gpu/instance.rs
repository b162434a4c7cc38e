//! The Vulkan instance: loader, validation layers and the log of their messages.

use std::ffi::{CStr, c_char, c_void};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use ash::{ext, khr, vk};
use parking_lot::Mutex;

use super::error::{GpuError, during};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Extensions for windows of each system; those that the loader offers are enabled.
const SURFACES: [&CStr; 6] = [
    khr::surface::NAME,
    khr::xlib_surface::NAME,
    khr::xcb_surface::NAME,
    khr::wayland_surface::NAME,
    khr::win32_surface::NAME,
    ext::metal_surface::NAME,
];

/// Most messages kept; a mistake in a loop would otherwise fill the memory.
const MAX_MESSAGES: usize = 1000;

/// Warnings and errors of the validation layers and of this layer's own hazard check.
///
/// Clones share one list, so that a test can read the messages from the device's destruction.
#[derive(Clone, Debug, Default)]
pub struct ValidationLog(Arc<Mutex<Vec<String>>>);

impl ValidationLog {
    /// Every message so far, oldest first.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().clone()
    }

    /// Empties the list and returns it.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock())
    }

    pub(crate) fn push(&self, message: String) {
        let mut messages = self.0.lock();
        if messages.len() < MAX_MESSAGES {
            messages.push(message);
        }
    }
}

/// Lock for the loader's lists of instances, drivers and devices. The loader (1.3.239, 1.4.309) walks all of them, and
/// what their entries point to, wherever it looks up a function, names an object or makes a swapchain; its own locks
/// do not keep another thread from destroying a device meanwhile.
static LOADER_LISTS: RwLock<()> = RwLock::new(());

/// Keeps the loader's lists as they are: for every call that makes the loader read them.
pub(super) fn loader_reads() -> RwLockReadGuard<'static, ()> {
    LOADER_LISTS.read().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps others from the loader's lists: for every call that makes the loader change them.
pub(super) fn loader_changes() -> RwLockWriteGuard<'static, ()> {
    LOADER_LISTS.write().unwrap_or_else(PoisonError::into_inner)
}

struct Messenger {
    functions: ext::debug_utils::Instance,
    handle: vk::DebugUtilsMessengerEXT,
}

/// Loader, instance and, with validation, the messenger.
pub(crate) struct Instance {
    pub(crate) raw: ash::Instance,
    pub(crate) api_version: u32,
    /// True where object names and labels are possible.
    pub(crate) debug_utils: bool,
    pub(crate) validating: bool,
    pub(crate) log: ValidationLog,
    messenger: Option<Messenger>,
    /// Sentences about drivers of the machine that the loader could not load.
    pub(crate) driver_faults: Vec<String>,
    /// The log into which the loader writes that, also while the instance is destroyed.
    _log: ValidationLog,
    /// Holds the loader's library open; dropped last.
    pub(crate) entry: ash::Entry,
}

/// Paths of the loader, or of MoltenVK itself, on macOS, beside the folders that the system searches:
/// bundled with the program, Homebrew on Apple silicon and on Intel, LunarG's package.
const MACOS_LOADERS: [&str; 6] = [
    "@executable_path/../Frameworks/libvulkan.1.dylib",
    "@executable_path/../Frameworks/libMoltenVK.dylib",
    "libvulkan.1.dylib",
    "/opt/homebrew/lib/libvulkan.1.dylib",
    "/usr/local/lib/libvulkan.1.dylib",
    "libMoltenVK.dylib",
];

/// The system's Vulkan loader; the error is that of its usual name.
fn load() -> Result<ash::Entry, ash::LoadingError> {
    // SAFETY: the loader is the system's Vulkan library; its initialisers have no precondition.
    let usual = unsafe { ash::Entry::load() };
    let others: &[&str] = if cfg!(target_os = "macos") { &MACOS_LOADERS } else { &[] };
    usual.or_else(|error| {
        // SAFETY: as above.
        let mut found =
            others.iter().filter_map(|path| unsafe { ash::Entry::load_from(path) }.ok());
        found.next().ok_or(error)
    })
}

impl Instance {
    /// Opens the loader and makes an instance; with `validate` also the validation layer with
    /// synchronization validation, which must then be installed; with `window` also the extensions for
    /// windows, as far as offered.
    pub(crate) fn new(validate: bool, window: bool) -> Result<Self, GpuError> {
        let loader = |reason: String| GpuError::Loader { reason };
        let entry = load().map_err(|e| loader(e.to_string()))?;
        // SAFETY: the entry was loaded successfully.
        let loader_version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(during("asking for the loader's version"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if loader_version < vk::API_VERSION_1_1 {
            return Err(loader("it offers Vulkan 1.0, and 1.1 is needed".into()));
        }
        let api_version = loader_version.min(vk::API_VERSION_1_3);

        let mut offered = extension_names(&entry, None)?;
        let mut layers = Vec::new();
        if validate {
            offered.extend(validation_extensions(&entry)?);
            layers.push(VALIDATION_LAYER.as_ptr());
        }
        let has = |name: &CStr| offered.iter().any(|offer| offer.as_c_str() == name);
        let mut extensions = Vec::new();
        let debug_utils = has(ext::debug_utils::NAME);
        if debug_utils {
            extensions.push(ext::debug_utils::NAME.as_ptr());
        }
        // Otherwise the loader hides MoltenVK's devices.
        let portability = has(khr::portability_enumeration::NAME);
        if portability {
            extensions.push(khr::portability_enumeration::NAME.as_ptr());
        }
        let surfaces = SURFACES.iter().filter(|name| window && has(name));
        extensions.extend(surfaces.map(|name| name.as_ptr()));
        // Layers since 1.3.268 take settings; older ones know only the feature.
        let settable = validate && has(ext::layer_settings::NAME);
        if settable {
            extensions.push(ext::layer_settings::NAME.as_ptr());
        } else if validate {
            extensions.push(ext::validation_features::NAME.as_ptr());
        }

        let application =
            vk::ApplicationInfo::default().application_name(c"insonify").api_version(api_version);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        // Accesses by shaders are checked by default in older layers, on request in newer ones.
        let yes = [vk::TRUE];
        let settings = [c"validate_sync", c"syncval_shader_accesses_heuristic"]
            .map(|name| switched_on(name, &yes));
        let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if portability {
            info.flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        if settable {
            info = info.push_next(&mut settings);
        } else if validate {
            info = info.push_next(&mut features);
        }
        // The loader tells of drivers while it makes the instance, and only then.
        let log = ValidationLog::default();
        let mut listening = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::GENERAL)
            .pfn_user_callback(Some(on_message))
            .user_data(Arc::as_ptr(&log.0).cast_mut().cast());
        if debug_utils {
            info = info.push_next(&mut listening);
        }
        let changing = loader_changes();
        // SAFETY: all pointers in `info` outlive the call; layers and extensions are offered; the log that the callback gets
        // lives as long as the instance, which holds it.
        let made = unsafe { entry.create_instance(&info, None) };
        drop(changing);
        let driver_faults = driver_faults(&log.take());
        let raw = made.map_err(|code| match code {
            // The loader's word for a machine without a single driver that answers.
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => GpuError::no_device(&driver_faults),
            code => during("creating the Vulkan instance")(code),
        })?;
        let mut instance = Self {
            raw,
            api_version,
            debug_utils,
            validating: validate,
            log: ValidationLog::default(),
            messenger: None,
            driver_faults,
            _log: log,
            entry,
        };
        if validate {
            instance.messenger = Some(instance.listen()?);
        }
        Ok(instance)
    }

    fn listen(&self) -> Result<Messenger, GpuError> {
        let _reading = loader_reads();
        let functions = ext::debug_utils::Instance::new(&self.entry, &self.raw);
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            // GENERAL would add the loader's remarks about other drivers on the machine.
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(on_message))
            .user_data(Arc::as_ptr(&self.log.0).cast_mut().cast());
        // SAFETY: the user data is the log's mutex, which `self` keeps alive past the messenger.
        let handle = unsafe { functions.create_debug_utils_messenger(&info, None) }
            .map_err(during("creating the debug messenger"))?;
        Ok(Messenger { functions, handle })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let _changing = loader_changes();
        // SAFETY: every device of this instance has been destroyed by its owner before.
        unsafe {
            if let Some(messenger) = self.messenger.take() {
                messenger.functions.destroy_debug_utils_messenger(messenger.handle, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// A setting of the validation layer.
fn switched_on<'a>(name: &'a CStr, yes: &'a [vk::Bool32; 1]) -> vk::LayerSettingEXT<'a> {
    let mut setting = vk::LayerSettingEXT::default()
        .layer_name(VALIDATION_LAYER)
        .setting_name(name)
        .ty(vk::LayerSettingTypeEXT::BOOL32)
        .values(bytemuck::cast_slice(yes));
    // ash counts bytes, Vulkan counts values.
    setting.value_count = 1;
    setting
}

/// Extensions of the loader, or of one layer.
fn extension_names(
    entry: &ash::Entry,
    layer: Option<&CStr>,
) -> Result<Vec<std::ffi::CString>, GpuError> {
    // SAFETY: the entry is loaded and the layer name, if any, is NUL-terminated.
    let properties = unsafe { entry.enumerate_instance_extension_properties(layer) }.map_err(
        |code| match code {
            // What the loader says of a description that it cannot parse, beside sound ones.
            vk::Result::ERROR_OUT_OF_HOST_MEMORY => GpuError::Descriptions,
            code => during("listing the instance extensions")(code),
        },
    )?;
    Ok(properties
        .iter()
        .filter_map(|p| p.extension_name_as_c_str().ok().map(CStr::to_owned))
        .collect())
}

/// The extensions of the validation layer, or an error with the missing part.
fn validation_extensions(entry: &ash::Entry) -> Result<Vec<std::ffi::CString>, GpuError> {
    let unavailable = |reason: &str| GpuError::ValidationUnavailable { reason: reason.into() };
    // SAFETY: the entry is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(during("listing the instance layers"))?;
    if !layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        return Err(unavailable("the layer VK_LAYER_KHRONOS_validation is not installed"));
    }
    let extensions = extension_names(entry, Some(VALIDATION_LAYER))?;
    let has = |name: &CStr| extensions.iter().any(|e| e.as_c_str() == name);
    let configurable = has(ext::layer_settings::NAME) || has(ext::validation_features::NAME);
    if !configurable || !has(ext::debug_utils::NAME) {
        return Err(unavailable(
            "the installed layer lacks synchronization validation or debug messages",
        ));
    }
    Ok(extensions)
}

/// Sentences about drivers that the loader could not load, from its errors: each once, without its own prefixes.
fn driver_faults(messages: &[String]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for message in messages {
        let text = message.splitn(3, ": ").last().unwrap_or_default();
        // The line after the cause names only the file that is passed over.
        if text.is_empty() || text.starts_with("loader_") {
            continue;
        }
        let fault = format!("a driver could not be loaded: {text}");
        if !out.contains(&fault) {
            out.push(fault);
        }
    }
    out
}

/// Called by the validation layers and the loader, from any thread.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `log` is the mutex given in `listen`, alive as long as the messenger.
    let log = unsafe { &*log.cast::<Mutex<Vec<String>>>() };
    // SAFETY: Vulkan passes a valid structure, or null.
    let data = unsafe { data.as_ref() };
    let text = |of: fn(&vk::DebugUtilsMessengerCallbackDataEXT<'_>) -> *const c_char| {
        data.map(of)
            .filter(|text| !text.is_null())
            // SAFETY: texts of the structure are NUL-terminated or null.
            .map(|text| unsafe { CStr::from_ptr(text) }.to_string_lossy())
            .unwrap_or_default()
    };
    let (name, text) = (text(|d| d.p_message_id_name), text(|d| d.p_message));
    let mut messages = log.lock();
    if messages.len() < MAX_MESSAGES {
        messages.push(format!("{severity:?}: {name}: {text}"));
    }
    vk::FALSE
}
