//! The two tracers, which find the surfaces along rays.

use std::fmt;

/// The ways in which rays find surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracer {
    /// The device's ray query.
    RayQuery,
    /// The compute kernel's own hierarchy.
    Bvh,
}

impl Tracer {
    /// The end of the names of this tracer's kernels, as in `trace_bvh` and `trace_query`.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::RayQuery => "query",
            Self::Bvh => "bvh",
        }
    }
}

impl fmt::Display for Tracer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RayQuery => "ray-query",
            Self::Bvh => "bvh",
        })
    }
}
