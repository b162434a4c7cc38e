//! Surroundings of the uterus in a coronal scan through the vagina: vaginal wall, pelvic side walls
//! with iliac vessels, broad ligaments with veins, ovaries, bowel. Sizes and places were chosen by
//! this project, no source found.
//!
//! Frame, mm: that of the probe, x to the mother's left, y to her back, z into the pelvis, to her head.

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{Point, cone, ellipsoid, intersection, undulation, union_all};
use crate::model::Extent;
use crate::part::{Part, part};
use crate::pelvis::{self, BOWEL, Bowel, tubes};

/// The block that is modelled.
pub const EXTENT: Extent =
    Extent { low: Vec3::new(-90.0, -38.0, -14.0), high: Vec3::new(90.0, 38.0, 100.0), step: 2.0 };

/// Radius of the probe's face, whose middle is the origin, mm.
const FACE: f32 = 11.0;

/// The part of a field that lies in the block, clear of its faces.
pub fn within(p: &Point, field: Tree) -> Tree {
    let flat = intersection(p.0.clone().abs() - 86.0, p.1.clone().abs() - 34.0, 4.0);
    let block = intersection(flat, (p.2.clone() - 43.0).abs() - 53.0, 4.0);
    intersection(field, block, 3.0)
}

/// The block within `depth` mm of the face.
fn near(p: &Point, depth: f32) -> Tree {
    let q = p.from(Vec3::new(0.0, 0.0, -FACE));
    let radius = (q.0.square() + q.2.square()).sqrt();
    within(p, radius - (FACE + depth) + undulation(p, 0.3, 23.0, 0.9))
}

/// The block beyond the pelvic side walls, `inset` mm deeper.
fn side(p: &Point, inset: f32) -> Tree {
    let bulge = (p.2.clone() - 52.0).square() * 0.004;
    let wall = (bulge + 64.0 + inset) - p.0.clone().abs();
    within(p, wall + undulation(p, 1.2, 37.0, 0.3))
}

/// External iliac artery (true) or vein of both sides, less `wall`.
fn iliac(p: &Point, artery: bool, wall: f32) -> Tree {
    let (out, deep, radius) = if artery { (57.5, 40.5, 3.8) } else { (58.5, 51.0, 5.2) };
    let one = |side: f32| {
        cone(
            p,
            Vec3::new(side * (out + 3.0), -40.0, deep - 15.0),
            radius - wall,
            Vec3::new(side * (out - 3.0), 40.0, deep + 15.0),
            radius - wall,
        )
    };
    within(p, one(1.0).min(one(-1.0)))
}

/// The broad ligaments: flat, from the uterus to the side walls.
fn ligaments(p: &Point) -> Tree {
    let one = |side: f32| {
        let axes = [Vec3::new(0.97, 0.0, side * 0.24), Vec3::Y, Vec3::new(side * -0.24, 0.0, 0.97)];
        let q = p.from(Vec3::new(side * 44.0, 0.0, 36.0)).along(axes);
        ellipsoid(&q, Vec3::new(31.0, 31.0, 6.0))
    };
    within(p, one(1.0).min(one(-1.0)) + undulation(p, 0.9, 21.0, 1.7))
}

/// Veins of the parametrium, beside the uterus whose edges are at `edges`.
fn veins(p: &Point, edges: [f32; 2]) -> Tree {
    let run = |edge: f32, side: f32, out: f32, z: f32, r: f32, slant: f32| {
        let ys = [-30.0f32, -15.0, 0.0, 15.0, 30.0];
        let point = |(i, y): (usize, &f32)| {
            let way = if i % 2 == 0 { 1.0 } else { -1.0 };
            Vec3::new(edge + side * (out + 1.2 * way), *y, z + slant * y / 15.0)
        };
        let points: Vec<Vec3> = ys.iter().enumerate().map(point).collect();
        let pieces = points.windows(2).map(|w| cone(p, w[0], r, w[1], r));
        union_all(pieces.collect(), 1.0)
    };
    let both = [(edges[0], -1.0f32), (edges[1], 1.0)];
    let all = both.into_iter().flat_map(|(edge, side)| {
        [
            run(edge, side, 3.2, 31.0, 1.5, 2.0),
            run(edge, side, 5.5, 35.5, 1.9, -3.0),
            run(edge, side, 9.5, 32.0, 1.3, 3.0),
        ]
    });
    within(p, union_all(all.collect(), 0.6))
}

/// Bowel behind the uterus; the right one holds gas.
const LOOPS: [Bowel; 3] = [
    Bowel(&[[-70.0, -24.0, 70.0], [-44.0, 0.0, 74.0], [-16.0, 6.0, 80.0], [2.0, 26.0, 84.0]], 8.5),
    Bowel(&[[20.0, -26.0, 82.0], [29.0, 0.0, 76.0], [52.0, 8.0, 71.0], [72.0, 24.0, 70.0]], 8.0),
    Bowel(&[[-6.0, -30.0, 84.0], [4.0, 0.0, 87.0], [14.0, 30.0, 86.0]], 9.0),
];

fn bowel(p: &Point, wall: f32) -> Tree {
    within(p, tubes(p, &LOOPS, wall))
}

/// Gas in the upper part of the loops.
fn gas(p: &Point) -> Tree {
    let level = p.2.clone() + p.0.clone() * 0.1 - 74.0 + undulation(p, 0.7, 13.0, 2.4);
    let beside = Tree::from(33.0) - p.0.clone();
    let inside = intersection(bowel(p, BOWEL.0 + 0.5), level, 2.0);
    intersection(inside, beside, 2.0)
}

/// An ovary with its follicles; sizes chosen by this project, no source found.
pub struct Ovary {
    /// Its middle, mm.
    pub middle: Vec3,
    /// Its half-axes, mm.
    pub radii: Vec3,
    /// Follicles: place from the ovary's middle, and radius, mm.
    pub follicles: &'static [([f32; 3], f32)],
}

impl Ovary {
    /// The whole ovary.
    fn field(&self, p: &Point) -> Tree {
        ellipsoid(&p.from(self.middle), self.radii) + undulation(p, 0.5, 12.0, 1.1)
    }

    /// Its follicles.
    fn follicles(&self, p: &Point) -> Tree {
        let one = |(at, r): &([f32; 3], f32)| {
            let uneven = Vec3::new(1.08, 1.0, 0.92) * *r;
            ellipsoid(&p.from(self.middle + Vec3::from(*at)), uneven)
        };
        let all = self.follicles.iter().map(one);
        all.reduce(|a, b| a.min(b)).expect("follicles") + undulation(p, 0.15, 6.0, 0.2)
    }
}

/// A corpus luteum: middle, radius, and thickness of its wall around the fluid, mm.
pub struct Luteum {
    pub middle: Vec3,
    pub radius: f32,
    pub wall: f32,
}

impl Luteum {
    /// The part that is more than `inset` mm within its surface.
    fn field(&self, p: &Point, inset: f32) -> Tree {
        let radii = Vec3::new(1.05, 1.0, 0.95) * self.radius - inset;
        ellipsoid(&p.from(self.middle), radii) + undulation(p, 0.35, 7.0, 0.8 + inset)
    }
}

/// A uterus, from its middle and half-axes, mm.
pub fn uterus(p: &Point, (middle, radii): (Vec3, Vec3)) -> Tree {
    ellipsoid(&p.from(middle), radii) + undulation(p, 1.0, 39.0, 2.2)
}

/// Ovaries with their follicles and the corpus luteum, and the uterus with its vessels, in rising priority.
pub fn organs(
    p: &Point,
    [one, other]: [&Ovary; 2],
    luteum: &Luteum,
    womb: (Vec3, Vec3),
) -> [Part; 6] {
    let follicles = one.follicles(p).min(other.follicles(p));
    let fluid = luteum.field(p, luteum.wall);
    [
        part("ovaries", "ovary", ORGAN, one.field(p).min(other.field(p))),
        part("corpus-luteum", "luteum", FINE, luteum.field(p, 0.0)),
        part("luteal-fluid", "luteal_fluid", FINE, fluid),
        part("follicles", "cyst_fluid", FINE, follicles),
        part("uterus", "myometrium", ORGAN, uterus(p, womb)),
        part("arcuate", "arcuate", FINE, arcuate(p, womb)),
    ]
}

/// Arcuate vessels of a uterus.
fn arcuate(p: &Point, (middle, radii): (Vec3, Vec3)) -> Tree {
    let arcs = [
        (-143.0, 1.2, 13.0),
        (-104.0, 0.9, -16.0),
        (-58.0, 1.1, 12.0),
        (-21.0, 0.9, -9.0),
        (38.0, 1.2, 14.0),
        (71.0, 0.9, -12.0),
        (123.0, 1.1, 15.0),
        (161.0, 0.9, -10.0),
    ];
    pelvis::arcuate(p, middle, radii * Vec3::new(0.86, 1.0, 0.84), &arcs)
}

/// Returns by how many dB the surfaces of a part are fainter than flat mirrors.
pub fn faint(name: &str) -> i32 {
    match name {
        "decidua" | "ring" | "filling" | "junction" | "endometrium" => -18,
        "ligaments" | "corpus-luteum" | "tube" => -9,
        "ovaries" | "vaginal-wall" => -6,
        _ => 0,
    }
}

/// Cell size, mm, and weight of large parts; below, of medium and of fine ones.
pub const LARGE: (f32, f64) = (3.5, 0.5);
/// See [`LARGE`].
pub const ORGAN: (f32, f64) = (2.2, 1.0);
/// See [`LARGE`].
pub const FINE: (f32, f64) = (1.0, 1.5);

/// The surroundings of a uterus whose left and right edges in the image are at `edges`, in rising
/// priority.
pub fn around(p: &Point, edges: [f32; 2]) -> Vec<Part> {
    vec![
        part("side-fascia", "fascia", LARGE, side(p, 0.0)),
        part("side-muscle", "muscle", LARGE, side(p, 1.0) + 0.4),
        part("bowel-wall", "bowel", ORGAN, bowel(p, 0.0)),
        part("chyme", "chyme", ORGAN, bowel(p, BOWEL.0)),
        part("bowel-gas", "air", ORGAN, gas(p)),
        part("ligaments", "ligament", ORGAN, ligaments(p)),
        part("veins", "vein", FINE, veins(p, edges)),
        part("artery-wall", "vessel_wall", ORGAN, iliac(p, true, 0.0)),
        part("artery", "blood", ORGAN, iliac(p, true, 0.8)),
        part("vein-wall", "vessel_wall", ORGAN, iliac(p, false, 0.0)),
        part("vein", "blood", ORGAN, iliac(p, false, 0.5)),
        part("vaginal-wall", "vagina", LARGE, near(p, 4.6)),
        part("mucosa", "fascia", LARGE, near(p, 0.9)),
    ]
}
