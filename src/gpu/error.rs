//! Errors of the device, with the Vulkan result code and a remedy where one is known.

use ash::vk;

/// An error of the Vulkan layer.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// The Vulkan loader (`libvulkan.so.1`, `vulkan-1.dll`) is missing or too old.
    #[error(
        "no usable Vulkan loader: {reason}; install the package libvulkan1 (Debian, Ubuntu), vulkan-loader (Fedora) or vulkan-icd-loader (Arch)"
    )]
    Loader {
        /// The loader's message.
        reason: String,
    },
    /// The loader cannot read the descriptions of drivers and layers.
    #[error(
        "the Vulkan loader cannot read the descriptions of drivers and layers (ERROR_OUT_OF_HOST_MEMORY), most often as one is cut off; `for f in $(echo $VK_DRIVER_FILES:$VK_ICD_FILENAMES | tr : ' ') /usr/share/vulkan/*/*.json /etc/vulkan/*/*.json ~/.local/share/vulkan/*/*.json; do [ ! -f $f ] || python3 -m json.tool $f >/dev/null 2>&1 || echo $f; done` names it: install its package again, or remove the file"
    )]
    Descriptions,
    /// No Vulkan device at all, or none that can run the kernels.
    #[error(
        "no usable Vulkan device{seen}; install a GPU driver, or the software driver mesa-vulkan-drivers"
    )]
    NoDevice {
        /// The devices seen with what each lacks; empty when there is none.
        seen: String,
    },
    /// `--device` names no device or one that cannot run the kernels.
    #[error("device '{selector}' {problem}; devices are:\n{available}")]
    UnknownDevice {
        /// The selector that was asked for.
        selector: String,
        /// The reason why it cannot be used.
        problem: String,
        /// A row per device: index, name, driver.
        available: String,
    },
    /// Validation was asked for, but is not available.
    #[error(
        "validation was asked for, but {reason}; install the package vulkan-validationlayers, or run without --validate and INSONIFY_VALIDATE"
    )]
    ValidationUnavailable {
        /// The missing layer or extension.
        reason: String,
    },
    /// A Vulkan call failed.
    #[error("Vulkan error {code:?} while {what}")]
    Vulkan {
        /// The result code as Vulkan gave it.
        code: vk::Result,
        /// The operation, with the name of the object.
        what: String,
    },
    /// The device stopped answering (driver reset, a kernel that ran past the watchdog).
    #[error(
        "the Vulkan device was lost (ERROR_DEVICE_LOST) while {what}; the last pass that had begun is '{last_pass}', of the passes: {passes}"
    )]
    DeviceLost {
        /// The host's operation.
        what: String,
        /// The last timer scope that began on the device.
        last_pass: String,
        /// All scopes of the submission in order.
        passes: String,
    },
    /// The submission was abandoned because its result is no longer wanted: see [`super::Frames::abandon_when`].
    #[error("it was abandoned for something newer")]
    Abandoned,
    /// Device memory could not be allocated.
    #[error("no memory for '{name}' ({bytes} bytes): {reason}")]
    Allocation {
        /// Name of the buffer or image.
        name: String,
        /// Its size in bytes.
        bytes: u64,
        /// The allocator's message.
        reason: String,
    },
    /// A buffer or image is larger than the device takes.
    #[error("'{name}' of {what} exceeds the device's {limit_name} of {limit}")]
    TooLarge {
        /// Name of the object.
        name: String,
        /// Its size with unit.
        what: String,
        /// Vulkan's name of the limit.
        limit_name: &'static str,
        /// The limit with unit.
        limit: String,
    },
    /// A copy outside a buffer or image, or data of the wrong length.
    #[error("{what} of '{name}': bytes {offset}..{end} of {size}")]
    OutOfBounds {
        /// The operation.
        what: &'static str,
        /// Name of the object.
        name: String,
        /// First byte asked for.
        offset: u64,
        /// One past the last byte asked for.
        end: u64,
        /// Size of the object in bytes.
        size: u64,
    },
    /// SPIR-V that cannot be reflected or is not a kernel of this layer.
    #[error("kernel '{kernel}': {problem}")]
    Kernel {
        /// Name of the kernel.
        kernel: String,
        /// The problem.
        problem: String,
    },
    /// The driver ended its process on a kernel, or while it built acceleration structures, in a process of its own.
    #[error(
        "the driver of {device} ended {work} ({status}){words}; this is a fault of the driver or its compiler. Take another width of vectors (LP_NATIVE_VECTOR_WIDTH=256 before the command; now {width}), the other tracer (--tracer bvh, --tracer ray-query), another device (--device; insonify info lists them), or another version of the driver"
    )]
    Driver {
        /// Name of the device.
        device: String,
        /// The work: "on the kernel 'beam'".
        work: String,
        /// The way in which the process ended.
        status: std::process::ExitStatus,
        /// Its last words, after a colon; empty without any.
        words: String,
        /// Width of vectors that Mesa compiles for, bits, as the environment has it.
        width: String,
    },
    /// The bindings of a dispatch do not fit the kernel.
    #[error("kernel '{kernel}', {binding}: {problem}")]
    Binding {
        /// Name of the kernel.
        kernel: String,
        /// Name, set and number of the binding.
        binding: String,
        /// The problem.
        problem: String,
    },
    /// The push constants of a dispatch do not fit the kernel.
    #[error("kernel '{kernel}': its push constants are {expected} bytes, {given} were given")]
    PushConstants {
        /// Name of the kernel.
        kernel: String,
        /// Size of the block in the SPIR-V, in bytes.
        expected: usize,
        /// Size given, in bytes.
        given: usize,
    },
    /// More work groups than the device takes in one dispatch.
    #[error("kernel '{kernel}': {groups:?} work groups exceed the device's {limit:?}")]
    GroupCount {
        /// Name of the kernel.
        kernel: String,
        /// Work groups asked for.
        groups: [u32; 3],
        /// maxComputeWorkGroupCount.
        limit: [u32; 3],
    },
    /// Geometry that cannot become an acceleration structure.
    #[error("acceleration structure '{name}': {problem}")]
    Geometry {
        /// Name of the mesh.
        name: String,
        /// The problem.
        problem: String,
    },
    /// A device that cannot show pictures in the window.
    #[error(
        "'{device}' cannot be used with this window: {reason}; take another one with --device (insonify info lists them), or `insonify render`, which needs no window"
    )]
    Window {
        /// Name of the device.
        device: String,
        /// The missing ability.
        reason: String,
    },
    /// The device lacks a feature.
    #[error("'{device}' has no {feature}")]
    Unsupported {
        /// Name of the device.
        device: String,
        /// The missing feature.
        feature: String,
    },
}

/// Turns a bare result code into an error with the operation; `what` completes the sentence "Vulkan
/// error X while ...".
pub(crate) fn during(what: impl Into<String>) -> impl FnOnce(vk::Result) -> GpuError {
    move |code| GpuError::Vulkan { code, what: what.into() }
}

impl GpuError {
    /// No device at all, on a machine whose drivers have these faults.
    pub(crate) fn no_device(driver_faults: &[String]) -> Self {
        Self::NoDevice { seen: driver_faults.iter().map(|fault| format!("; {fault}")).collect() }
    }
}
