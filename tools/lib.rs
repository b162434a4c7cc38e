//! Code for insonify's authors and its tests, beside the program: the f64 twin of every kernel of
//! the image, the harness that compares a kernel with it, and the origin of a measurement.

use std::path::Path;

pub mod harness;
pub mod provenance;
pub mod reference;

/// Returns the root of the repository, where `glsl/`, `spirv/` and `scenes/` are.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tools/ is in it")
}
