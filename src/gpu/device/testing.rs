//! Devices of tests: validated, and never opened or dropped while another test of the process uses one.
//!
//! The validation layers of 1.3.239, which Debian 12 has, keep the instances and devices of a process in one table without
//! a lock. Every call reads it; opening and dropping a device change it, and whoever reads meanwhile may read freed memory.

use std::ops::Deref;
use std::sync::{Arc, LazyLock};

use parking_lot::{RwLock, RwLockReadGuard, RwLockWriteGuard};

use super::{Device, DeviceOptions};
use crate::error::GpuError;

/// Shared by tests that use the device of all; held alone by a test with devices of its own.
static TURNS: RwLock<()> = RwLock::new(());

/// The device of all tests in this process, and the right to use it.
pub struct TestDevice {
    device: Arc<Device>,
    _turn: RwLockReadGuard<'static, ()>,
}

/// A device that no other test has, and the right to open and drop more.
pub struct LoneDevice {
    // Dropped before the turn ends.
    device: Arc<Device>,
    _turn: RwLockWriteGuard<'static, ()>,
}

impl Deref for TestDevice {
    type Target = Arc<Device>;

    fn deref(&self) -> &Arc<Device> {
        &self.device
    }
}

impl Deref for LoneDevice {
    type Target = Arc<Device>;

    fn deref(&self) -> &Arc<Device> {
        &self.device
    }
}

/// The device of all tests in this process: the best one, with validation. Pipelines are made once for all of them, and
/// a message of validation fails every test that looks. Keep it until all that was made of it is dropped. Panics with the
/// remedy where the driver or the layer is missing, which `tools/setup.sh` installs.
pub fn test_device() -> TestDevice {
    static DEVICE: LazyLock<Arc<Device>> = LazyLock::new(validated);
    // A test may ask twice.
    let turn = TURNS.read_recursive();
    TestDevice { device: DEVICE.clone(), _turn: turn }
}

/// Like [`test_device`], but nobody else's: for tests that count what is on it, or that it is dropped. Waits until no
/// other test uses a device; a test that has one may not ask for another.
pub fn lone_test_device() -> LoneDevice {
    lone_device(&VALIDATED).unwrap_or_else(|error| panic!("{}", remedy(&error)))
}

/// Like [`lone_test_device`], with these options.
///
/// # Errors
/// Those of [`Device::new`].
pub fn lone_device(options: &DeviceOptions) -> Result<LoneDevice, GpuError> {
    let turn = TURNS.write();
    Ok(LoneDevice { device: Device::new(options)?, _turn: turn })
}

const VALIDATED: DeviceOptions = DeviceOptions {
    selector: None,
    validate: true,
    kept_in: None,
    without_ray_query: false,
    without_acceleration_structures: false,
};

fn validated() -> Arc<Device> {
    Device::new(&VALIDATED).unwrap_or_else(|error| panic!("{}", remedy(&error)))
}

fn remedy(error: &GpuError) -> String {
    format!(
        "the tests need a Vulkan device and the validation layers: {error}\n\
         ./tools/test.sh installs both"
    )
}
