//! Head, neck, shoulders and arms: what tells a body's upper end from its lower one.
//!
//! Frame, mm: x to the body's left, y to its back, z to its head. Sizes of an adult of 175 cm (ANSUR II, Gordon et
//! al. 2014, men, rounded): 41 cm from acromion to acromion, head 15 cm wide and 20 cm long, 36 cm from shoulder to
//! elbow, 48 cm from there to the fingertips.

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{Point, cone, ellipsoid, union, union_all};

/// Distance to head, neck, shoulders and arms of a body whose shoulder joints are at the level `shoulder`.
pub fn figure(p: &Point, shoulder: f32) -> Tree {
    let q = &p.from(Vec3::new(0.0, 0.0, shoulder));
    union(bust(q), arm(q, 1.0).min(arm(q, -1.0)), 30.0)
}

fn bust(q: &Point) -> Tree {
    let at = Vec3::new;
    let shoulders = cone(q, at(-150.0, 18.0, 0.0), 48.0, at(150.0, 18.0, 0.0), 48.0);
    let neck = cone(q, at(0.0, 20.0, 0.0), 62.0, at(0.0, 4.0, 165.0), 56.0);
    union(union(shoulders, neck, 60.0), head(q), 20.0)
}

/// The head looks to the front, along -y: nose, chin and ears say so.
fn head(q: &Point) -> Tree {
    let at = Vec3::new;
    let skull = ellipsoid(&q.from(at(0.0, 2.0, 250.0)), at(76.0, 98.0, 84.0));
    let jaw = cone(q, at(0.0, -38.0, 190.0), 50.0, at(0.0, -62.0, 162.0), 26.0);
    let nose = cone(q, at(0.0, -92.0, 232.0), 7.0, at(0.0, -110.0, 206.0), 12.0);
    let ear = |side: f32| ellipsoid(&q.from(at(80.0 * side, 10.0, 226.0)), at(9.0, 18.0, 30.0));
    let face = union(union(skull, jaw, 30.0), nose, 10.0);
    union(face, ear(1.0).min(ear(-1.0)), 6.0)
}

/// An arm a hand's breadth off the trunk, so that the probe reaches the flank.
fn arm(q: &Point, side: f32) -> Tree {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x * side, y, z);
    let (joint, elbow) = (at(180.0, 18.0, -8.0), at(295.0, 34.0, -345.0));
    let (wrist, tip) = (at(340.0, 10.0, -600.0), at(352.0, 4.0, -800.0));
    let upper = cone(q, joint, 52.0, elbow, 40.0);
    let lower = cone(q, elbow, 40.0, wrist, 28.0);
    let hand = cone(q, wrist, 26.0, tip, 20.0);
    union_all(vec![upper, lower, hand], 14.0)
}

/// The tissue of what has no layers, for a scene file.
pub const TISSUE: &str = r#"# Head, arms and hips: one tissue instead of layers, which the 3D view shows as skin.
[tissues.body_skin]
based_on = "muscle"
source = "chosen by this project, no source found"

"#;
