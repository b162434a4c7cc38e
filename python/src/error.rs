//! Exceptions, with the text that the command line prints.

use std::fmt::Display;

use insonify::issue::{Issue, explanation};
use insonify::scene::file;
use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyException;

create_exception!(
    insonify,
    InsonifyError,
    PyException,
    "The simulator cannot do what it is told to: no device, no memory, too large a scene."
);
create_exception!(
    insonify,
    SceneError,
    InsonifyError,
    "A mistake in a scene, its settings or its files: place, cause and remedy, as the command line prints it."
);

/// The exception for an error of the device or the simulator.
pub fn raised(error: &impl Display) -> PyErr {
    InsonifyError::new_err(error.to_string())
}

/// The exception for a mistake in a scene.
pub fn mistaken(error: &file::SceneError) -> PyErr {
    SceneError::new_err(explanation(error))
}

/// The exception for a mesh with these findings.
pub fn unusable(name: &str, issues: &[Issue]) -> PyErr {
    let errors = issues.iter().filter(|issue| issue.is_error());
    let text = |issue: &Issue| format!("{}\n  help: {}", issue.message, issue.remedy);
    let texts: Vec<_> = errors.map(text).collect();
    SceneError::new_err(format!("mesh `{name}`: {}", texts.join("\n")))
}
