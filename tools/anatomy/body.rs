//! Body wall, bones, diaphragm, lungs, the space that holds the organs.
//!
//! The wall is one distance-like field whose offsets are the layers: they nest by construction.
//! Thicknesses: skin 2 mm, subcutaneous fat 10-13 mm (lean adult), oblique muscles with their
//! fasciae 15 mm, in all 3 cm (Rankin et al., Muscle Nerve 2006: lateral wall 2-3 cm).

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{
    Point, cone, difference, ellipsoid, elliptic_cylinder, intersection, undulation, union,
    union_all,
};
use crate::figure::figure;
use crate::model::Extent;
use crate::pose;

/// Semi-axes of the torso's section, mm: 32 cm wide, 21 cm deep (NHANES, lean adult).
pub const TORSO: (f32, f32) = (160.0, 105.0);

/// The block that is modelled, mm: the right half and the midline of the upper abdomen.
pub const LOW: Vec3 = Vec3::new(-165.0, -110.0, -175.0);
/// See [`LOW`].
pub const HIGH: Vec3 = Vec3::new(80.0, 110.0, 130.0);

/// Depth under the skin of each layer's outer face, mm.
pub const FAT: f32 = 2.2;
/// External oblique.
pub const MUSCLE: f32 = 14.0;
/// Fascia between the external oblique and the intercostal layer.
pub const FASCIA: f32 = 18.3;
/// Intercostals and internal oblique.
pub const INTERCOSTAL: f32 = 19.1;
/// Fascia in front of the transversus.
pub const INNER_FASCIA: f32 = 26.3;
/// Transversus.
pub const TRANSVERSUS: f32 = 27.0;
/// Inner face of the wall, where properitoneal fat begins.
pub const CAVITY: f32 = 30.0;

/// Depth of the ribs' middle under the skin, mm.
const RIB: f32 = 22.7;

/// Coupling gel left between the face's middle and the skin, mm.
const GEL: f32 = 2.0;

/// Distance to the skin, mm, negative inside; its offsets are the layers of the wall.
pub fn wall(p: &Point) -> Tree {
    let probe = pose::default();
    let rel = p.from(probe.position);
    let gauss = |t: Tree, sigma: f32| (t * (1.0 / sigma)).square();
    // The probe's pressure: curvature PRESS / sigma2 at the middle is the face's 1 / 50 mm along
    // the array; it dies away with depth, so that the fat under the face is compressed.
    let pressed = gauss(rel.dot(probe.lateral), 22.0)
        + gauss(rel.dot(probe.direction.cross(probe.lateral)), 20.0)
        + gauss(rel.dot(probe.direction), 40.0);
    let torso = elliptic_cylinder(p, TORSO.0, TORSO.1)
        + (pressed * -0.5).exp() * (pose::PRESS + GEL)
        + undulation(p, 0.6, 90.0, 0.4);
    let (left, middle, half) = BLOCK;
    let block = intersection(p.0.clone() - left, (p.2.clone() - middle).abs() - half, 12.0);
    intersection(torso, block, 16.0)
}

/// Faces between which the block lies: to the left, and the middle and half of its height, mm.
const BLOCK: (f32, f32, f32) = (74.0, -23.0, 147.0);

/// How far the rest of the body reaches into the block, mm: to where its edges are no longer rounded.
const OVERLAP: f32 = 16.0;

/// The box that holds the whole body, mm.
pub const WHOLE: Extent = Extent {
    low: Vec3::new(-390.0, -130.0, -580.0),
    high: Vec3::new(390.0, 130.0, 640.0),
    step: 8.0,
};

/// Level of the shoulder joints, mm: 29 cm above the disc L1/L2.
const SHOULDER: f32 = 290.0;

/// The rest of the body, which has no layers: left side, head, arms and hips. It begins where the block ends, so that
/// no ray meets it that stays in the block.
pub fn rest(p: &Point) -> Tree {
    // Within the block's skin where both overlap.
    let column = elliptic_cylinder(p, TORSO.0 - 1.0, TORSO.1 - 1.0);
    let trunk = intersection(column, (p.2.clone() + 20.0).abs() - 320.0, 40.0);
    let (left, middle, half) = BLOCK;
    let across = p.0.clone() - (left - OVERLAP);
    let along = (p.2.clone() - middle).abs() - (half - OVERLAP);
    let block = intersection(across, along, 4.0);
    difference(trunk, block, 4.0).min(figure(p, SHOULDER))
}

/// The navel, at the level of the disc L3/L4: a ring of skin around a shallow pit.
pub fn navel(p: &Point) -> Tree {
    let q = p.from(Vec3::new(0.0, -TORSO.1, -66.0));
    let ring = (q.0.square() + q.2.square() + 1e-4).sqrt() - 8.0;
    (ring.square() + q.1.square() + 1e-4).sqrt() - 3.5
}

/// A layer of the wall: everything deeper than `depth` mm, wavy by `wave` mm.
pub fn layer(p: &Point, depth: f32, wave: f32, phase: f32) -> Tree {
    wall(p) + depth + undulation(p, wave, 48.0, phase)
}

/// Muscle and fascia faces share their waves in pairs, so that a fascia keeps its thickness.
pub fn fascial_layer(p: &Point, depth: f32) -> Tree {
    let phase = if depth < INNER_FASCIA { 1.7 } else { 4.2 };
    layer(p, depth, 0.7, phase)
}

/// Ribs 7 to 10: flat bands, 13 mm high and 7 mm thick (Mohr et al., J Biomech 2007), that follow
/// the wall and descend forwards. The space under the default probe is 5 cm wide: the arm is raised
/// and the breath held, and its neighbours shade no more than the sector's edges.
pub fn ribs(p: &Point) -> Tree {
    let wall = wall(p) + RIB;
    let bands = [-65.0, 2.0, 44.0, 86.0].map(|middle: f32| {
        // Height over the rib's line, as seen on the wall: z falls forwards and medially.
        let rise = p.1.clone() * RIB_RISE.1 + p.0.clone() * RIB_RISE.0;
        let bow = undulation(p, 1.5, 110.0, middle);
        let height = (p.2.clone() - rise - (middle + RIB_SHIFT) + bow) * RIB_SLANT;
        let section =
            ((wall.clone() * (1.0 / 3.6)).square() + (height * (1.0 / 6.5)).square() + 1e-4).sqrt();
        (section - 1.0) * 3.6
    });
    let [a, b, c, d] = bands;
    let all = a.min(b).min(c.min(d));
    // The bony part ends 7 cm before the midline in front, 3 cm behind.
    let front = p.0.clone() - p.1.clone() * 0.25 + 47.0;
    let side = intersection(all, front, 5.0);
    intersection(side, (p.2.clone() + 23.0).abs() - 125.0, 6.0)
}

/// Slope of the ribs' lines along x and y.
const RIB_RISE: (f32, f32) = (-0.8, 0.8);
/// Level of the line of the first rib at the origin, mm.
const RIB_SHIFT: f32 = -2.0;
/// Cosine of the slant on the lateral wall.
const RIB_SLANT: f32 = 0.72;

/// Top faces of the right and left dome, extended downwards as a shaft.
fn dome(p: &Point) -> Tree {
    let shaft = |centre: Vec3, r: Vec3| {
        let q = p.from(centre);
        ellipsoid(&Point(q.0, q.1, q.2.max(0.0)), r)
    };
    let right = shaft(Vec3::new(-64.0, 0.0, 6.0), Vec3::new(70.0, 80.0, 92.0));
    let left = shaft(Vec3::new(62.0, 0.0, 0.0), Vec3::new(70.0, 80.0, 82.0));
    // The central tendon, under the heart.
    let middle = shaft(Vec3::new(0.0, -6.0, 0.0), Vec3::new(74.0, 84.0, 70.0));
    union(union(right, left, 30.0), middle, 25.0) + undulation(p, 1.2, 70.0, 2.2)
}

/// The diaphragm with all beneath it: 2.8 mm thick (Boussuges et al., Chest 2009, at rest 2-3 mm).
pub fn diaphragm(p: &Point) -> Tree {
    intersection(dome(p), wall(p) + (TRANSVERSUS + 1.4), 3.0)
}

/// The peritoneal and retroperitoneal space, filled with fat where no organ lies.
pub fn cavity(p: &Point) -> Tree {
    let inner = layer(p, CAVITY, 0.8, 5.1);
    intersection(dome(p) + 2.8, inner, 4.0)
}

/// The lungs' bases: the space that the wall leaves free above the diaphragm.
pub fn lung(p: &Point) -> Tree {
    // 1.4 mm into the diaphragm, which has the higher priority: no two faces coincide.
    difference(layer(p, CAVITY, 0.8, 5.1), dome(p) + 1.4, 2.5)
}

/// Middle of the lumbar vertebrae in the section, mm.
const SPINE: (f32, f32) = (0.0, 50.0);

/// Levels of the vertebral bodies, mm.
const BODIES: [f32; 8] = [-162.0, -126.0, -90.0, -54.0, -18.0, 18.0, 54.0, 90.0];

/// Bodies T11 to L5: 44 x 33 x 27 mm at a pitch of 36 mm (Panjabi et al., Spine 1992), waisted.
pub fn vertebrae(p: &Point) -> Tree {
    let bodies = BODIES.map(|z: f32| {
        let q = p.from(Vec3::new(SPINE.0, SPINE.1, z));
        let waist = q.2.square() * (1.0 / 110.0);
        let round = elliptic_cylinder(&q, 20.5, 15.5) - waist.min(2.0);
        intersection(round, q.2.abs() - 13.5, 5.0)
    });
    let arch = BODIES.map(|z: f32| {
        let spinous = (Vec3::new(0.0, 76.0, z - 6.0), Vec3::new(0.0, 94.0, z - 14.0));
        let side = |s: f32| {
            let pedicle = Vec3::new(13.0 * s, 60.0, z + 4.0);
            let joint = Vec3::new(14.0 * s, 74.0, z - 2.0);
            let process = Vec3::new(36.0 * s, 68.0, z + 2.0);
            union_all(
                vec![
                    cone(p, pedicle, 5.0, joint, 5.5),
                    cone(p, joint, 5.0, spinous.0, 4.0),
                    cone(p, joint, 4.0, process, 3.0),
                ],
                3.0,
            )
        };
        let both = union(side(-1.0), side(1.0), 3.0);
        union(both, cone(p, spinous.0, 4.0, spinous.1, 3.5), 3.0)
    });
    let all: Vec<Tree> = bodies.into_iter().chain(arch).collect();
    let bones = union_all(all, 3.0) + undulation(p, 0.6, 25.0, 0.9);
    intersection(bones, wall(p) + 9.0, 4.0)
}

/// Discs and ligaments: a column inside the vertebrae's outline.
pub fn discs(p: &Point) -> Tree {
    let q = p.from(Vec3::new(SPINE.0, SPINE.1, 0.0));
    let column = elliptic_cylinder(&q, 20.0, 15.0);
    intersection(column, wall(p) + 9.0, 4.0)
}

/// Psoas, quadratus lumborum and erector spinae of the right side, and the left psoas.
pub fn back_muscles(p: &Point) -> Tree {
    let column = |x: f32, y: f32, a: f32, b: f32, lean: f32| {
        // Psoas and quadratus diverge downwards.
        let q = Point(p.0.clone() - x + p.2.clone() * lean, p.1.clone() - y, p.2.clone());
        elliptic_cylinder(&q, a, b)
    };
    let psoas = column(-36.0, 50.0, 13.0, 15.0, -0.12);
    let psoas = intersection(psoas, p.2.clone() - 35.0, 14.0);
    let left_psoas = column(36.0, 50.0, 13.0, 15.0, 0.12);
    let quadratus = column(-62.0, 76.0, 26.0, 9.0, -0.1);
    let erector = column(-36.0, 80.0, 30.0, 16.0, 0.0);
    let left_erector = column(36.0, 80.0, 30.0, 16.0, 0.0);
    let all = union_all(vec![psoas, quadratus, erector, left_psoas, left_erector], 4.0)
        + undulation(p, 1.0, 40.0, 3.1);
    intersection(all, wall(p) + MUSCLE + 1.0, 4.0)
}
