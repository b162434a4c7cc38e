//! The windows onto the heart: where the probe is held on the torso, and what it looks at.
//!
//! Views and places after the guideline of the American Society of Echocardiography (Mitchell et al., J Am Soc
//! Echocardiogr 2019;32:1-64): parasternal in the third or fourth space at the left edge of the sternum, apical at the
//! fifth, subcostal below the xiphoid. The images have their usual sides.

use glam::Vec3;

use crate::chest::{self, Placement};
use crate::field::{Field, Point};
use crate::output;
use crate::pose::Pose;

/// A window: name of the view, place in front of the skin in the body's frame, point of the heart's frame that the
/// probe looks at, and direction of the heart's frame towards the image's right side.
type Window = (&'static str, Vec3, Vec3, Vec3);

const WINDOWS: [Window; 4] = [
    (
        // Apex on the left, aorta and left atrium on the right.
        "parasternal long axis",
        Vec3::new(34.0, -220.0, 42.0),
        Vec3::new(-3.0, -6.0, 98.0),
        Vec3::Z,
    ),
    (
        // Right ventricle on the left, papillary muscles in the left one.
        "parasternal short axis",
        Vec3::new(34.0, -220.0, 42.0),
        Vec3::new(0.0, 0.0, 74.0),
        Vec3::X,
    ),
    (
        // Anterior wall on the right.
        "apical two-chamber",
        Vec3::ZERO,
        Vec3::new(1.0, 2.0, 128.0),
        Vec3::new(0.0, -1.0, 0.0),
    ),
    (
        // From below the ribs, above the liver: right atrium and ventricle in front, apex on the right.
        "subcostal four-chamber",
        Vec3::new(-8.0, -220.0, -52.0),
        Vec3::new(-20.0, 4.0, 92.0),
        Vec3::new(0.0, 0.0, -1.0),
    ),
];

/// Depth to which the probe is pressed in, mm.
const PRESS: f32 = 2.5;

/// The `[[pose]]` entries, in the heart's frame.
pub fn entries(placement: &Placement) -> String {
    let skin = Field::new(&chest::skin(&Point::world()));
    let mut out = String::from(HELD);
    for window in WINDOWS {
        out += &format!("[[pose]]\nname = \"{}\"\n", window.0);
        out += &output::pose_lines(&pose(&skin, placement, window), "");
        out += "\n";
    }
    out
}

/// The poses from the apex: the scene's own and the start of its tasks.
const HELD: &str = r#"[[pose]]
name = "apical four-chamber"
position = [3, 0, 0]
direction = [-0.16, 0, 0.987]
lateral = [0.987, 0, 0.16]

[[pose]]
name = "beside the apex"
position = [-8, 6, 0]
direction = [-0.1, 0.15, 0.98]
lateral = [0.78, 0.62, 0]

"#;

/// The probe where the straight line from in front of the skin meets it, turned to the point that it looks at.
fn pose(skin: &Field, placement: &Placement, (title, from, target, right): Window) -> Pose {
    let into = Vec3::Y;
    let face = match from == Vec3::ZERO {
        true => placement.face,
        false => first(skin, from, into) + into * PRESS,
    };
    let position = placement.point(face);
    let direction = (target - position).normalize();
    let lateral = (right - direction * right.dot(direction)).normalize();
    Pose { title, position, direction, lateral }
}

/// The first point inside on the ray from `from` along the unit vector `into`, to a tenth of a millimetre.
fn first(skin: &Field, from: Vec3, into: Vec3) -> Vec3 {
    let points: Vec<Vec3> = (0..3000).map(|i| from + into * (0.1 * i as f32)).collect();
    let values = skin.values(&points);
    let at = values.iter().position(|v| *v < 0.0).expect("a window lies in front of the body");
    points[at]
}
