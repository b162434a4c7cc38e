//! Data exchanged by window and simulation for the 3D view.

use glam::DAffine3;

use super::model::Camera;
use crate::gpu::Image;
use crate::probe::Probe;
use crate::sim::view3d::CameraView;

/// The wanted view of the anatomy.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// The simulation's part of it.
    pub sight: CameraView,
    /// The camera from which it was made.
    pub camera: Camera,
}

/// A finished picture of the anatomy.
#[derive(Clone)]
pub struct Pictured {
    /// The picture; nobody writes it while there are clones.
    pub image: Image,
    /// The view that it shows.
    pub look: Look,
    /// The probe in it.
    pub probe: Probe,
    /// World from probe.
    pub pose: DAffine3,
    /// Time on the device, ms; 0 where that has no clock.
    pub ms: f64,
}
