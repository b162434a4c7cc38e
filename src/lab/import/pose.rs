//! Search for the place on the skin from which a probe sees an organ with the least bone and gas in the way.

use glam::{DAffine3, DVec3};

use super::grid::Grid;
use crate::scene::Tissue;
use crate::scene::mesh::Soup;

/// A probe on the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Middle of the face, LPS, mm.
    pub position: DVec3,
    /// Depth axis.
    pub direction: DVec3,
    /// Lateral axis: in transverse views to the patient's left, in longitudinal ones to the feet, as pictures are shown.
    pub lateral: DVec3,
    /// Distance to the point that is looked at, mm.
    pub distance: f64,
    /// Length of bone and gas on the straight path to it, mm.
    pub blocked: f64,
    /// Share of the straight paths to points beside it, in the image, that meet bone or gas.
    pub shaded: f64,
}

/// Inputs of the search.
pub struct Task<'t> {
    /// The body in coarse voxels.
    pub grid: &'t Grid,
    /// True for each label that sound hardly passes.
    pub blocks: &'t [bool; 256],
    /// Label of the organ.
    pub target: u8,
    /// The skin, outward.
    pub skin: &'t Soup,
    /// Places of the skin where no probe can be: the cut of the acquired volume.
    pub forbidden: &'t dyn Fn(DVec3) -> bool,
}

/// Reflected share of the intensity, at normal incidence from soft tissue, above which a tissue hides structures behind it.
const HIDES: f64 = 0.1;
/// Impedance of soft tissue, MRayl.
const SOFT: f64 = 1.63;
/// Places of the skin that are tried.
const PLACES: usize = 3000;
/// Number of straight paths to either side in the image, and the angle between two, rad.
const SIDES: i32 = 4;
const ANGLE: f64 = 0.1;
/// Least cosine of the angle between beam and skin: 45 degrees.
const STEEPEST: f64 = 0.7;
/// Depth by which the face is pressed into the skin, mm.
const PRESSED: f64 = 1.0;

/// Returns whether a tissue hides structures behind it, as bone and gas do.
pub fn blocks(tissue: &Tissue) -> bool {
    let z = tissue.impedance();
    ((z - SOFT) / (z + SOFT)).powi(2) > HIDES
}

/// The voxel of a label that is nearest to the middle of all of them, LPS, mm.
fn middle(grid: &Grid, label: u8) -> Option<DVec3> {
    let [x, y, _] = grid.size;
    let of = |at: usize| DVec3::new((at % x) as f64, (at / x % y) as f64, (at / (x * y)) as f64);
    let own = || (0..grid.voxels.len()).filter(|&at| grid.voxels[at] == label).map(of);
    let count = own().count();
    let mean = own().sum::<DVec3>() / count.max(1) as f64;
    let place = own().min_by(|a, b| a.distance(mean).total_cmp(&b.distance(mean)))?;
    Some(grid.world_from_voxel.transform_point3(place))
}

/// The best view of an organ; none where it has no voxels or the skin no place for a probe.
pub fn find(task: &Task) -> Option<View> {
    let target = middle(task.grid, task.target)?;
    let back = task.grid.world_from_voxel.inverse();
    let step = task.skin.triangles.len().div_ceil(PLACES).max(1);
    // Places all over the skin, whatever the order of the triangles: steps prime to their number.
    let count = task.skin.triangles.len();
    let mut best: Option<(f64, View)> = None;
    for n in 0..count / step {
        let triangle = task.skin.triangles[n * step];
        let [a, b, c] =
            triangle.map(|v| DVec3::from(task.skin.positions[v as usize].map(f64::from)));
        let place = (a + b + c) / 3.0;
        let inward = -(b - a).cross(c - a).normalize_or_zero();
        let way = target - place;
        let direction = way.normalize_or_zero();
        if direction.dot(inward) < STEEPEST || (task.forbidden)(place) {
            continue;
        }
        // A millimetre of bone is worse than everything else; then shadows beside, ways along the body or from its
        // back, where no probe is held, depth, and a tilted face.
        let unusual = 40.0 * direction.z.powi(2) + 20.0 * f64::max(0.0, -direction.y);
        for lateral in laterals(direction) {
            let view = View {
                position: place + PRESSED * direction,
                direction,
                lateral,
                distance: way.length(),
                blocked: hidden(task, &back, place, target),
                shaded: shaded(task, &back, place, direction, lateral, way.length()),
            };
            let score = 20.0 * view.blocked
                + 100.0 * view.shaded
                + unusual
                + 0.3 * view.distance
                + 30.0 * (1.0 - direction.dot(inward));
            if best.is_none_or(|(least, _)| score < least) {
                best = Some((score, view));
            }
        }
    }
    best.map(|(_, view)| view)
}

/// Lateral axes across a direction: of a transverse and of a longitudinal view.
fn laterals(direction: DVec3) -> [DVec3; 2] {
    let across = |v: DVec3| v.reject_from_normalized(direction);
    let head = across(DVec3::Z);
    let transverse = match head.length() > 0.2 {
        true => direction.cross(head).normalize(),
        false => across(DVec3::X).normalize_or(DVec3::X),
    };
    // Seen from the front, the patient's right is on the left of the picture.
    let turn = match transverse.x.abs() > 0.3 {
        true => transverse.x.signum(),
        false => transverse.y.signum(),
    };
    [transverse * turn, -transverse.cross(direction) * transverse.cross(direction).z.signum()]
}

/// Length of bone and gas on a straight path, mm.
fn hidden(task: &Task, back: &DAffine3, from: DVec3, to: DVec3) -> f64 {
    let step = task.grid.spacing().min_element() * 0.5;
    let way = to - from;
    let count = (way.length() / step).ceil().max(1.0);
    let blocked = (0..count as usize).filter(|&n| {
        let at = from + way * ((n as f64 + 0.5) / count);
        task.blocks[usize::from(task.grid.at_point(back, at))]
    });
    blocked.count() as f64 * way.length() / count
}

/// Share of the straight paths to either side in the image plane that are hidden.
fn shaded(
    task: &Task,
    back: &DAffine3,
    from: DVec3,
    direction: DVec3,
    lateral: DVec3,
    distance: f64,
) -> f64 {
    let hidden = (-SIDES..=SIDES).filter(|&side| {
        let (sin, cos) = (ANGLE * f64::from(side)).sin_cos();
        hidden(task, back, from, from + (direction * cos + lateral * sin) * distance) > 0.0
    });
    hidden.count() as f64 / f64::from(2 * SIDES + 1)
}

#[cfg(test)]
mod tests {
    use super::super::hull;
    use super::*;

    /// A ball of label 1 behind a plate of label 2 on its front (towards -y), with a window in it.
    fn body(window: bool) -> Grid {
        let mut voxels = Vec::new();
        for (k, j) in (0..40).flat_map(|k| (0..40).map(move |j| (k, j))) {
            voxels.extend((0..40).map(|i| {
                let p = DVec3::new(f64::from(i), f64::from(j), f64::from(k));
                let plate = p.distance(DVec3::splat(20.0));
                if plate < 5.0 {
                    1
                } else if (11.0..13.0).contains(&plate)
                    && !(window && i < 13 && (k - 20_i32).abs() < 4)
                {
                    2
                } else {
                    0
                }
            }));
        }
        Grid { size: [40; 3], world_from_voxel: DAffine3::from_scale(DVec3::splat(4.0)), voxels }
    }

    fn view(grid: &Grid) -> View {
        let mut hides = [false; 256];
        hides[2] = true;
        let skin = hull::around(grid, 10.0).expect("voxels");
        let task = Task { grid, blocks: &hides, target: 1, skin: &skin, forbidden: &|_| false };
        find(&task).expect("a view")
    }

    #[test]
    fn the_probe_looks_through_the_window_between_bones() {
        let found = view(&body(true));
        assert_eq!(found.blocked, 0.0);
        assert!(found.direction.x > 0.9, "{found:?}");
        assert!(
            (found.position + found.direction * (found.distance - PRESSED))
                .distance(DVec3::splat(80.0))
                < 0.1
        );
        assert!(found.lateral.dot(found.direction).abs() < 1e-9);
        // Without one it goes where the plate is thinnest, a voxel or two, and that is told.
        let closed = view(&body(false));
        assert!((3.0..11.0).contains(&closed.blocked), "{closed:?}");
    }

    #[test]
    fn pictures_have_the_usual_sides() {
        // From the front: the patient's left, then the feet.
        let [transverse, longitudinal] = laterals(DVec3::Y);
        assert!(transverse.distance(DVec3::X) < 1e-12 && longitudinal.distance(-DVec3::Z) < 1e-12);
        // From the right side: the back, then the feet.
        let [transverse, longitudinal] = laterals(DVec3::X);
        assert!(transverse.distance(DVec3::Y) < 1e-12, "{transverse}");
        assert!(longitudinal.distance(-DVec3::Z) < 1e-12);
        for direction in [DVec3::Z, DVec3::new(0.3, -0.2, 0.9).normalize(), -DVec3::Y] {
            for lateral in laterals(direction) {
                assert!(
                    lateral.dot(direction).abs() < 1e-9 && (lateral.length() - 1.0).abs() < 1e-9
                );
            }
        }
    }

    #[test]
    fn bone_and_gas_hide_what_is_behind_and_nothing_else_does() {
        for tissue in crate::scene::tissue::table::shipped() {
            let hard =
                ["cortical_bone", "fetal_bone", "lung", "air"].contains(&tissue.name.as_str());
            // Fetal bone is thin and lets sound through.
            assert!(blocks(&tissue) == hard || tissue.name == "fetal_bone", "{}", tissue.name);
        }
    }
}
