//! The choice between the two tracers, which find the surfaces along rays.

use std::fmt;
use std::sync::Arc;

use super::shaders::Library;
use crate::gpu::{AdapterKind, Device};
use crate::scene::Scene;
pub use trial::Trial;

mod trial;

/// The ways in which rays find surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tracer {
    /// The device's ray query.
    RayQuery,
    /// The compute kernel's own hierarchy.
    Bvh,
}

impl Tracer {
    /// Chooses the tracer. If `wanted` names none, it is the device's ray query if the hardware has one, else the
    /// compute tracer, which is two to three times as fast as a ray query that a driver emulates on the
    /// processor (benches/RESULTS.md). A ray query is first tried on the scene's own rays; if the device keeps
    /// results from one start to the next, only once per geometry. Returns the tracer, and a line that says why
    /// the ray query is not used where that needs saying.
    pub fn choose(
        wanted: Option<Self>,
        device: &Arc<Device>,
        library: &Library,
        scene: &Scene,
    ) -> (Self, Option<String>) {
        match wanted {
            Some(tracer) => (tracer, None),
            None if device.info().kind == AdapterKind::Cpu => (Self::Bvh, None),
            None if device.supports_ray_query() => match tried(device, library, scene) {
                Ok(()) => (Self::RayQuery, None),
                Err(why) => {
                    let name = device.name();
                    let why =
                        format!("tracing with the compute BVH: the ray query of '{name}' {why}");
                    (Self::Bvh, Some(why))
                }
            },
            None => {
                let why =
                    format!("tracing with the compute BVH: '{}' has no ray queries", device.name());
                (Self::Bvh, Some(why))
            }
        }
    }

    /// The end of the names of this tracer's kernels, as in `trace_bvh` and `trace_query`.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::RayQuery => "query",
            Self::Bvh => "bvh",
        }
    }
}

/// Checks that the device's ray query finds what it should; the error completes "the ray query ...".
fn tried(device: &Arc<Device>, library: &Library, scene: &Scene) -> Result<(), String> {
    let id = trial::id(library, scene);
    if device.remembers(id) {
        return Ok(());
    }
    match Trial::run(device, library, scene) {
        Ok(trial) if trial.passed() => {
            device.remember(id);
            Ok(())
        }
        Ok(trial) => Err(format!(
            "meets other surfaces on {} of {} rays; --tracer ray-query takes it all the same",
            trial.different, trial.rays
        )),
        Err(error) => Err(format!("cannot be tried: {error}")),
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
