//! Liver, gallbladder, right kidney, great vessels, lesions.

use fidget::context::Tree;
use glam::Vec3;

use crate::body::cavity;
use crate::field::{
    Point, cone, difference, ellipsoid, half_space, intersection, undulation, union, union_all,
};
use crate::pose;
use crate::vessels::{Piece, along};

/// Liver without the vessels in it: 15 cm from dome to tip in the midclavicular line (Kratzer et
/// al., J Ultrasound Med 2003: 14 +- 1.7 cm), a wedge that thins towards the left and downwards.
pub fn liver(p: &Point) -> Tree {
    let right = ellipsoid(&p.from(Vec3::new(-74.0, -8.0, 26.0)), Vec3::new(78.0, 88.0, 92.0));
    let left = ellipsoid(&p.from(Vec3::new(4.0, -44.0, 34.0)), Vec3::new(62.0, 36.0, 40.0));
    let lobes = union(right, left, 25.0);
    // The visceral face looks down, back and to the left; its meeting with the front is the
    // sharp lower edge.
    let visceral = half_space(p, Vec3::new(-73.0, -56.0, -40.0), Vec3::new(0.2, 0.36, -0.84));
    let wedge = intersection(lobes, visceral + undulation(p, 2.0, 60.0, 0.3), 12.0);
    // The midline's hollow before the vena cava and the spine.
    let spine = ellipsoid(&p.from(Vec3::new(4.0, 52.0, 20.0)), Vec3::new(40.0, 48.0, 160.0));
    let wedge = difference(wedge, spine, 14.0);
    let fitted = intersection(wedge, cavity(p) + 1.6, 6.0);
    let kidney_bed = kidney(p) - 4.0;
    let gallbladder_bed = gallbladder(p) - (GALLBLADDER_WALL + 0.6);
    difference(difference(fitted, kidney_bed, 8.0), gallbladder_bed, 6.0)
        + undulation(p, 0.8, 34.0, 1.3)
}

/// Thickness of the gallbladder's wall, mm (normal: under 3 mm, fasting).
pub const GALLBLADDER_WALL: f32 = 2.2;

/// Lumen of the gallbladder: a pear of 8 x 3 cm (normal: 7-10 x 3 cm), neck upwards and back,
/// lying in the default slice.
pub fn gallbladder(p: &Point) -> Tree {
    let at = pose::default();
    let fundus = at.at(40.0, 50.0, 0.0);
    let body = at.at(29.0, 62.0, 1.0);
    let neck = at.at(10.0, 84.0, 2.0);
    let duct = at.at(2.0, 84.0, 5.0);
    union_all(
        vec![
            cone(p, fundus, 13.5, body, 12.0),
            cone(p, body, 12.0, neck, 4.0),
            cone(p, neck, 3.2, duct, 2.6),
        ],
        5.0,
    ) + undulation(p, 0.7, 30.0, 0.6)
}

/// Middle of the right kidney, mm.
const KIDNEY: Vec3 = Vec3::new(-63.0, 37.0, -26.0);

/// Local axes of the kidney: towards the hilum (medial, forwards), across, along (the upper pole
/// lies medial and back).
fn kidney_axes() -> [Vec3; 3] {
    let along = Vec3::new(0.06, 0.24, 0.97).normalize();
    let hilum = Vec3::new(0.80, -0.55, 0.0);
    let hilum = (hilum - along * hilum.dot(along)).normalize();
    [hilum, along.cross(hilum), along]
}

/// Coordinates in the kidney, bent so that both poles lean towards the hilum.
fn in_kidney(p: &Point) -> Point {
    let Point(hilum, across, along) = p.from(KIDNEY).along(kidney_axes());
    Point(hilum - along.square() * 0.0032, across, along)
}

/// The point of the straightened kidney at these coordinates, mm.
fn kidney_point(hilum: f32, across: f32, along: f32) -> Vec3 {
    let [h, c, a] = kidney_axes();
    KIDNEY + h * (hilum + 0.0032 * along * along) + c * across + a * along
}

/// Right kidney with its capsule: 108 x 52 x 46 mm (Emamian et al., AJR 1993: 10.9 cm long).
pub fn kidney(p: &Point) -> Tree {
    let q = in_kidney(p);
    let bean = ellipsoid(&q, Vec3::new(26.0, 23.0, 54.0));
    let notch = ellipsoid(&q.from(Vec3::new(29.0, 0.0, 0.0)), Vec3::new(10.0, 8.0, 13.0));
    difference(bean, notch, 8.0) + undulation(p, 0.8, 28.0, 2.0)
}

/// Fat and collecting system of the renal sinus, open at the hilum.
pub fn renal_sinus(p: &Point) -> Tree {
    let q = in_kidney(p);
    let middle = ellipsoid(&q.from(Vec3::new(5.0, 0.0, 0.0)), Vec3::new(11.0, 8.0, 32.0));
    let hilum = ellipsoid(&q.from(Vec3::new(16.0, 0.0, 0.0)), Vec3::new(13.0, 6.5, 11.0));
    union(middle, hilum, 8.0) + undulation(p, 1.6, 17.0, 0.2)
}

/// Medullary pyramids, fourteen, base outwards, 6-7 mm under the capsule.
pub fn renal_pyramids(p: &Point) -> Tree {
    let mut cones = Vec::new();
    // Front row, back row, the lateral border between them, the poles.
    for (row, angle) in [(0, 62f32), (1, -62.0), (2, 0.0)] {
        for step in -2i32..=2 {
            // Rows are staggered, as calyces are.
            let along = 15.0 * step as f32 + [0.0, 5.0, -6.0][row];
            let shrink = (1.0 - (along / 54.0).powi(2)).sqrt();
            let (sin, cos) = angle.to_radians().sin_cos();
            let out = |r: f32| (5.0 - 26.0 * r * shrink * cos, 23.0 * r * shrink * sin);
            let (tip, base) = (out(0.36), out(0.64));
            cones.push(cone(
                p,
                kidney_point(tip.0, tip.1, 0.86 * along),
                1.8,
                kidney_point(base.0, base.1, along),
                4.6 * shrink.max(0.7),
            ));
        }
    }
    for pole in [-1.0, 1.0] {
        cones.push(cone(
            p,
            kidney_point(1.0, 0.0, 30.0 * pole),
            1.8,
            kidney_point(-1.0, 0.0, 41.0 * pole),
            4.2,
        ));
    }
    union_all(cones, 0.8) + undulation(p, 0.5, 14.0, 1.9)
}

/// Inferior vena cava (24 x 20 mm) with the right renal vein.
pub fn vena_cava(p: &Point) -> Tree {
    let trunk = along(&[
        (Vec3::new(-19.0, 26.0, -170.0), 11.0),
        (Vec3::new(-20.0, 23.0, -30.0), 11.0),
        (Vec3::new(-23.0, 17.0, 30.0), 11.5),
        (CAVAL_CONFLUENCE, 12.0),
        (Vec3::new(-18.0, -4.0, 105.0), 12.5),
    ]);
    let renal = along(&[
        (Vec3::new(-20.0, 23.0, -26.0), 5.0),
        (Vec3::new(-33.0, 22.0, -27.0), 4.6),
        (kidney_point(24.0, 0.0, 1.0), 4.2),
        (kidney_point(14.0, 1.0, 3.0), 2.6),
    ]);
    tubes(p, &[trunk, renal], 0.0, 5.0)
}

/// The point at which the hepatic veins end, mm.
pub const CAVAL_CONFLUENCE: Vec3 = Vec3::new(-23.0, 8.0, 74.0);

/// Abdominal aorta (20 mm; normal under 3 cm) with the coeliac trunk's and upper mesenteric
/// artery's first centimetres, widened by `wall` mm.
pub fn aorta(p: &Point, wall: f32) -> Tree {
    let trunk = along(&[
        (Vec3::new(14.0, 21.0, -170.0), 9.0),
        (Vec3::new(12.0, 20.0, -30.0), 9.6),
        (Vec3::new(11.0, 24.0, 40.0), 10.4),
        (Vec3::new(10.0, 30.0, 150.0), 11.0),
    ]);
    let mesenteric = along(&[
        (Vec3::new(12.0, 20.0, 2.0), 4.0),
        (Vec3::new(11.0, 4.0, -6.0), 3.6),
        (Vec3::new(10.0, -2.0, -30.0), 3.4),
        (Vec3::new(9.0, -3.0, -70.0), 3.2),
    ]);
    let coeliac = along(&[
        (Vec3::new(11.0, 21.0, 18.0), 4.0),
        (Vec3::new(10.0, 4.0, 16.0), 3.4),
        (Vec3::new(-4.0, -3.0, 14.0), 2.8),
        (Vec3::new(-16.0, -6.0, 8.0), 2.6),
    ]);
    tubes(p, &[trunk, mesenteric, coeliac], wall, 3.0)
}

fn tubes(p: &Point, vessels: &[Vec<Piece>], wall: f32, fillet: f32) -> Tree {
    let cones = vessels.iter().flatten().map(|q| {
        let [ra, rb] = q.radii.map(|r| r + wall);
        cone(p, q.ends[0], ra, q.ends[1], rb)
    });
    let whole = union_all(cones.collect(), fillet);
    // Ends inside the body, away from its cut faces.
    intersection(whole, (p.2.clone() + 23.0).abs() - 133.0, 3.0)
}

/// The main portal vein from the splenic confluence to the porta hepatis: 12 mm wide (normal:
/// 10-13 mm), and the splenic vein's end.
pub fn portal_trunk() -> Vec<Piece> {
    along(&[
        (Vec3::new(34.0, -4.0, -18.0), 4.2),
        (Vec3::new(6.0, -2.0, -20.0), 5.2),
        (Vec3::new(-8.0, -2.0, -14.0), 6.2),
        (Vec3::new(-28.0, -4.0, 2.0), 6.1),
        (PORTA, 6.0),
    ])
}

/// The porta hepatis, mm.
pub const PORTA: Vec3 = Vec3::new(-42.0, -4.0, 14.0);

/// Hepatic flexure of the colon, haustrated, 4 cm wide (normal: 3-5 cm), shrunk by `wall` mm.
fn colon(p: &Point, wall: f32) -> Tree {
    let at = pose::default();
    let path = [
        Vec3::new(-96.0, 24.0, -150.0),
        Vec3::new(-84.0, 16.0, -78.0),
        at.at(67.0, 80.0, 2.0),
        Vec3::new(-44.0, -22.0, -68.0),
        Vec3::new(-20.0, -38.0, -76.0),
        Vec3::new(20.0, -44.0, -70.0),
    ];
    let pieces = path.windows(2);
    let cones = pieces.map(|w| cone(p, w[0], 17.0 - wall, w[1], 17.0 - wall));
    let tube = union_all(cones.collect(), 10.0);
    let haustra = undulation(p, 3.4, 26.0, 0.8);
    let whole = tube + haustra;
    let clear_of = union(gallbladder(p) - 4.5, kidney(p) - 2.5, 3.0);
    let whole = difference(whole, clear_of - wall, 4.0);
    intersection(whole, cavity(p) + 2.0 + wall, 4.0)
}

/// The colon with its wall.
pub fn colon_wall(p: &Point) -> Tree {
    colon(p, 0.0)
}

/// The content of the colon, whose wall is 2.6 mm thick (normal: under 3 mm).
pub fn colon_content(p: &Point) -> Tree {
    colon(p, 2.6)
}

/// Gas on top of the content: the patient lies on the back, so that gas rises forwards.
pub fn colon_gas(p: &Point) -> Tree {
    let level = p.1.clone() * 1.0 - p.0.clone() * 0.15 - 3.0 + undulation(p, 1.5, 19.0, 2.4);
    intersection(colon(p, 3.4), level, 3.0)
}

/// A simple cyst of 16 mm in the default slice.
pub fn cyst(p: &Point) -> Tree {
    let centre = pose::default().at(-11.0, 47.0, 0.5);
    ellipsoid(&p.from(centre), Vec3::new(8.4, 7.6, 8.0)) + undulation(p, 0.4, 14.0, 0.7)
}

/// A solid lesion of 19 mm in the default slice.
pub fn lesion(p: &Point) -> Tree {
    let centre = pose::default().at(-36.0, 112.0, -0.5);
    ellipsoid(&p.from(centre), Vec3::new(9.8, 9.0, 9.4)) + undulation(p, 1.3, 13.0, 2.6)
}
