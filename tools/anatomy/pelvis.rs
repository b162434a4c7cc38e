//! The pelvis around a pregnancy of eleven weeks, for a scan in the midline from the front:
//! wall with its fasciae, bowel with and without gas, bladder, uterus with vessels, a fibroid, cervix
//! and vagina, rectum, the sacrum's promontory. In the place of the sac is lining.
//!
//! Frame as in `womb`: x towards the feet, y to the right, z to the back, mm.

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{
    Point, cone, difference, ellipsoid, intersection, undulation, union, union_all,
};
use crate::part::{Part, part};
use crate::womb::{self, DECIDUA};

/// Depth under the skin of a layer's outer face and the phase of its waves: faces of one phase keep
/// their distance. Lean adult: fat 9 mm with Scarpa's fascia in it, the rectus in its sheath 9 mm, then
/// preperitoneal fat and the peritoneum.
const LAYERS: [(&str, &str, f32, f32); 9] = [
    ("subcutaneous-fat", "fat", 2.0, 1.0),
    ("scarpa", "septum", 6.0, 4.4),
    ("deep-fat", "fat", 6.6, 4.4),
    ("sheath", "fascia", 11.0, 2.0),
    ("rectus", "muscle", 11.9, 2.0),
    ("back-sheath", "fascia", 19.3, 3.0),
    ("preperitoneal-fat", "fat", 20.0, 3.0),
    ("peritoneum", "fascia", 22.6, 5.2),
    ("pelvis", "pelvis", 23.2, 5.2),
];

/// Thickness of the wall of small bowel and of the rectum, mm (normal: under 3 mm).
pub const BOWEL: (f32, f32) = (1.8, 2.6);

/// Returns by how many dB the surfaces of a part are fainter than flat mirrors: fibres and glands that
/// grow into each other are no smooth faces.
pub fn faint(name: &str) -> i32 {
    match name {
        "decidua" | "lining" | "junction" => -18,
        "scarpa" | "deep-fat" => -9,
        _ if LAYERS.iter().any(|l| l.0 == name) => -5,
        _ => 0,
    }
}

fn layer(p: &Point, depth: f32, phase: f32) -> Tree {
    womb::skin(p) + depth + undulation(p, 0.7, 42.0, phase)
}

/// A loop of bowel: middles of its bends, and its radius.
pub struct Bowel(pub &'static [[f32; 3]], pub f32);

/// Loops of small bowel that lie on the uterus, the last one with gas.
const SMALL: [Bowel; 3] = [
    Bowel(
        &[[-31.0, -50.0, 35.0], [-34.0, -14.0, 34.0], [-31.0, 8.0, 33.5], [-38.0, 46.0, 33.0]],
        7.2,
    ),
    Bowel(
        &[[-48.0, -50.0, 42.0], [-47.0, -6.0, 44.0], [-48.0, 22.0, 42.0], [-54.0, 50.0, 42.0]],
        8.0,
    ),
    Bowel(&[[-63.0, -48.0, 52.0], [-60.0, 4.0, 54.0], [-62.0, 48.0, 52.0]], 9.5),
];

/// Rectum and sigmoid behind the uterus.
const RECTUM: [Bowel; 1] = [Bowel(
    &[
        [-34.0, -34.0, 128.0],
        [-8.0, -6.0, 125.0],
        [24.0, 4.0, 127.0],
        [62.0, 0.0, 128.0],
        [84.0, 0.0, 136.0],
    ],
    12.5,
)];

/// Loops of bowel less their `wall`, not cleared of anything.
pub fn tubes(p: &Point, bowel: &[Bowel], wall: f32) -> Tree {
    let one = |Bowel(bends, radius): &Bowel| {
        let pieces = bends.windows(2).map(|w| {
            let r = radius - wall;
            cone(p, w[0].into(), r, w[1].into(), r)
        });
        union_all(pieces.collect(), 5.0)
    };
    union_all(bowel.iter().map(one).collect(), 0.5) + undulation(p, 0.9, 19.0, 0.8)
}

fn loops(p: &Point, bowel: &[Bowel], wall: f32) -> Tree {
    let clear = womb::uterus(p) - (1.2 + wall);
    intersection(difference(tubes(p, bowel, wall), clear, 3.0), womb::skin(p) + (25.0 + wall), 4.0)
}

/// Gas at the front of the loops that hold it.
fn small_gas(p: &Point) -> Tree {
    let level = p.2.clone() - p.0.clone() * 0.9 - 106.0 + undulation(p, 0.6, 13.0, 2.4);
    let beside = p.0.clone() + 54.5;
    intersection(intersection(loops(p, &SMALL, BOWEL.0 + 0.5), level, 2.0), beside, 2.0)
}

fn rectal_gas(p: &Point) -> Tree {
    let level = p.2.clone() - 118.5 + undulation(p, 0.7, 15.0, 1.3);
    intersection(loops(p, &RECTUM, BOWEL.1 + 0.6), level, 2.0)
}

/// The promontory and the upper sacrum.
fn sacrum(p: &Point) -> Tree {
    let bone = union(
        ellipsoid(&p.from(Vec3::new(-70.0, 0.0, 130.0)), Vec3::new(17.0, 27.0, 19.0)),
        cone(p, Vec3::new(-62.0, 0.0, 138.0), 15.0, Vec3::new(-10.0, 0.0, 172.0), 18.0),
        6.0,
    );
    within(p, bone + undulation(p, 0.8, 23.0, 0.4))
}

/// The darker inner third of the muscle around the lining.
fn junction(p: &Point) -> Tree {
    intersection(womb::sac(p, DECIDUA + 3.4), womb::uterus(p) + 9.0, 3.0)
}

/// Angles of the arcuate vessels about the y axis in degrees, with radius and slant, mm.
const ARCS: [(f32, f32, f32); 10] = [
    (-152.0, 1.5, 13.0),
    (-120.0, 1.3, -16.0),
    (-76.0, 1.4, 12.0),
    (-48.0, 1.6, -14.0),
    (-20.0, 1.4, 15.0),
    (32.0, 1.6, -13.0),
    (60.0, 1.5, 17.0),
    (88.0, 1.7, 12.0),
    (116.0, 1.5, -16.0),
    (152.0, 1.4, -12.0),
];

/// Arcuate vessels: in the outer third of the muscle, on an ellipsoid of these half-axes around
/// `middle`.
pub fn arcuate(p: &Point, middle: Vec3, radii: Vec3, arcs: &[(f32, f32, f32)]) -> Tree {
    let at = |angle: f32, y: f32| {
        let shrink = (1.0 - (y / radii.y).powi(2)).sqrt();
        let (sin, cos) = angle.to_radians().sin_cos();
        middle + Vec3::new(radii.x * shrink * cos, y, radii.z * shrink * sin)
    };
    let pieces = arcs.iter().flat_map(|&(angle, r, slant)| {
        let ys = [-26.0f32, -13.0, 0.0, 13.0, 26.0];
        let points = ys.map(|y| at(angle + slant * y / 13.0, y));
        let ends = points.windows(2).map(|w| (w[0], w[1])).collect::<Vec<_>>();
        ends.into_iter().map(move |(a, b)| cone(p, a, r, b, r))
    });
    union_all(pieces.collect(), 1.0)
}

/// An intramural fibroid of 15 mm in the back wall.
fn fibroid(p: &Point) -> Tree {
    let ball = ellipsoid(&p.from(Vec3::new(-37.0, 3.0, 94.5)), Vec3::new(8.2, 7.4, 6.4));
    ball + undulation(p, 0.4, 11.0, 0.3)
}

fn cervical(p: &Point, radius: f32) -> Tree {
    cone(p, Vec3::new(42.0, 0.0, 86.5), radius, Vec3::new(76.0, 0.0, 105.0), radius)
        + undulation(p, 0.4, 19.0, 2.0)
}

/// Vagina: flat, from the cervix down, of these half-axes: along, across, thick.
fn vagina(p: &Point, radii: Vec3) -> Tree {
    let q = p.from(Vec3::new(92.0, 0.0, 112.0)).along([
        Vec3::new(0.95, 0.0, 0.31),
        Vec3::Y,
        Vec3::new(-0.31, 0.0, 0.95),
    ]);
    within(p, ellipsoid(&q, radii))
}

/// The part of a field that lies in the modelled block, clear of its faces.
fn within(p: &Point, field: Tree) -> Tree {
    intersection(field, womb::skin(p) + 4.0, 3.0)
}

/// All parts, in rising priority.
pub fn parts() -> Vec<Part> {
    let p = &Point::world();
    let (wall, organ, fine) = ((4.0, 0.5), (2.5, 1.0), (1.3, 1.5));
    let mut out = vec![part("skin", "skin", wall, womb::skin(p))];
    for (name, tissue, depth, phase) in LAYERS {
        out.push(part(name, tissue, wall, layer(p, depth, phase)));
    }
    let lining = intersection(womb::sac(p, 0.0), womb::uterus(p) + 11.0, 3.0);
    out.extend([
        part("sacrum", "cortical_bone", organ, sacrum(p)),
        part("rectum-wall", "muscle", organ, loops(p, &RECTUM, 0.0)),
        part("stool", "stool", organ, loops(p, &RECTUM, BOWEL.1)),
        part("rectal-gas", "air", organ, rectal_gas(p)),
        part("bowel-wall", "bowel", organ, loops(p, &SMALL, 0.0)),
        part("chyme", "chyme", organ, loops(p, &SMALL, BOWEL.0)),
        part("bowel-gas", "air", organ, small_gas(p)),
        part("vagina", "muscle", organ, vagina(p, Vec3::new(26.0, 16.0, 5.5))),
        part("vaginal-line", "fascia", fine, vagina(p, Vec3::new(22.0, 12.0, 1.5))),
        part("bladder-wall", "bladder", organ, womb::bladder(p, 0.0)),
        part("bladder", "urine", organ, womb::bladder(p, 2.2)),
        part("uterus", "myometrium", organ, womb::uterus(p)),
        part(
            "vessels",
            "arcuate",
            (1.0, 1.5),
            arcuate(p, womb::SAC - Vec3::X, Vec3::new(48.5, 43.0, 34.0), &ARCS),
        ),
        part("fibroid", "fibroid", fine, fibroid(p)),
        part("cervix", "cervix", organ, cervical(p, 4.6)),
        part("canal", "canal", fine, cervical(p, 1.3)),
        part("junction", "junction", organ, junction(p)),
        part("decidua", "decidua", organ, womb::decidua(p)),
        part("lining", "lining", organ, lining),
    ]);
    out
}
