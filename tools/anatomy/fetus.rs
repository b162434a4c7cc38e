//! A fetus of eleven weeks.
//!
//! Frame, mm: x to the crown, y to the left, z to the back; the crown lies at x = 21.5 and the rump
//! at x = -21.5. A crown-rump length of 43 mm is 11 weeks (Robinson and Fleming, Br J Obstet
//! Gynaecol 1975;82:702-710: days = 8.052 sqrt(1.037 length) + 23.73). Head and trunk follow growth
//! tables for 11 weeks (biparietal diameter 16 +- 2, occipitofrontal 21 +- 2, head circumference
//! 59 +- 15, abdominal circumference 52 +- 10, femur and humerus 8 +- 2 mm; whose measurements these
//! are was not traced).

use std::f32::consts::PI;

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{
    Point, cone, difference, ellipsoid, intersection, undulation, union, union_all,
};
use crate::model::Extent;
use crate::part::{Part, part};

/// The box that holds the fetus with its cord.
pub const EXTENT: Extent =
    Extent { low: Vec3::new(-34.0, -16.0, -23.0), high: Vec3::new(25.0, 16.0, 24.0), step: 0.7 };

/// Crown to rump.
const CROWN_RUMP: f32 = 43.0;
/// Outer half-axes of the skull: height, biparietal, occipitofrontal.
const SKULL: Vec3 = Vec3::new(9.4, 8.5, 10.75);
/// Thickness of the skull, and of the skin over it.
const VAULT: f32 = 0.7;
/// See [`VAULT`].
const SCALP: f32 = 1.1;
/// Radius of the trunk's cones at the navel, where two of them meet.
const BELLY: f32 = 7.9;
/// Width of the fillets of the trunk. Where two cones meet it adds a quarter of itself to the radius.
const FILLET: f32 = 1.5;

/// Returns the sizes of the fetus as text, for the scene file.
pub fn biometry() -> String {
    let days = 8.052 * (1.037 * CROWN_RUMP).sqrt() + 23.73;
    let (bpd, ofd) = (2.0 * SKULL.y, 2.0 * SKULL.z);
    format!(
        "crown-rump length {CROWN_RUMP:.0} mm ({:.0} weeks {:.0} days), biparietal diameter {bpd:.1} mm, \
         occipitofrontal {ofd:.1} mm, head circumference {:.0} mm, abdominal circumference {:.0} mm, \
         femur {:.1} mm, humerus {:.1} mm",
        (days / 7.0).floor(),
        days % 7.0,
        PI * (bpd + ofd) / 2.0,
        2.0 * PI * (BELLY + FILLET / 4.0),
        LEG.upper.distance(Vec3::ZERO) - BONE_GAP,
        ARM.upper.distance(Vec3::ZERO) - BONE_GAP,
    )
}

fn point(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Middle of the skull.
const HEAD: Vec3 = Vec3::new(10.95, 0.0, -1.5);

/// The joint about which the head nods.
pub const NECK: Vec3 = Vec3::new(3.0, 0.0, 2.4);

/// The skull's outer surface less `inset`; the forehead is bent forwards by 14 degrees.
fn vault(p: &Point, inset: f32) -> Tree {
    let (sin, cos) = 0.24f32.sin_cos();
    let axes = [point(cos, 0.0, -sin), Vec3::Y, point(sin, 0.0, cos)];
    let q = p.from(HEAD).along(axes);
    ellipsoid(&q, SKULL - inset)
}

/// Head with face, without the neck.
fn head(p: &Point) -> Tree {
    let blob = |at: Vec3, r: Vec3| ellipsoid(&p.from(at), r);
    let cranium = vault(p, -SCALP);
    let face = blob(point(4.6, 0.0, -6.6), point(4.6, 4.9, 4.9));
    let nose = cone(p, point(7.0, 0.0, -11.2), 1.0, point(6.0, 0.0, -12.4), 0.9);
    let lips = blob(point(3.7, 0.0, -10.9), point(1.0, 1.8, 1.0));
    let chin = blob(point(1.7, 0.0, -9.6), point(1.5, 1.9, 1.6));
    let nape = cone(p, point(5.0, 0.0, 2.2), 4.4, NECK, 4.2);
    let features = union_all(vec![nose, lips, chin], 0.9);
    union(union(cranium, face, 2.6), union(features, nape, 1.0), 1.2)
}

/// The facial bones: nasal bone, upper and lower jaw.
fn face_bones(p: &Point) -> Tree {
    let nasal = cone(p, point(8.3, 0.0, -10.6), 0.45, point(6.7, 0.0, -11.9), 0.4);
    let jaw = |x: f32, z: f32| {
        let half = |y: f32| cone(p, point(x, 0.0, z), 0.45, point(x + 0.8, y, z + 2.6), 0.4);
        half(2.2).min(half(-2.2))
    };
    nasal.min(jaw(4.5, -10.0)).min(jaw(2.2, -9.6))
}

/// Choroid plexuses, which fill the lateral ventricles at this age.
fn choroid(p: &Point) -> Tree {
    let one = |y: f32| ellipsoid(&p.from(HEAD + point(1.2, y, 1.0)), point(2.6, 2.0, 4.6));
    one(3.4).min(one(-3.4)) + undulation(p, 0.15, 4.0, 0.4)
}

/// Trunk from the neck to the rump.
fn trunk(p: &Point) -> Tree {
    union_all(
        vec![
            cone(p, NECK, 4.1, point(-1.5, 0.0, 0.8), 7.0),
            cone(p, point(-1.5, 0.0, 0.8), 7.0, point(-8.0, 0.0, -0.6), BELLY),
            cone(p, point(-8.0, 0.0, -0.6), BELLY, point(-14.5, 0.0, -0.9), 6.4),
            cone(p, point(-14.5, 0.0, -0.9), 6.4, point(-16.0, 0.0, 0.0), 5.5),
        ],
        FILLET,
    ) + undulation(p, 0.15, 9.0, 1.0)
}

/// The line of the vertebral bodies.
const SPINE: [Vec3; 6] = [
    Vec3::new(5.4, 0.0, 2.6),
    Vec3::new(1.5, 0.0, 4.0),
    Vec3::new(-4.5, 0.0, 5.0),
    Vec3::new(-10.0, 0.0, 4.7),
    Vec3::new(-15.0, 0.0, 2.7),
    Vec3::new(-18.6, 0.0, -0.2),
];

/// Spacing of the vertebrae, mm.
const VERTEBRA: f32 = 1.25;

/// Ossification centres of the vertebrae: one in each body and two in the arch behind it.
fn spine(p: &Point) -> Tree {
    let mut centres = Vec::new();
    let mut ahead = 0.0;
    for ends in SPINE.windows(2) {
        let (a, b) = (ends[0], ends[1]);
        let length = a.distance(b);
        let along = (b - a) / length;
        let back = along.cross(Vec3::Y);
        let back = back * back.z.signum();
        while ahead < length {
            let at = a + along * ahead;
            centres.push(ellipsoid(&p.from(at), Vec3::splat(0.54)));
            for side in [-1.15, 1.15] {
                let arch = at + back * 1.1 + Vec3::Y * side;
                centres.push(ellipsoid(&p.from(arch), Vec3::splat(0.46)));
            }
            ahead += VERTEBRA;
        }
        ahead -= length;
    }
    // A sharp union: the centres do not touch.
    centres.into_iter().reduce(|a, b| a.min(b)).expect("vertebrae")
}

/// Ribs: thin bows from the spine forwards, seven on each side.
fn ribs(p: &Point) -> Tree {
    let rib = |i: i32, side: f32| {
        let x = 0.2 - 1.45 * i as f32;
        let out = 5.6 + 0.18 * i as f32;
        let path = [
            point(x, 1.3 * side, 4.3),
            point(x - 0.3, 0.72 * out * side, 3.6),
            point(x - 0.9, out * side, 0.4),
            point(x - 1.3, 0.72 * out * side, -3.6),
        ];
        let pieces = path.windows(2).map(|w| cone(p, w[0], 0.34, w[1], 0.3));
        pieces.reduce(|a, b| a.min(b)).expect("three pieces")
    };
    let both = (0..7).flat_map(|i| [rib(i, 1.0), rib(i, -1.0)]);
    both.reduce(|a, b| a.min(b)).expect("ribs")
}

/// The centre line of the umbilical cord from the navel around the legs to the placenta.
const CORD: [Vec3; 6] = [
    Vec3::new(-10.0, 0.0, -6.5),
    Vec3::new(-12.5, -3.5, -10.5),
    Vec3::new(-20.0, -8.0, -10.0),
    Vec3::new(-26.5, -6.0, -3.0),
    Vec3::new(-25.0, -1.0, 5.0),
    Vec3::new(-19.0, 1.0, 17.0),
];

/// The cord, 3.6 mm wide.
fn cord(p: &Point) -> Tree {
    let pieces = CORD.windows(2).map(|w| cone(p, w[0], 1.8, w[1], 1.8));
    union_all(pieces.collect(), 1.2)
}

/// Two arteries and a vein that wind about each other, one turn in 11 mm.
fn cord_vessels(p: &Point) -> Tree {
    let mut pieces = Vec::new();
    let mut run = 0.0;
    let at = |a: Vec3, b: Vec3, share: f32, run: f32, phase: f32| {
        let along = (b - a).normalize();
        let side = along.any_orthonormal_vector();
        let (sin, cos) = (run / 11.0 * 2.0 * PI + phase).sin_cos();
        a.lerp(b, share) + (side * cos + along.cross(side) * sin) * 0.85
    };
    for w in CORD.windows(2) {
        let length = w[0].distance(w[1]);
        let steps = (length / 1.4).ceil() as usize;
        for (phase, radius) in [(0.0, 0.62), (2.3, 0.4), (4.0, 0.4)] {
            for i in 0..steps {
                let share = |i: usize| i as f32 / steps as f32;
                let end = |i: usize| at(w[0], w[1], share(i), run + length * share(i), phase);
                pieces.push(cone(p, end(i), radius, end(i + 1), radius));
            }
        }
        run += length;
    }
    let all = union_all(pieces, 0.2);
    intersection(all, cord(p) + 0.3, 0.2)
}

/// Arm or leg of the left side: joint in the fetus' frame, ends of its segments from their joints.
pub struct Limb {
    /// Shoulder or hip.
    pub joint: Vec3,
    /// Vector from the joint to elbow or knee.
    pub upper: Vec3,
    /// Vector from there to wrist or ankle.
    pub lower: Vec3,
    /// Vector from there to the tips.
    tip: Vec3,
    /// Radii at the joint, elbow or knee, wrist or ankle, tips.
    radii: [f32; 4],
}

/// The left arm.
pub const ARM: Limb = Limb {
    joint: Vec3::new(0.2, 5.2, -0.6),
    upper: Vec3::new(-4.6, 1.2, -5.6),
    lower: Vec3::new(2.6, -3.6, -4.6),
    tip: Vec3::new(1.6, -1.0, -2.2),
    radii: [2.1, 1.7, 1.3, 1.0],
};

/// The left leg.
pub const LEG: Limb = Limb {
    joint: Vec3::new(-16.2, 3.4, -2.4),
    upper: Vec3::new(3.6, 0.4, -7.2),
    lower: Vec3::new(-5.2, -1.6, -3.6),
    tip: Vec3::new(-1.8, -0.4, -4.4),
    radii: [2.9, 2.2, 1.5, 1.1],
};

/// Length of a segment less that of its ossified shaft, mm.
const BONE_GAP: f32 = 0.9;

/// Names of a limb's meshes: upper segment, its bone, lower segment, its bone.
type LimbNames = [&'static str; 4];

impl Limb {
    /// Returns `v` on the left (1) or right (-1) side.
    pub fn mirrored(v: Vec3, side: f32) -> Vec3 {
        point(v.x, v.y * side, v.z)
    }

    fn parts(&self, p: &Point, side: f32, names: LimbNames) -> Vec<Part> {
        let m = |v| Self::mirrored(v, side);
        let joint = m(self.joint);
        let middle = joint + m(self.upper);
        let end = middle + m(self.lower);
        let tip = end + m(self.tip);
        let [r0, r1, r2, r3] = self.radii;
        let shaft = |a: Vec3, b: Vec3, r: f32| {
            let along = (b - a).normalize() * (BONE_GAP / 2.0 + r);
            let middle = (a + b) / 2.0;
            let half = |to: Vec3| cone(p, middle, 0.8 * r, to, r);
            half(a + along).min(half(b - along))
        };
        let upper = cone(p, joint, r0, middle, r1);
        let lower = union(cone(p, middle, r1, end, r2), cone(p, end, r2, tip, r3), 0.8);
        let [a, b, c, d] = names;
        let soft = (0.55, 1.0);
        let bone = (0.3, 1.0);
        vec![
            part(a, "fetal_soft_tissue", soft, upper),
            part(b, "fetal_bone", bone, shaft(joint, middle, 0.55)),
            part(c, "fetal_soft_tissue", soft, lower),
            part(d, "fetal_bone", bone, shaft(middle, end, 0.5)),
        ]
    }
}

/// Transform nodes of the scene that the meshes of [`parts`] belong to.
#[derive(Clone, Copy, PartialEq)]
pub enum Node {
    /// The whole fetus.
    Body,
    /// The head on its neck.
    Head,
    /// Upper (false) or lower (true) segment of a limb: arm (0, 1) or leg (2, 3), left before right.
    Limb(usize, bool),
}

/// Names of the limbs, with the side: 1 is left.
pub const LIMBS: [(&str, &str, f32, &Limb); 4] = [
    ("left-arm", "left-forearm", 1.0, &ARM),
    ("right-arm", "right-forearm", -1.0, &ARM),
    ("left-leg", "left-shank", 1.0, &LEG),
    ("right-leg", "right-shank", -1.0, &LEG),
];

const LIMB_MESHES: [LimbNames; 4] = [
    ["left-upper-arm", "left-humerus", "left-lower-arm", "left-radius"],
    ["right-upper-arm", "right-humerus", "right-lower-arm", "right-radius"],
    ["left-thigh", "left-femur", "left-calf", "left-tibia"],
    ["right-thigh", "right-femur", "right-calf", "right-tibia"],
];

/// All parts with their nodes, in rising priority.
pub fn parts() -> Vec<(Node, Part)> {
    let p = &Point::world();
    let soft = "fetal_soft_tissue";
    let organ = (0.5, 0.8);
    let blob = |at: Vec3, r: Vec3| ellipsoid(&p.from(at), r);
    let mut out = Vec::new();
    let mut add = |node: Node, part: Part| out.push((node, part));
    add(Node::Body, part("cord", soft, (0.7, 0.6), cord(p)));
    add(Node::Body, part("cord-vessels", "blood", (0.3, 0.3), cord_vessels(p)));
    let mut bones = Vec::new();
    for (i, ((.., side, limb), names)) in LIMBS.into_iter().zip(LIMB_MESHES).enumerate() {
        for (j, part) in limb.parts(p, side, names).into_iter().enumerate() {
            let node = Node::Limb(i, j >= 2);
            match j % 2 {
                0 => add(node, part),
                _ => bones.push((node, part)),
            }
        }
    }
    add(Node::Body, part("trunk", soft, (0.9, 1.0), trunk(p)));
    add(Node::Head, part("head", soft, (0.8, 1.0), head(p)));
    let liver = blob(point(-6.4, -0.8, -3.2), point(2.9, 5.2, 3.4)) + undulation(p, 0.2, 5.0, 2.0);
    let lungs = |y: f32| blob(point(-0.6, y, 1.2), point(3.0, 1.9, 3.0));
    add(Node::Body, part("liver", "fetal_liver", organ, liver));
    let lungs = lungs(3.4).min(lungs(-3.4));
    add(Node::Body, part("lungs", "fetal_lung", organ, lungs));
    let heart = difference(
        blob(point(-1.2, 0.5, -3.0), point(2.3, 2.0, 2.1)),
        blob(point(-1.2, 0.5, -3.0), point(0.4, 2.5, 2.5)),
        0.3,
    );
    add(Node::Body, part("heart", "blood", (0.45, 0.8), heart));
    let stomach = blob(point(-6.4, 3.8, 0.8), point(1.4, 1.2, 1.7));
    add(Node::Body, part("stomach", "amniotic_fluid", organ, stomach));
    let bladder = blob(point(-14.8, 0.0, -4.0), point(1.5, 1.4, 1.3));
    add(Node::Body, part("bladder", "urine", organ, bladder));
    add(Node::Head, part("skull", "membranous_bone", (0.7, 1.0), vault(p, 0.0)));
    add(Node::Head, part("brain", "fetal_brain", (0.7, 1.0), vault(p, VAULT)));
    add(Node::Head, part("choroid-plexus", "choroid_plexus", organ, choroid(p)));
    add(Node::Head, part("face-bones", "membranous_bone", (0.35, 1.0), face_bones(p)));
    add(Node::Body, part("ribs", "fetal_bone", (0.25, 0.5), ribs(p)));
    add(Node::Body, part("spine", "fetal_bone", (0.22, 3.0), spine(p)));
    out.extend(bones);
    out
}
