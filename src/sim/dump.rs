//! The last frame in a folder: stages to look at, and what every kernel had bound.

mod bindings;
mod rf;
mod stages;

use std::path::{Path, PathBuf};

use super::{SimError, Simulator};
use crate::scene::Scene;

/// Folder in a dump with what the kernels had bound.
pub const KERNELS: &str = "kernels";

/// Why a frame was not dumped.
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
        /// What the system says.
        cause: String,
    },
}

impl DumpError {
    fn file(path: &Path, cause: impl ToString) -> Self {
        Self::File { path: path.to_owned(), cause: cause.to_string() }
    }
}

/// Writes the last frame of `scene` into `dir`, which is made where it does not exist: the stages
/// by number and name (`0_echoes.npy` to `5_bmode.png`, of a fused frame to `9_simulation.png`) with
/// their axes beside them (`.json`), and
/// in [`KERNELS`] the bindings of every kernel by name, as `kernels run NAME --input DIR` reads
/// them.
///
/// # Errors
/// What the file system or the device says.
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
/// What the file system says.
///
/// # Panics
/// When `rgba` has not `4 * width * height` bytes.
pub fn png(path: &Path, width: u32, height: u32, rgba: &[u8]) -> Result<(), DumpError> {
    let grey: Vec<u8> = rgba.chunks_exact(4).map(|p| p[0]).collect();
    let image = image::GrayImage::from_raw(width, height, grey).expect("one byte per pixel");
    image.save(path).map_err(|e| DumpError::file(path, e))
}
