//! The probe on the skin, for Python.

use glam::{DAffine3, DVec3};
use insonify::sim::contact::{Coupling, Hand, SkinContact, Spot};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::state::State;

/// Contact of the face at `pose` with the skin as it is now; none of a scene that asks for none.
pub fn contact(state: &mut State, pose: &DAffine3) -> Option<SkinContact> {
    let State { scene, skins, .. } = state;
    Coupling::at(scene, pose, skins).map(|coupling| coupling.touch)
}

/// The pose on the skin that `pose` is slid to by `by` mm, lateral and elevation, pressed in by `press` mm; `upright`:
/// along the skin's normal.
///
/// # Errors
/// A scene without skin, and none at that place.
pub fn held(
    state: &mut State,
    pose: &DAffine3,
    by: [f64; 2],
    press: f64,
    upright: bool,
) -> PyResult<DAffine3> {
    let State { scene, skins, .. } = state;
    if scene.contact.is_none() {
        return Err(PyValueError::new_err(
            "the scene has no skin: name its meshes, as contact={\"mesh\": [\"skin\"]}",
        ));
    }
    let skin = skins.of(scene);
    let hand = Hand::new(&skin, &scene.probe);
    let along = pose.transform_vector3(DVec3::new(by[0], by[1], 0.0));
    let slid = hand.slid_by(pose, along, press);
    let (slid, spot) = slid.ok_or_else(|| {
        let at = pose.translation;
        PyValueError::new_err(format!("no skin before the probe at {at}: turn it towards the body"))
    })?;
    if !upright {
        return Ok(slid);
    }
    let leant = Spot { point: spot.point, normal: -slid.transform_vector3(DVec3::Z) };
    Ok(hand.slid(&slid, &leant, &spot, press))
}
