//! What the window and the simulation say to each other about the 3D view.

use glam::DAffine3;

use super::model::Camera;
use crate::gpu::Image;
use crate::probe::Probe;
use crate::sim::survey::Sight;

/// How the anatomy is to be pictured.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// What the simulation makes of it.
    pub sight: Sight,
    /// The camera that this came from.
    pub camera: Camera,
}

/// A finished picture of the anatomy.
#[derive(Clone)]
pub struct Pictured {
    /// The picture; nobody writes it while there are clones.
    pub image: Image,
    /// How it was looked at.
    pub look: Look,
    /// The probe in it.
    pub probe: Probe,
    /// World from probe.
    pub pose: DAffine3,
    /// Time on the device, ms; 0 where that has no clock.
    pub ms: f64,
}
