//! Kernels compiled ahead, several at once, for a driver that compiles only when a kernel first runs.
//!
//! llvmpipe has one queue, which compiles kernel after kernel, each when it is first dispatched. A dispatch
//! of no groups compiles as well, on any device, and Mesa keeps the result in its folder. So each kernel that
//! is new here is dispatched on a device of its own, beside others, and the device that asked finds it there.

use std::sync::Arc;

use super::commands::Binding;
use super::device::{Device, DeviceOptions};
use super::error::GpuError;
use super::kernel::Kernel;
use super::memory::BufferKind;
use super::reflect::BindingKind;

/// No kernel's blocks have more bytes before their last, unsized member.
const BYTES: u64 = 4096;

/// Compiles a kernel on a device of its own. What fails here fails again, and is told, where the kernel is
/// wanted.
pub(super) fn compile(
    device: &str,
    name: &str,
    spirv: &[u32],
    specialization: &[(u32, u32)],
) -> Result<(), GpuError> {
    let device = Device::new(&DeviceOptions {
        selector: Some(device.into()),
        ..DeviceOptions::default()
    })?;
    dispatch_nothing(
        &Kernel::when_needed(&device, name, spirv, specialization)?,
        &device,
    )
    .map(drop)
}

/// Has the device compile a kernel; false: it binds more than storage buffers, and nothing was done.
fn dispatch_nothing(kernel: &Kernel, device: &Arc<Device>) -> Result<bool, GpuError> {
    let buffers = (kernel.bindings().iter()).all(|b| b.kind == BindingKind::StorageBuffer);
    if !buffers {
        return Ok(false);
    }
    let nothing = || device.buffer("nothing", BYTES, BufferKind::Storage);
    let made: Result<Vec<_>, _> = kernel.bindings().iter().map(|_| nothing()).collect();
    let made = made?;
    let bindings: Vec<_> = made.iter().map(Binding::Buffer).collect();
    let push = vec![0; kernel.push_constant_bytes()];
    device.once(|commands| commands.dispatch_groups(kernel, [0; 3], &push, &bindings))?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::test_device;

    #[test]
    fn a_kernel_is_dispatched_with_nothing_to_do() {
        let words = |bytes: &[u8]| -> Vec<u32> { bytemuck::pod_collect_to_vec(bytes) };
        let add = words(include_bytes!("../../tests/gpu/add.spv"));
        let sample = words(include_bytes!("../../tests/gpu/sample.spv"));
        let device = test_device();
        for (spirv, done) in [(&add, true), (&sample, false)] {
            let kernel = Kernel::when_needed(&device, "it", spirv, &[]).unwrap();
            assert_eq!(dispatch_nothing(&kernel, &device).unwrap(), done);
        }
        assert_eq!(device.validation_messages(), [""; 0]);
        compile(device.name(), "add", &add, &[(1, 3)]).unwrap();
        assert!(compile(device.name(), "add", &add, &[(9, 3)]).is_err());
        assert!(compile("no such device", "add", &add, &[]).is_err());
    }
}
