//! Acoustic contact between the transducer's face and the skin: sound does not cross air.
//!
//! Each of a number of points of the face is coupled where it is pressed into the skin, or where the gap
//! to it along the beam is no wider than the gel fills. Water and tissue against air have a reflection
//! coefficient of -0.999, so that nothing is heard from the rest. A line is made by an aperture of many
//! elements: the echo that it hears has the share of those that send and are coupled, times the share of
//! those that receive from its depth and are, in amplitude.

mod hand;
mod skin;

use glam::DAffine3;

use crate::scene::Scene;
pub use hand::{Body, Hand, PRESS, Spot};
pub use skin::{Skin, Skins};

/// Message for the user where no part of the face is coupled.
pub const UNTOUCHED: &str = "no part of the probe's face touches the skin: images are black";
/// Remedy for that.
pub const REACH_SKIN: &str = "move the probe to the skin (probe.pose), allow for more gel (contact.gel), or leave [contact] out";

/// Points of the face in a row, at least; a whole number of them belongs to each scanline.
const LEAST_COLUMNS: u32 = 128;
/// Rows of points along the elements' height.
const ROWS: u32 = 7;

/// The contact of a probe with the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinContact {
    /// Share of the face that is coupled, 0 to 1.
    pub share: f64,
    /// Indentation: the distance by which the face is pushed in beyond the undeformed skin, mm. The mean over
    /// the face, where parts that are not pushed in count as 0.
    pub depth: f64,
}

/// The coupled share of each element. The face has as many elements as scanlines, side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The face as a whole.
    pub touch: SkinContact,
    /// Share of each element that is coupled, from the first scanline's on.
    pub elements: Vec<f64>,
}

impl Coupling {
    /// The contact of the scene's probe where it is; none where the scene asks for no contact.
    pub fn of(scene: &Scene, skins: &mut Skins) -> Option<Self> {
        Self::at(scene, &scene.world_from_probe, skins)
    }

    /// The contact that the scene's probe would have at another place.
    pub fn at(scene: &Scene, place: &DAffine3, skins: &mut Skins) -> Option<Self> {
        let contact = scene.contact.as_ref()?;
        let skin = skins.of(scene);
        let probe = &scene.probe;
        let per_element = LEAST_COLUMNS.div_ceil(probe.scanlines.max(1));
        let columns = probe.scanlines * per_element;
        let (mut coupled, mut depth) = (vec![0u32; probe.scanlines as usize], 0.0);
        for column in 0..columns {
            for row in 0..ROWS {
                let share = |i: u32, count: u32| (f64::from(i) + 0.5) / f64::from(count) - 0.5;
                let (point, normal) = probe.face(share(column, columns), share(row, ROWS));
                let (point, normal) =
                    (place.transform_point3(point), place.transform_vector3(normal));
                let gap = skin.gap(point, normal);
                if gap.is_some_and(|gap| gap <= contact.gel) {
                    coupled[(column / per_element) as usize] += 1;
                }
                depth += gap.map_or(0.0, |gap| (-gap).max(0.0));
            }
        }
        let points = f64::from((per_element * ROWS).max(1));
        let elements: Vec<f64> = coupled.iter().map(|&n| f64::from(n) / points).collect();
        let count = elements.len().max(1) as f64;
        Some(Self {
            touch: SkinContact {
                share: elements.iter().sum::<f64>() / count,
                depth: depth / (count * points),
            },
            elements,
        })
    }
}

/// The table that `beam` reads. For each of the scene's L scanlines the coupled share of its transmit
/// aperture, then L + 1 sums: the number of elements before the i-th that are not coupled. Without
/// `coupling` every element is coupled.
pub fn table(scene: &Scene, coupling: Option<&Coupling>) -> Vec<f32> {
    let lines = scene.probe.scanlines as usize;
    let mut out = vec![1.0; lines];
    let mut air = vec![0.0; lines + 1];
    if let Some(coupling) = coupling {
        for (i, element) in coupling.elements.iter().enumerate() {
            air[i + 1] = air[i] + (1.0 - element);
        }
        let reach = reach(scene, scene.probe.transmit_aperture());
        for (l, share) in out.iter_mut().enumerate() {
            *share = coupled(&air, middle(scene, l), reach) as f32;
        }
    }
    out.extend(air.iter().map(|&a| a as f32));
    out
}

/// Half an aperture of `width` mm, in elements; at least half an element.
pub(super) fn reach(scene: &Scene, width: f64) -> f64 {
    let pitch = scene.probe.face_width() / f64::from(scene.probe.scanlines.max(1));
    // An aperture wider than the face is the whole face.
    let widest = f64::from(scene.probe.scanlines);
    (0.5 * width / pitch).min(widest).max(0.5)
}

/// The centre of a scanline's aperture, in elements from the edge of the face. All lines of a phased array
/// have the same centre.
fn middle(scene: &Scene, line: usize) -> f64 {
    match scene.probe.kind {
        crate::probe::ProbeKind::Phased { .. } => 0.5 * f64::from(scene.probe.scanlines),
        _ => line as f64 + 0.5,
    }
}

/// Share of the elements within `reach` of `middle` that are coupled; elements beyond the edge of the face
/// do not count. `air[i]` is the number of elements before the i-th that are not coupled.
fn coupled(air: &[f64], middle: f64, reach: f64) -> f64 {
    let count = (air.len() - 1) as f64;
    let (left, right) = ((middle - reach).max(0.0), (middle + reach).min(count));
    let before = |at: f64| {
        let i = (at as usize).min(air.len() - 2);
        air[i] + (at - i as f64) * (air[i + 1] - air[i])
    };
    1.0 - (before(right) - before(left)) / (right - left)
}
