//! From GLSL to checked SPIR-V, for authors of kernels (feature `compile`): a user's program holds
//! the compiled modules alone. This folder uses nothing outside it, so that `tests/spirv.rs` can
//! include it where the feature, and with it the compiler, is missing.

#[cfg(feature = "compile")]
pub mod compiler;
pub mod source;
pub mod stamp;
pub mod validate;

use std::path::PathBuf;

/// The errors between GLSL and usable SPIR-V; all are mistakes in a kernel's source, or files that cannot be
/// read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or folder that cannot be read or written.
    #[error("{path}: {cause}")]
    File {
        /// The file.
        path: PathBuf,
        /// The system's message.
        cause: std::io::Error,
    },
    /// A directive in a kernel that is malformed, or an include that does not exist.
    #[error("{file}:{line}: {message}")]
    Source {
        /// The GLSL file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Cause and remedy.
        message: String,
    },
    /// The compiler refused a kernel; its message names file and line.
    #[error("{stem}: {message}")]
    Compile {
        /// Kernel variant.
        stem: String,
        /// The compiler's message.
        message: String,
    },
    /// A validator refused a module.
    #[error("{stem}: refused by {validator}: {message}")]
    Invalid {
        /// Kernel variant.
        stem: String,
        /// "naga" or "spirv-val".
        validator: &'static str,
        /// The validator's message.
        message: String,
    },
}

/// Words as the bytes of a SPIR-V file.
pub fn bytes_of(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}
