//! The tracers with which a test is run.

use insonify::gpu::Device;
use insonify::sim::Tracer;

use super::skip::{Lacking, skip};

/// Both tracers; the compute tracer alone on a device without ray queries, where the other half of the test is skipped
/// with a message.
pub fn tracers(device: &Device) -> Vec<Tracer> {
    if device.supports_ray_query() {
        return vec![Tracer::Bvh, Tracer::RayQuery];
    }
    skip(Lacking::Tool, &format!("'{}' has no ray queries", device.name()));
    vec![Tracer::Bvh]
}
