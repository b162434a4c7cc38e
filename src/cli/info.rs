//! `insonify info`: what this machine can run.

use insonify::gpu::{Found, list_devices};
use insonify::output;
use miette::{IntoDiagnostic, Result};

/// Lists the Vulkan devices with what each lacks.
#[derive(Debug, clap::Args)]
pub struct Info {}

/// Runs the command.
///
/// # Errors
/// No Vulkan loader.
pub fn run(_: &Info) -> Result<()> {
    output::line(format_args!("insonify {}", env!("CARGO_PKG_VERSION")));
    let Found { devices, driver_faults } = list_devices().into_diagnostic()?;
    if devices.is_empty() {
        output::line(format_args!(
            "no Vulkan device; install a GPU driver, or the software driver mesa-vulkan-drivers"
        ));
    }
    for device in devices {
        output::line(format_args!(
            "{}: {} ({}, {}, Vulkan {}, {:.1} GiB){}",
            device.index,
            device.name,
            device.kind,
            device.driver,
            device.api_version,
            device.memory_bytes as f64 / f64::from(1 << 30),
            if device.usable { "" } else { " - cannot be used" }
        ));
        for lack in &device.lacks {
            output::line(format_args!("   lacks {lack}"));
        }
    }
    for fault in driver_faults {
        output::line(format_args!(
            "{fault}; install it again, or remove its file from Vulkan's folder icd.d"
        ));
    }
    Ok(())
}
