//! The mother's side: abdominal wall, bladder, uterus with decidua, gestational sac and placenta.
//!
//! Frame, mm: that of the probe, x towards the feet, y to the right, z to the back. A sac of
//! 74 x 52 x 48 mm; the uterus of 11 weeks is 10-11 cm long (as large as a grapefruit).

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{Point, cone, difference, ellipsoid, intersection, undulation, union};
use crate::figure::figure;
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

/// Depth of the dent in the skin; the probe's curve of radius 50 mm is pressed in and fades with depth.
fn dent(p: &Point) -> Tree {
    let gauss = |t: &Tree, sigma: f32| (t.clone() * (1.0 / sigma)).square();
    let pressed = gauss(&p.0, 23.0) + gauss(&p.1, 20.0) + gauss(&p.2, 40.0);
    (pressed * -0.5).exp() * (PRESS.0 + PRESS.1)
}

/// Distance to the skin of a block around the uterus, negative inside: as much as a sweep reaches.
pub fn skin(p: &Point) -> Tree {
    let front = dent(p) - PRESS.0 - p.2.clone() + undulation(p, 0.4, 70.0, 0.7);
    let block = intersection(p.0.clone().abs() - 90.0, p.1.clone().abs() - 54.0, 10.0);
    let block = intersection(block, p.2.clone() - 180.0, 8.0);
    intersection(front, block, 8.0)
}

/// Semi-axes of the mother's trunk, mm: 32 cm wide, 22 cm deep (ANSUR II, Gordon et al. 2014: women, waist).
const TRUNK: (f32, f32) = (160.0, 110.0);

/// The box that holds her, from the head to the knees.
pub const WHOLE: Extent = Extent {
    low: Vec3::new(-800.0, -390.0, -60.0),
    high: Vec3::new(420.0, 390.0, 260.0),
    step: 8.0,
};

/// Levels along x between which her wall has layers.
const LAYERED: (f32, f32) = (-170.0, 150.0);

/// Distance to the skin of her trunk between two levels; in front it is that of [`skin`].
fn trunk(p: &Point, (from, to): (f32, f32)) -> Tree {
    let (a, b) = TRUNK;
    let axis = b - PRESS.0;
    let section = Point(p.1.clone(), p.2.clone() - axis, Tree::from(0.0));
    let round = ellipsoid(&section, Vec3::new(a, b, 1.0)) + dent(p) + undulation(p, 0.4, 70.0, 0.7);
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    intersection(round, (p.0.clone() - middle).abs() - half, 30.0)
}

/// Distance to her skin with the navel, negative inside.
fn belly(p: &Point) -> Tree {
    // 15 cm above the pubic bone, which lies at 6 cm.
    let navel = ellipsoid(&p.from(Vec3::new(-95.0, 0.0, -PRESS.0)), Vec3::new(10.0, 8.0, 9.0));
    difference(trunk(p, LAYERED), navel, 6.0)
}

/// Her head, arms, upper belly and thighs: they say where up is, and have no layers.
fn body(p: &Point) -> Tree {
    let axis = TRUNK.1 - PRESS.0;
    // To her left, her back and her head.
    let own = Point(-p.1.clone(), p.2.clone() - axis, -p.0.clone());
    let above = trunk(p, (-500.0, LAYERED.0 + 20.0));
    let thigh = |side: f32| {
        let from = Vec3::new(140.0, 80.0 * side, axis);
        cone(p, from, 82.0, Vec3::new(400.0, 95.0 * side, axis), 62.0)
    };
    figure(&own, 470.0).min(above).min(thigh(1.0).min(thigh(-1.0)))
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

/// The mother's body and the layers of her wall, in rising priority.
pub fn wall() -> Vec<Part> {
    let p = &Point::world();
    let fineness = (6.0, 0.5);
    let layer = |i: usize| belly(p) + LAYERS[i] + undulation(p, 0.6, 45.0, 1.0 + i as f32);
    vec![
        part("body", "body_skin", (10.0, 0.05), body(p)),
        part("skin", "skin", fineness, belly(p)),
        part("subcutaneous-fat", "fat", fineness, layer(0)),
        part("rectus", "muscle", fineness, layer(1)),
        part("preperitoneal-fat", "fat", fineness, layer(2)),
        part("pelvis", "pelvis", fineness, layer(3)),
    ]
}

/// Bladder, uterus and all in it up to the fluid, in rising priority.
pub fn outer() -> Vec<Part> {
    let p = &Point::world();
    vec![
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
