//! The Python module `insonify._insonify`: scenes, simulators and their frames.
//!
//! Python never waits for a lock here while it holds the interpreter, and the interpreter is free while the device
//! works. Every fault is an exception.

// What Python sees is described in insonify/_insonify.pyi.
#![allow(missing_docs)]

mod arrays;
mod dataset;
mod doppler;
mod error;
mod frame;
mod importing;
mod kept_frame;
mod levels;
mod pickle;
mod pictures;
mod process;
mod running;
mod save;
mod saving;
mod scene;
mod simulator;
mod skin;
mod state;
mod toml;
mod written;

use std::process::ExitCode;

use insonify::gpu;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use error::{InsonifyError, SceneError, raised};

/// The Vulkan devices of this machine. InsonifyError: there is no Vulkan loader.
#[pyfunction]
fn devices(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let all = py.detach(gpu::list_devices).map_err(|e| raised(&e))?;
    let dictionary = |info: gpu::DeviceInfo| {
        let out = PyDict::new(py);
        out.set_item("index", info.index)?;
        out.set_item("name", info.name)?;
        out.set_item("kind", format!("{:?}", info.kind).to_lowercase())?;
        out.set_item("driver", info.driver)?;
        out.set_item("vulkan", info.api_version)?;
        out.set_item("memory_bytes", info.memory_bytes)?;
        out.set_item("ray_query", info.ray_query)?;
        out.set_item("usable", info.usable)?;
        out.set_item("lacks", info.lacks)?;
        Ok(out)
    };
    all.devices.into_iter().map(dictionary).collect()
}

/// Variables that make Mesa's software driver compile in a third of the time; import sets them.
#[pyfunction]
fn driver_environment() -> Vec<(&'static str, std::ffi::OsString)> {
    gpu::driver_environment()
}

/// Names a program that compiles kernels in a process of its own, by compile_standard_input; import does.
#[pyfunction]
fn set_compiler(program: std::path::PathBuf, arguments: Vec<std::ffi::OsString>) {
    gpu::set_compiler(program, arguments);
}

/// Compiles the kernel that standard input describes; returns the exit code.
#[pyfunction]
fn compile_standard_input(py: Python<'_>) -> u8 {
    py.detach(gpu::compile_standard_input)
}

/// Runs the command line of these arguments, of which the first is the program's name, in this process, which is to end
/// with the exit code that it returns. Wrong arguments, --help and --version end it at once.
#[pyfunction]
fn run_command(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    u8::from(py.detach(|| insonify::cli::run(arguments)) != ExitCode::SUCCESS)
}

#[pymodule]
fn _insonify(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("InsonifyError", py.get_type::<InsonifyError>())?;
    module.add("SceneError", py.get_type::<SceneError>())?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<simulator::Simulator>()?;
    module.add_class::<frame::Frame>()?;
    module.add_function(wrap_pyfunction!(pickle::again, module)?)?;
    module.add_function(wrap_pyfunction!(kept_frame::again_frame, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::make_dataset, module)?)?;
    module.add_function(wrap_pyfunction!(save::save, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::png, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::write, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::save_film, module)?)?;
    module.add_function(wrap_pyfunction!(importing::import_labels, module)?)?;
    module.add_function(wrap_pyfunction!(devices, module)?)?;
    module.add_function(wrap_pyfunction!(set_compiler, module)?)?;
    module.add_function(wrap_pyfunction!(run_command, module)?)?;
    module.add_function(wrap_pyfunction!(process::forked, module)?)?;
    module.add_function(wrap_pyfunction!(compile_standard_input, module)?)?;
    module.add_function(wrap_pyfunction!(driver_environment, module)?)
}
