//! The heart at end diastole: outer surface, four chambers, openings, papillary muscles, aorta.
//!
//! Frame, mm: z from the chest wall at the apex along the left ventricle's axis to its base, x from
//! the right to the left ventricle, y = z x x towards the back. The four-chamber plane is y = 0.
//! Sizes are within the normal ranges of Lang et al., J Am Soc Echocardiogr 2015;28:1-39: left
//! ventricle 48 mm wide (42-58 mm) and 62-150 ml, walls of 6-10 mm; right ventricle 25-41 mm wide
//! at its base; atria in the four-chamber view 3-4 cm wide.

use fidget::context::Tree;
use glam::{DVec2, Vec3};

use crate::field::{
    Point, cone, difference, ellipsoid, half_space, intersection, undulation, union, union_all,
};
use crate::model::Extent;
use crate::part::{Part, part};

/// The box that holds the heart.
pub const EXTENT: Extent =
    Extent { low: Vec3::new(-80.0, -64.0, 10.0), high: Vec3::new(60.0, 64.0, 206.0), step: 3.0 };

/// Level of the left ventricle's widest section.
pub const EQUATOR: f64 = 83.0;
/// Radius there, half-length towards the apex, half-length of the ellipsoid that the base cuts.
pub const CAVITY: [f64; 3] = [24.0, 52.0, 40.0];
/// The same of the outer surface: the wall is 10 mm thick, 8 mm at the apex.
pub const WALL: [f64; 3] = [34.0, 60.0, 46.0];
/// Level of the mitral valve; below, of the tricuspid valve, which lies nearer to the apex: in a
/// four-chamber view the right ventricle is recognised by it.
pub const MITRAL: f64 = 111.0;
/// See [`MITRAL`].
pub const TRICUSPID: f64 = 106.0;
/// Middle of the tricuspid valve in x and y.
pub const TRICUSPID_CENTRE: DVec2 = DVec2::new(-45.5, 0.0);
/// Radii of the openings at the valves.
pub const ORIFICE: [f64; 2] = [14.5, 13.5];
/// Middles of the left and right atrium.
pub const ATRIA: [Vec3; 2] = [Vec3::new(1.0, 3.0, 132.0), Vec3::new(-43.0, 1.0, 127.0)];

/// An ellipsoid of revolution about z whose halves differ.
fn egg(p: &Point, [r, below, above]: [f64; 3]) -> Tree {
    let z = p.2.clone() - EQUATOR as f32;
    let stretch = |t: Tree, by: f64| t * (r / by) as f32;
    let round = stretch(z.clone().min(0.0), below) + stretch(z.max(0.0), above);
    let whole = Point(p.0.clone(), p.1.clone(), round);
    // Squeezed along z by up to r / below: the gradient falls short of 1 by as much at the poles.
    ellipsoid(&whole, Vec3::splat(r as f32))
}

fn below(p: &Point, level: f64) -> Tree {
    p.2.clone() - level as f32
}

/// Blood of the left ventricle, with shallow trabeculae.
fn left_ventricle(p: &Point) -> Tree {
    let whole = egg(p, CAVITY) + undulation(p, 0.5, 15.0, 0.8);
    intersection(whole, below(p, MITRAL - 0.4), 2.0)
}

/// Right ventricle's cavity: the part of a wide egg that the left one leaves.
fn right_ventricle(p: &Point) -> Tree {
    let free = ellipsoid(&p.from(Vec3::new(-25.0, -3.0, 86.0)), Vec3::new(37.0, 40.0, 48.0));
    let trabeculae = undulation(p, 0.8, 17.0, 2.1);
    let crescent = difference(free, egg(p, WALL), 4.0) + trabeculae;
    intersection(crescent, below(p, TRICUSPID - 0.4), 2.0)
}

fn left_atrium(p: &Point) -> Tree {
    let body = ellipsoid(&p.from(ATRIA[0]), Vec3::new(19.0, 16.5, 19.0));
    let funnel =
        cone(p, Vec3::new(0.0, 0.0, MITRAL as f32), 15.6, Vec3::new(1.0, 2.0, 126.0), 14.5);
    // The stems of two pulmonary veins.
    let vein = |x: f32| {
        let (from, to) = (Vec3::new(0.6 * x, 4.0, 142.0), Vec3::new(x, 6.0, 153.0));
        cone(p, from, 5.0, to, 4.2)
    };
    let whole = union_all(vec![body, funnel, vein(15.0), vein(-11.0)], 6.0);
    let whole = intersection(whole, -below(p, MITRAL + 0.6), 1.5);
    difference(whole, aorta(p, AORTIC_WALL + 1.0), 3.0)
}

fn right_atrium(p: &Point) -> Tree {
    let body = ellipsoid(&p.from(ATRIA[1]), Vec3::new(18.5, 19.0, 19.0));
    let centre = Vec3::new(TRICUSPID_CENTRE.x as f32, 0.0, TRICUSPID as f32);
    let funnel = cone(p, centre, 14.4, Vec3::new(-44.5, 0.5, 120.0), 14.5);
    let whole = union(body, funnel, 6.0);
    // The septum between the atria is 3 mm thick.
    let septum = half_space(p, Vec3::new(-22.5, 0.0, 130.0), Vec3::new(1.0, 0.0, 0.12));
    let whole = intersection(whole, septum, 4.0);
    let whole = difference(whole, left_atrium(p) - 2.6, 3.0);
    let whole = difference(whole, aorta(p, AORTIC_WALL + 1.0), 3.0);
    let whole = difference(whole, egg(p, WALL) + 1.0, 3.0);
    intersection(whole, -below(p, TRICUSPID + 0.6), 1.5)
}

/// Blood between the chambers of one side: it lets the valves open.
fn opening(p: &Point, centre: Vec3, radius: f64) -> Tree {
    let q = p.from(centre);
    let disc = ellipsoid(
        &Point(q.0.clone(), q.1.clone(), Tree::from(0.0)),
        Vec3::new(radius as f32, radius as f32, 1.0),
    );
    intersection(disc, q.2.clone().abs() - 2.6, 1.0)
}

/// Thickness of the aortic root's wall, mm.
const AORTIC_WALL: f32 = 2.0;

/// Root of the aorta, 30 mm wide, in front of the four-chamber plane, widened by `wall`.
fn aorta(p: &Point, wall: f32) -> Tree {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let root = cone(p, at(-9.0, -27.0, 110.0), 12.0 + wall, at(-15.0, -33.0, 132.0), 13.5 + wall);
    let trunk = cone(p, at(-15.0, -33.0, 132.0), 13.0 + wall, at(-20.0, -34.0, 168.0), 13.0 + wall);
    union(root, trunk, 4.0)
}

/// Two papillary muscles with their roots in the wall, behind and in front of the plane.
fn papillary_muscles(p: &Point) -> Tree {
    let one = |side: f32| {
        let root = Vec3::new(13.0, 15.0 * side, 58.0);
        let tip = Vec3::new(7.5, 11.0 * side, 84.0);
        cone(p, root, 6.0, tip, 3.4)
    };
    one(1.0).min(one(-1.0)) + undulation(p, 0.3, 11.0, 1.2)
}

/// The muscle with all that it encloses; its outer surface is the epicardium.
fn outer(p: &Point) -> Tree {
    let right = ellipsoid(&p.from(Vec3::new(-25.0, -3.0, 86.0)), Vec3::new(41.5, 44.5, 52.5));
    let right = intersection(right, below(p, TRICUSPID + 7.0), 6.0);
    let left = intersection(egg(p, WALL), below(p, MITRAL + 9.0), 6.0);
    let ventricles = union(left, right, 7.0);
    let atria = union(left_atrium(p) - 2.6, right_atrium(p) - 2.6, 12.0);
    union(ventricles, atria, 7.0) + undulation(p, 0.4, 31.0, 0.2)
}

/// The beating parts, in rising priority. The first is the outer surface, the next four are the chambers
/// LV, RV, LA, RA.
pub fn parts() -> Vec<Part> {
    let p = &Point::world();
    let chamber = (3.4, 1.0);
    let small = (2.4, 0.7);
    let centre = TRICUSPID_CENTRE.extend(TRICUSPID).as_vec3();
    let mitral = Vec3::new(0.0, 0.0, MITRAL as f32);
    vec![
        part("epicardium", "myocardium", (4.2, 0.7), outer(p)),
        part("left-ventricle", "blood", chamber, left_ventricle(p)),
        part("right-ventricle", "blood", chamber, right_ventricle(p)),
        part("left-atrium", "blood", chamber, left_atrium(p)),
        part("right-atrium", "blood", chamber, right_atrium(p)),
        part("aortic-wall", "vessel_wall", (3.4, 0.4), aorta(p, AORTIC_WALL)),
        part("aorta", "blood", (3.4, 0.4), aorta(p, 0.0)),
        part("mitral-opening", "blood", small, opening(p, mitral, ORIFICE[0])),
        part("tricuspid-opening", "blood", small, opening(p, centre, ORIFICE[1])),
        part("papillary-muscles", "myocardium", small, papillary_muscles(p)),
    ]
}
