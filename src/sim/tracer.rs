//! Which of the two tracers finds the surfaces.

use std::fmt;

use crate::gpu::{AdapterKind, Device};

/// How rays find surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracer {
    /// The device's ray query.
    RayQuery,
    /// The compute kernel's own hierarchy.
    Bvh,
}

impl Tracer {
    /// The wanted tracer; without a wish the device's ray query where it has one in hardware, else
    /// the compute hierarchy, which is two to three times as fast as ray queries that a driver on
    /// the processor emulates (benches/RESULTS.md); with a line that says why where there are none.
    pub fn choose(wanted: Option<Self>, device: &Device) -> (Self, Option<String>) {
        match wanted {
            Some(tracer) => (tracer, None),
            None if device.info().kind == AdapterKind::Cpu => (Self::Bvh, None),
            None if device.supports_ray_query() => (Self::RayQuery, None),
            None => {
                let why = format!(
                    "tracing with the compute BVH: '{}' has no ray queries",
                    device.name()
                );
                (Self::Bvh, Some(why))
            }
        }
    }

    /// What ends the names of this tracer's kernels, as in `trace_bvh` and `trace_query`.
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
