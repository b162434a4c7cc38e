//! The mother's side: abdominal wall, bladder, uterus with decidua, gestational sac and placenta.
//!
//! Frame, mm: that of the probe, x towards the feet, y to the right, z to the back. A sac of
//! 74 x 52 x 48 mm; the uterus of 11 weeks is 10-11 cm long (as large as a grapefruit).

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{Point, cone, difference, ellipsoid, intersection, undulation, union};
use crate::model::Extent;
use crate::part::{Part, part};

/// The modelled block.
pub const EXTENT: Extent =
    Extent { low: Vec3::new(-96.0, -60.0, -14.0), high: Vec3::new(96.0, 60.0, 190.0), step: 3.0 };

/// Middle of the sac.
pub const SAC: Vec3 = Vec3::new(0.0, 0.0, 70.0);

/// Half-axes of the sac.
const SAC_RADII: Vec3 = Vec3::new(37.0, 26.0, 24.0);

/// Thickness of the decidua around it.
pub const DECIDUA: f32 = 4.0;

/// Depth under the skin of the layers' outer faces: fat, rectus muscle, the fat in front of the
/// peritoneum, the pelvis (lean adult).
const LAYERS: [f32; 4] = [2.0, 11.0, 19.5, 22.0];

/// Depth to which the middle of the face indents the skin, and the gel left between them, mm.
const PRESS: (f32, f32) = (9.0, 1.5);

/// Distance to the skin, negative inside; the probe's curve of radius 50 mm is pressed in and fades
/// with depth.
pub fn skin(p: &Point) -> Tree {
    let gauss = |t: &Tree, sigma: f32| (t.clone() * (1.0 / sigma)).square();
    let pressed = gauss(&p.0, 23.0) + gauss(&p.1, 20.0) + gauss(&p.2, 40.0);
    let dent = (pressed * -0.5).exp() * (PRESS.0 + PRESS.1) - PRESS.0;
    let front = dent - p.2.clone() + undulation(p, 0.4, 70.0, 0.7);
    let block = intersection(p.0.clone().abs() - 90.0, p.1.clone().abs() - 54.0, 10.0);
    let block = intersection(block, p.2.clone() - 180.0, 8.0);
    intersection(front, block, 8.0)
}

/// The sac, `wider` mm larger all around.
pub fn sac(p: &Point, wider: f32) -> Tree {
    let q = p.from(SAC);
    ellipsoid(&q, SAC_RADII + wider) + undulation(p, 0.6, 31.0, 1.4)
}

/// Body and cervix; the cervix points down and back.
pub fn uterus(p: &Point) -> Tree {
    let body = ellipsoid(&p.from(SAC - Vec3::X), Vec3::new(55.0, 43.0, 40.0));
    let cervix = cone(p, Vec3::new(34.0, 0.0, 82.0), 24.0, Vec3::new(74.0, 0.0, 104.0), 15.0);
    union(body, cervix, 14.0) + undulation(p, 1.0, 43.0, 2.2)
}

/// A half-full bladder between the wall and the lower uterus, shrunk by `wall`.
pub fn bladder(p: &Point, wall: f32) -> Tree {
    let whole = ellipsoid(&p.from(Vec3::new(57.0, 0.0, 44.0)), Vec3::new(27.0, 30.0, 17.0) - wall);
    let clear = difference(whole, uterus(p) - (1.0 + wall), 5.0);
    intersection(clear, skin(p) + LAYERS[3] + 1.0 + wall, 5.0)
}

/// The lining around the sac, inside the muscle.
pub fn decidua(p: &Point) -> Tree {
    intersection(sac(p, DECIDUA), uterus(p) + 11.0, 3.0)
}

/// A disc of 15 mm on the back wall of the sac, from which it bulges inwards.
fn placenta(p: &Point) -> Tree {
    let lens = ellipsoid(&p.from(SAC + Vec3::new(-10.0, 0.0, 26.0)), Vec3::new(28.0, 24.0, 13.0));
    intersection(lens + undulation(p, 0.7, 17.0, 0.5), sac(p, DECIDUA + 2.0), 3.0)
}

/// All parts up to the fluid, in rising priority.
pub fn outer() -> Vec<Part> {
    let p = &Point::world();
    let wall = (4.0, 0.8);
    let layer = |i: usize| skin(p) + LAYERS[i] + undulation(p, 0.6, 45.0, 1.0 + i as f32);
    vec![
        part("skin", "skin", wall, skin(p)),
        part("subcutaneous-fat", "fat", wall, layer(0)),
        part("rectus", "muscle", wall, layer(1)),
        part("preperitoneal-fat", "fat", wall, layer(2)),
        part("pelvis", "pelvis", wall, layer(3)),
        part("bladder-wall", "muscle", (2.5, 0.6), bladder(p, 0.0)),
        part("mother-bladder", "urine", (2.5, 0.6), bladder(p, 2.2)),
        part("uterus", "uterus", (3.0, 0.8), uterus(p)),
        part("decidua", "decidua", (2.5, 1.0), decidua(p)),
        part("sac", "amniotic_fluid", (2.5, 1.0), sac(p, 0.0)),
    ]
}

/// The part that grows into the sac, above the cord's end in priority.
pub fn inner() -> Part {
    let p = &Point::world();
    part("placenta", "placenta", (2.5, 1.0), placenta(p))
}
