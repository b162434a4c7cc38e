//! Data sets: labelled samples of scenes by a plan, counted so that each can be made alone.
//!
//! A [`Plan`] says what is drawn for each sample, a [`Studio`] makes samples, a [`Store`] writes them. Everything that
//! sample k gets is a function of the plan and of k: shards, their order and machines do not matter.

use std::path::Path;

use miette::Diagnostic;
use thiserror::Error;

use crate::issue::FileError;
use crate::scene::SceneError;
use crate::sim::SimError;

mod archive;
mod distribution;
mod draws;
mod exchange;
mod hold;
pub mod layouts;
mod links;
mod members;
mod packed;
mod plan;
mod pose;
mod reading;
mod run;
mod scenes;
mod sheet;
mod split;
mod store;
mod studio;
mod tables;

pub use members::colours;
pub use plan::{Array, Format, Part, Plan, Precision, Sample, Segmented, Split};
pub use run::{MOST_CHECKED, Run};
pub use sheet::Gallery;
pub use store::{Event, Store};
pub use studio::{Made, Studio};

/// The reason why a sample was not made or written.
#[derive(Debug, Error, Diagnostic)]
pub enum DatasetError {
    /// A value that the scene cannot have.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] Box<SceneError>),
    /// A frame could not be simulated.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A file or folder cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    File(#[from] FileError),
    /// The program that makes the data set wants it to end.
    #[error("it was stopped; go on with --resume (Python: resume=True)")]
    Stopped,
}

impl From<SceneError> for DatasetError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}

impl DatasetError {
    /// A file that could not be written.
    fn writing(path: &Path, cause: std::io::Error) -> Self {
        let message = format!("cannot be written: {cause}");
        Self::File(FileError::file(
            path,
            message,
            "make room or check the permissions, then go on with --resume",
        ))
    }

    /// A file that could not be read.
    fn reading(path: &Path, cause: std::io::Error) -> Self {
        Self::File(FileError::file(
            path,
            format!("cannot be read: {cause}"),
            "check the permissions",
        ))
    }
}
