//! Kernels compiled ahead, several at once, for a driver that compiles only when a kernel first runs.
//!
//! llvmpipe has one queue, which compiles kernel after kernel, each when it is first dispatched. A dispatch
//! of no groups compiles as well, on any device, and Mesa keeps the result in its folder. So each new kernel
//! is dispatched on a device of its own, beside others, and the device that asked finds it in the folder.

use std::sync::Arc;

use super::commands::Binding;
use super::device::{Device, DeviceOptions};
use super::error::GpuError;
use super::kernel::Kernel;
use super::memory::BufferKind;
use super::reflect::BindingKind;

/// Compiles a kernel on a device of its own. An error here occurs again, and is reported, where the kernel is
/// needed.
pub(super) fn compile(
    device: &str,
    name: &str,
    spirv: &[u32],
    specialization: &[(u32, u32)],
) -> Result<(), GpuError> {
    let device =
        Device::new(&DeviceOptions { selector: Some(device.into()), ..DeviceOptions::default() })?;
    let kernel = Kernel::when_needed(&device, name, spirv, specialization)?;
    dispatch_nothing(&device, &kernel)
}

/// Makes the device compile a kernel, unless that binds more than storage buffers.
fn dispatch_nothing(device: &Arc<Device>, kernel: &Kernel) -> Result<(), GpuError> {
    if (kernel.bindings().iter()).any(|b| b.kind != BindingKind::StorageBuffer) {
        return Ok(());
    }
    // As small as possible: nobody reads them.
    let nothing = || device.buffer("nothing", 4, BufferKind::Storage);
    let made: Result<Vec<_>, _> = kernel.bindings().iter().map(|_| nothing()).collect();
    let made = made?;
    let bindings: Vec<_> = made.iter().map(Binding::Buffer).collect();
    let push = vec![0; kernel.push_constant_bytes()];
    device.once(|commands| commands.dispatch_groups(kernel, [0; 3], &push, &bindings))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::lone_test_device;

    #[test]
    fn a_kernel_is_dispatched_with_nothing_to_do() {
        let words = |bytes: &[u8]| -> Vec<u32> { bytemuck::pod_collect_to_vec(bytes) };
        let add = words(include_bytes!("../../tests/gpu/add.spv"));
        let sample = words(include_bytes!("../../tests/gpu/sample.spv"));
        let device = lone_test_device();
        for spirv in [&add, &sample] {
            let kernel = Kernel::when_needed(&device, "it", spirv, &[]).unwrap();
            dispatch_nothing(&device, &kernel).unwrap();
        }
        assert_eq!(device.validation_messages(), [""; 0]);
        compile(device.name(), "add", &add, &[(1, 3)]).unwrap();
        assert!(compile(device.name(), "add", &add, &[(9, 3)]).is_err());
        assert!(compile("no such device", "add", &add, &[]).is_err());
    }
}
