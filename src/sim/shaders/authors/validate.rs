//! Validation of compiled modules by naga and by spirv-val.

use std::io::Write;
use std::process::{Command, Stdio};

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::Error;

/// Parses and validates a module with naga, which reads only the portable subset: no ray query
/// and nothing beyond push constants.
pub fn naga(stem: &str, spirv: &[u8]) -> Result<(), Error> {
    let invalid = |message| Error::Invalid { stem: stem.to_owned(), validator: "naga", message };
    let module = naga::front::spv::parse_u8_slice(spirv, &naga::front::spv::Options::default())
        .map_err(|e| invalid(chain(&e)))?;
    Validator::new(ValidationFlags::all(), Capabilities::IMMEDIATES)
        .validate(&module)
        .map_err(|e| invalid(chain(e.as_inner())))?;
    Ok(())
}

/// An error and its causes on one line; naga's own messages keep the cause to the source.
fn chain(error: &dyn std::error::Error) -> String {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        message += &format!(": {error}");
        cause = error.source();
    }
    message
}

/// Runs spirv-val on a module for the Vulkan version `target` (`vulkan1.1`). `Ok(false)` when
/// spirv-val is not installed (Debian: spirv-tools).
pub fn spirv_val(stem: &str, spirv: &[u8], target: &str) -> Result<bool, Error> {
    let invalid =
        |message| Error::Invalid { stem: stem.to_owned(), validator: "spirv-val", message };
    let child = Command::new("spirv-val")
        .args(["--target-env", target, "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(invalid(error.to_string())),
    };
    // A module that is refused early closes the pipe; the exit status tells.
    let _ = child.stdin.take().map(|mut pipe| pipe.write_all(spirv));
    let output = child.wait_with_output().map_err(|e| invalid(e.to_string()))?;
    if output.status.success() {
        return Ok(true);
    }
    let text = [output.stdout, output.stderr].concat();
    Err(invalid(String::from_utf8_lossy(&text).trim().to_owned()))
}
