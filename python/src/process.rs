//! The process that devices belong to: their threads do not follow where it forks.

use std::process;
use std::sync::OnceLock;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// The process in which the first device was opened.
static FIRST: OnceLock<u32> = OnceLock::new();

/// Marks this process as the one that devices belong to.
///
/// # Errors
/// It was forked from one that had opened a device: the driver's threads and those of our own pool are not here, and what
/// waits for them waits for ever.
pub fn enter() -> PyResult<()> {
    let own = process::id();
    match *FIRST.get_or_init(|| own) == own {
        true => Ok(()),
        false => Err(PyRuntimeError::new_err(
            "this process was forked from one that had opened a device, whose threads stayed there: start it by spawn or \
             forkserver, as multiprocessing.get_context(\"spawn\") and DataLoader(multiprocessing_context=\"spawn\") do, \
             or fork before the first simulator is made",
        )),
    }
}

/// Lets this process end without its drivers, if it was forked from one that had opened a device. Called after each fork.
#[pyfunction]
pub fn forked() {
    if is_forked() {
        insonify::gpu::end_without_drivers();
    }
}

/// True in a process that was forked from one that had opened a device.
pub fn is_forked() -> bool {
    FIRST.get().is_some_and(|first| *first != process::id())
}
