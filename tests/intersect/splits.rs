//! Cut triangles: rays have the same hits as without cuts, to the last bit.

use std::path::Path;

use glam::DVec3;
use insonify::scene::{Scene, shapes};
use insonify::sim::bvh::Splits;

use super::compare::{self, Found};
use super::device::{Rig, Traced};
use super::rays::{Ray, corners, mirrored, placement, rays, scene, turned};

/// A scene of long thin slanted triangles, nested and side by side: some share a structure.
fn aslant() -> Scene {
    let near = placement(DVec3::ONE, DVec3::X, 0.9, DVec3::new(0.0, 0.0, 60.0));
    scene(vec![
        (shapes::cylinder(9.0, 80.0, 40), turned()),
        (shapes::cylinder(6.0, 90.0, 24), turned()),
        (shapes::cylinder(2.0, 100.0, 12), near),
        (shapes::cuboid([3.0, 50.0, 40.0]), near),
        (shapes::ellipsoid([12.0, 3.0, 30.0], 3), mirrored()),
    ])
}

/// Rays for which the two results differ: the place may differ in no bit, the triangle only where two touching
/// ones are met at the same place.
fn different(scene: &Scene, a: &[Traced], b: &[Traced]) -> Vec<usize> {
    let alike = |a: Option<Found>, b: Option<Found>| match (a, b) {
        (Some(a), Some(b)) => {
            let [one, other] = [a, b].map(|f| corners(scene, f.instance, f.triangle));
            let touch = || one.iter().any(|corner| other.contains(corner));
            a.t == b.t && a.instance == b.instance && (a.triangle == b.triangle || touch())
        }
        (a, b) => a == b,
    };
    let differs = |i: &usize| !alike(a[*i].found, b[*i].found);
    (0..a.len()).filter(differs).collect()
}

#[test]
fn cut_triangles_are_met_where_whole_ones_are() {
    let scene = aslant();
    let rays: Vec<Ray> = rays(&scene, 100_000, 41);
    let [whole, cut] = [Splits::Object, Splits::Spatial].map(|s| Rig::split(&scene, s));
    let stored = |rig: &Rig| rig.world.triangles().size();
    assert!(stored(&cut) > stored(&whole), "nothing is cut");
    let [found, with] = [&whole, &cut].map(|rig| rig.trace(&rays));
    assert!(found.iter().filter(|hit| hit.found.is_some()).count() > 50_000);
    let different_rays = different(&scene, &found, &with);
    assert!(
        different_rays.is_empty(),
        "{} rays, first {:?}: {:?}, {:?}",
        different_rays.len(),
        rays[different_rays[0]],
        found[different_rays[0]],
        with[different_rays[0]]
    );
    // And that is what brute force finds.
    let few = &rays[..20_000];
    let expected: Vec<_> = few.iter().map(|ray| compare::expected(&scene, ray)).collect();
    let found: Vec<_> = with[..few.len()].iter().map(|hit| hit.found).collect();
    let wrong = compare::wrong(&scene, few, &expected, &found);
    assert!(wrong.is_empty(), "{wrong:?}");
    cut.assert_silent();

    // A part whose box is too small is noticed.
    let mut spoilt = Rig::split(&scene, Splits::Spatial);
    spoilt.swap_a_bound();
    assert!(!different(&scene, &with, &spoilt.trace(&rays)).is_empty());
}

/// Fewer nodes and triangles for rays among organs within each other.
#[test]
fn cuts_make_rays_cheaper() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/abdomen.toml");
    let (scene, _) = Scene::load(&file, &[]).expect("a shipped scene");
    let rays = rays(&scene, 4000, 43);
    let [whole, cut] = [Splits::Object, Splits::Spatial].map(|splits| {
        let hits = Rig::split(&scene, splits).trace(&rays);
        let steps = hits
            .iter()
            .map(|hit| [hit.counts.node_visits, hit.counts.triangle_tests].map(f64::from));
        let sum = steps.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        sum.map(|steps| steps / rays.len() as f64)
    });
    println!("nodes and triangles per ray: {whole:.2?} whole, {cut:.2?} cut");
    assert!(cut[0] < 0.95 * whole[0] && cut[1] < 0.95 * whole[1], "{whole:?} {cut:?}");
}
