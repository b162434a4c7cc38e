//! Writes the last frame into a folder: the stages of image formation, and the bindings of every kernel.

mod bindings;
mod stages;

use std::path::{Path, PathBuf};

use super::{SimError, Simulator};
use crate::output::picture;
use crate::scene::Scene;

/// The folder in a dump that holds the bindings of the kernels.
pub const KERNELS: &str = "kernels";

/// The error of a dump.
#[derive(Debug, thiserror::Error)]
pub enum DumpError {
    /// The frame cannot be read back, or its geometry not laid out.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A file or folder cannot be written.
    #[error("writing {path}: {cause}")]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The system's message.
        cause: String,
    },
}

impl DumpError {
    fn file(path: &Path, cause: impl ToString) -> Self {
        Self::File { path: path.to_owned(), cause: cause.to_string() }
    }
}

/// Writes the last frame of `scene` into `dir`, which is created if it does not exist. The stages have a
/// number and a name (`0_echoes.npy` to `5_bmode.png`, of a fused frame to `9_simulation.png`) and their
/// axes beside them (`.json`). [`KERNELS`] has the bindings of every kernel by name, as
/// `kernels run NAME --input DIR` reads them.
///
/// # Errors
/// A file-system or device error.
pub fn frame(simulator: &mut Simulator, scene: &Scene, dir: &Path) -> Result<(), DumpError> {
    for dir in [dir, &dir.join(KERNELS)] {
        std::fs::create_dir_all(dir).map_err(|e| DumpError::file(dir, e))?;
    }
    stages::write(simulator, scene, dir)?;
    bindings::write(simulator, scene, &dir.join(KERNELS))
}

/// Writes an image, RGBA bytes row by row, as 8-bit grey PNG: its red channel.
///
/// # Errors
/// A file-system error.
///
/// # Panics
/// When `rgba` has not `4 * width * height` bytes.
pub fn png(path: &Path, width: u32, height: u32, rgba: &[u8]) -> Result<(), DumpError> {
    let grey: Vec<u8> = picture::grey(rgba).collect();
    let image = image::GrayImage::from_raw(width, height, grey).expect("one byte per pixel");
    image.save(path).map_err(|e| DumpError::file(path, e))
}
