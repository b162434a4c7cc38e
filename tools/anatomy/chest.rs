//! The torso around the heart: wall, ribs with their cartilages, sternum, lungs, diaphragm, liver, spine.
//!
//! Frame, mm: x to the body's left, y to its back, z to its head; the origin lies midway between front and back,
//! at the level of the fifth intercostal space where the probe is held for the apical view. The heart's own
//! frame is the scene's ([`crate::heart`]); [`Placement`] says where it lies.

use fidget::context::Tree;
use glam::Vec3;

use crate::field::{
    Point, cone, difference, ellipsoid, elliptic_cylinder, half_space, intersection, undulation,
    union, union_all,
};
use crate::figure::figure;
use crate::model::Extent;
use crate::part::{Part, part};

/// The box that holds the body.
pub const EXTENT: Extent = Extent {
    low: Vec3::new(-390.0, -150.0, -690.0),
    high: Vec3::new(390.0, 150.0, 500.0),
    step: 8.0,
};

/// Semi-axes of the chest's section, mm: 33 cm wide, 25 cm deep (ANSUR II, Gordon et al. 2014: men 29 and
/// 25 cm at the bone, with muscles and fat beside it).
const TORSO: (f32, f32) = (165.0, 127.0);

/// Level of the shoulder joints: 15 cm above the fifth intercostal space.
const SHOULDER: f32 = 150.0;

/// Depth under the skin of each layer's outer face, mm: subcutaneous fat, muscle, the space inside the wall. In all
/// 2 cm: a lean adult (26 mm at both spaces used to relieve a pneumothorax, with a range that begins below 2 cm).
const FAT: f32 = 2.2;
/// See [`FAT`].
const MUSCLE: f32 = 8.6;
/// See [`FAT`].
const INSIDE: f32 = 20.0;
/// Depth of the middle of ribs and cartilages, mm.
const RIB: f32 = 14.5;

/// Depth to which the probe indents the skin at the apex, mm, where it also compresses the wall.
const PRESS: f32 = 8.0;
/// Standard deviation of the dent, mm: the probe's handle is 40 mm wide.
const PRINT: f32 = 24.0;
/// Coupling gel left between that probe's face and the skin, mm.
const GEL: f32 = 1.2;

/// Where the heart lies in the body.
///
/// Axis of the left ventricle: 38 degrees below the horizontal as seen from the front, 46 degrees to the front
/// as seen from above (Engblom et al., J Electrocardiol 2005;38: 38 +- 10 and 46 +- 7 degrees in 94 healthy
/// adults). The four-chamber plane rises to the left by 40 degrees about it: the right ventricle lies in front and
/// below.
#[derive(Clone, Copy)]
pub struct Placement {
    /// The heart's axes x, y, z in the body's frame.
    pub axes: [Vec3; 3],
    /// The apical probe's face in the body's frame, mm.
    pub face: Vec3,
}

/// The apical probe's face in the heart's frame, mm.
const FACE: Vec3 = Vec3::new(3.0, 0.0, 0.0);

impl Placement {
    /// The placement in this torso.
    pub fn new() -> Self {
        let (around, up, roll) = (44f32.to_radians(), 28f32.to_radians(), 40f32.to_radians());
        let z = Vec3::new(-up.cos() * around.sin(), up.cos() * around.cos(), up.sin());
        let level = Vec3::new(z.y, -z.x, 0.0).normalize();
        let down = z.cross(level);
        let x = level * roll.cos() - down * roll.sin();
        Self { axes: [x, z.cross(x), z], face: undented() - PRESS * outward() }
    }

    /// A direction of the body's frame in the heart's.
    pub fn direction(&self, v: Vec3) -> Vec3 {
        Vec3::from(self.axes.map(|axis| axis.dot(v)))
    }

    /// A point of the body's frame in the heart's.
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.direction(p - self.face) + FACE
    }

    /// The heart's coordinates of a point of the body's frame.
    fn heart(&self, p: &Point) -> Point {
        p.from(self.face).along(self.axes).from(-FACE)
    }
}

/// The place of the undented skin at the apical probe: on the anterior axillary line.
fn undented() -> Vec3 {
    let (a, b) = TORSO;
    let x = 100.0;
    Vec3::new(x, -b * (1.0 - (x / a).powi(2)).sqrt(), 0.0)
}

/// The undented skin's outward normal there.
fn outward() -> Vec3 {
    let (at, (a, b)) = (undented(), TORSO);
    Vec3::new(at.x / (a * a), at.y / (b * b), 0.0).normalize()
}

/// 1 under the apical probe, 0 away from it.
fn pressed(p: &Point) -> Tree {
    let rel = p.from(Placement::new().face);
    let squares = rel.0.square() + rel.1.square() + rel.2.square();
    (squares * (-0.5 / (PRINT * PRINT))).exp()
}

/// Levels between which the wall is layered: what is above and below is [`outer`].
const LAYERED: (f32, f32) = (-240.0, 150.0);

/// Distance to the skin of the trunk between two levels.
fn column(p: &Point, (low, high): (f32, f32)) -> Tree {
    let (a, b) = TORSO;
    let placement = Placement::new();
    // Under the apical probe the skin is pushed in and lies flat against its face, which leans on it.
    let lean = -placement.axes[2] - outward();
    let dent = p.from(placement.face).dot(lean) + (PRESS + GEL);
    let round = elliptic_cylinder(p, a, b) + pressed(p) * dent;
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    intersection(round, (p.2.clone() - middle).abs() - half, 40.0)
}

fn trunk(p: &Point) -> Tree {
    column(p, LAYERED)
}

/// Distance to the skin of the trunk with the navel, negative inside.
pub fn skin(p: &Point) -> Tree {
    let navel = ellipsoid(&p.from(Vec3::new(0.0, -TORSO.1, -190.0)), Vec3::new(8.0, 9.0, 10.0));
    difference(trunk(p), navel, 6.0)
}

/// Head, arms and hips: they say where up is, and have no layers.
fn outer(p: &Point) -> Tree {
    figure(p, SHOULDER).min(column(p, (-430.0, LAYERED.0 + 20.0)))
}

/// Everything deeper than `depth` mm below `surface`; under the probe it is compressed by a quarter.
fn deeper(p: &Point, surface: Tree, depth: f32) -> Tree {
    surface + (pressed(p) * -0.25 + 1.0) * depth + undulation(p, 0.4, 70.0, 1.9)
}

/// The space inside the trunk's wall.
fn inside(p: &Point) -> Tree {
    deeper(p, trunk(p), INSIDE)
}

/// Sternal level of the second to seventh cartilage, fall of the rib towards the side, and distance from the midline at
/// which it becomes bone, mm. Spaces between ribs are 15 to 18 mm high.
const RIBS: [(f32, f32, f32); 6] = [
    (110.0, 6.0, 60.0),
    (82.0, 9.0, 68.0),
    (54.0, 13.0, 77.0),
    (27.0, 19.0, 88.0),
    (3.0, 28.0, 99.0),
    (-15.0, 43.0, 108.0),
];

/// Ribs 13 mm high and 7 mm thick (Mohr et al., J Biomech 2007).
const RIB_SECTION: (f32, f32) = (6.5, 3.6);

/// A band along the wall: its middle at the height 0 of `height`.
fn band(p: &Point, height: Tree, (high, thick): (f32, f32)) -> Tree {
    let depth = deeper(p, trunk(p), RIB) * (1.0 / thick);
    let round = (depth.square() + (height * (1.0 / high)).square() + 1e-4).sqrt();
    (round - 1.0) * thick
}

/// Rib or cartilage along the line of a rib; the line falls forwards and rises again towards the sternum.
fn rib_line(p: &Point, (level, fall, _): (f32, f32, f32)) -> Tree {
    let side = p.0.clone().abs();
    let fallen = side.clone() / (side.square() + 3600.0).sqrt() * fall;
    let front = p.1.clone().min(0.0) + TORSO.1;
    let rise = front * 0.7 + p.1.clone().max(0.0) * 0.3;
    // Cosine of the slant on the front.
    (p.2.clone() - rise - level + fallen) * 0.9
}

/// Bony ribs two to seven, from the cartilage around to the spine.
fn ribs(p: &Point) -> Tree {
    let side = p.0.clone().abs();
    let one = |rib: (f32, f32, f32)| {
        let bone = (-side.clone() + rib.2).min(-p.1.clone());
        let bone = bone.max(-side.clone() + 24.0);
        intersection(band(p, rib_line(p, rib), RIB_SECTION), bone, 3.0)
    };
    least(RIBS.map(one)).min(sternum(p))
}

fn least(fields: [Tree; 6]) -> Tree {
    let [a, b, c, d, e, f] = fields;
    a.min(b).min(c.min(d)).min(e.min(f))
}

/// Manubrium and body, 36 mm wide, 17 cm long.
fn sternum(p: &Point) -> Tree {
    let plate = band(p, p.0.clone(), (18.0, 5.0));
    intersection(plate, (p.2.clone() - 68.0).abs() - 82.0, 6.0)
}

/// Cartilages between the sternum and the ribs.
fn cartilages(p: &Point) -> Tree {
    let side = p.0.clone().abs();
    let one = |rib: (f32, f32, f32)| {
        let ends = (side.clone() - rib.2 + 1.0).max(-side.clone() + 16.0).max(p.1.clone());
        intersection(band(p, rib_line(p, rib), (6.0, 3.4)), ends, 2.0)
    };
    least(RIBS.map(one))
}

/// Pericardium with the fat around it: what the lungs leave to the heart.
fn pericardium(p: &Point) -> Tree {
    let q = Placement::new().heart(p);
    let hull = ellipsoid(&q.from(Vec3::new(-15.5, -3.0, 104.0)), Vec3::new(57.0, 62.0, 106.0));
    hull + undulation(p, 1.5, 43.0, 0.9)
}

/// Middle of the vertebrae in the section, mm.
const SPINE: (f32, f32) = (0.0, 70.0);

/// What lies between the lungs: the heart, the great vessels above it, oesophagus, aorta and spine behind it, and in
/// front the cardiac notch, through which the heart lies against the wall left of the sternum.
fn mediastinum(p: &Point) -> Tree {
    let at = Vec3::new;
    let vessels = cone(p, at(-8.0, -20.0, 80.0), 34.0, at(0.0, 10.0, 190.0), 30.0);
    let behind = elliptic_cylinder(&p.from(at(6.0, 58.0, 0.0)), 34.0, 36.0);
    let notch = cone(p, at(38.0, -118.0, 40.0), 36.0, at(24.0, -60.0, 34.0), 62.0);
    // Fat in the angle between heart and diaphragm.
    let angle = cone(p, at(-24.0, -88.0, -24.0), 30.0, at(-38.0, -44.0, 8.0), 40.0);
    let edge = cone(p, at(2.0, -124.0, 30.0), 16.0, at(2.0, -124.0, 170.0), 8.0);
    union_all(vec![pericardium(p), vessels, behind, notch, angle, edge], 12.0)
}

/// Domes of the diaphragm, extended downwards; the middle carries the heart.
fn dome(p: &Point) -> Tree {
    let shaft = |centre: Vec3, r: Vec3| {
        let q = p.from(centre);
        ellipsoid(&Point(q.0, q.1, q.2.max(0.0)), r)
    };
    let right = shaft(Vec3::new(-72.0, 0.0, -80.0), Vec3::new(90.0, 112.0, 96.0));
    let left = shaft(Vec3::new(74.0, 14.0, -90.0), Vec3::new(84.0, 100.0, 84.0));
    let middle = shaft(Vec3::new(0.0, -40.0, -90.0), Vec3::new(90.0, 112.0, 66.0));
    let whole = union(union(right, left, 30.0), middle, 25.0);
    difference(whole, pericardium(p), 8.0)
}

/// Thickness of the diaphragm, mm (Boussuges et al., Chest 2009: 2-3 mm at rest).
const DIAPHRAGM: f32 = 2.8;

/// Right lobe, and the left one that reaches below the heart.
fn liver(p: &Point) -> Tree {
    let right = ellipsoid(&p.from(Vec3::new(-76.0, 0.0, -72.0)), Vec3::new(82.0, 98.0, 100.0));
    let left = ellipsoid(&p.from(Vec3::new(4.0, -56.0, -58.0)), Vec3::new(70.0, 62.0, 44.0));
    let lobes = union(right, left, 30.0) + undulation(p, 1.0, 60.0, 2.7);
    let room = intersection(dome(p) + (DIAPHRAGM + 1.0), inside(p) + 3.0, 6.0);
    intersection(lobes, room, 4.0)
}

fn lungs(p: &Point) -> Tree {
    let top = half_space(p, Vec3::new(0.0, 0.0, 150.0), Vec3::Z);
    let room = intersection(inside(p) + 1.0, top, 40.0);
    // Lower borders: sixth rib in front, eighth at the side, tenth behind.
    let recess = half_space(p, Vec3::new(0.0, -TORSO.1, 0.0), Vec3::new(0.0, -0.45, -1.0));
    let above = difference(intersection(room, recess, 20.0), dome(p) + 1.4, 8.0);
    difference(above, mediastinum(p), 10.0)
}

/// Vertebral bodies and arches as one waisted column.
fn spine(p: &Point) -> Tree {
    let q = p.from(Vec3::new(SPINE.0, SPINE.1, 0.0));
    let waist = (p.2.clone() * (std::f32::consts::TAU / 28.0)).cos() * 1.6;
    let bodies = elliptic_cylinder(&q, 17.0, 15.0) + waist;
    let arches = elliptic_cylinder(&q.from(Vec3::new(0.0, 26.0, 0.0)), 9.0, 14.0);
    let column = union(bodies, arches, 8.0);
    intersection(column, (p.2.clone() + 80.0).abs() - 230.0, 6.0)
}

/// Descending aorta, 24 mm wide (Wolak et al., JACC Cardiovasc Imaging 2008), left of the spine: seen behind the
/// left atrium in the parasternal long axis.
fn descending_aorta(p: &Point) -> Tree {
    cone(p, Vec3::new(25.0, 44.0, 110.0), 12.0, Vec3::new(12.0, 50.0, -180.0), 11.0)
}

/// All parts, in rising priority, in the body's frame.
pub fn parts() -> Vec<Part> {
    let p = &Point::world();
    let (wall, inner) = ((7.0, 0.3), (7.0, 0.08));
    let cavity = intersection(inside(p), dome(p) + 1.4, 3.0);
    let belly = intersection(inside(p) + 1.0, dome(p) + DIAPHRAGM, 3.0);
    vec![
        part("body", "body_skin", (9.0, 0.06), outer(p)),
        part("skin", "skin", wall, skin(p)),
        part("fat", "fat", wall, deeper(p, skin(p), FAT)),
        part("chest-muscles", "muscle", wall, deeper(p, skin(p), MUSCLE)),
        part("thorax", "chest", wall, inside(p)),
        part("cartilages", "cartilage", (3.0, 0.6), cartilages(p)),
        part("ribs", "cortical_bone", (3.0, 0.5), ribs(p)),
        part("spine", "cortical_bone", inner, spine(p)),
        part("descending-aorta", "blood", (5.0, 0.2), descending_aorta(p)),
        part("diaphragm", "muscle", inner, cavity),
        part("belly", "visceral_fat", inner, belly),
        part("liver", "liver", inner, liver(p)),
        part("lungs", "lung", (6.0, 0.12), lungs(p)),
    ]
}
