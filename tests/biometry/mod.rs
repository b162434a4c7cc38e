//! Sizes of the shipped fetus and heart by the window's own measurements, against what the models were made with.
//!
//! Marks are put where an examiner would who sees every edge: on the cut of the model's surfaces with the image plane,
//! in the plane's own mm. What imaging adds, blur and refraction, is in those of the module [`imaged`].

#![cfg(feature = "window")]

mod imaged;

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};
use insonify::exam::{CaliperKind, Measured, Worksheet};
use insonify::scene::{Mesh, Scene};
use insonify::settings::Exam;
use insonify::view::model::calipers::Caliper;

/// Sizes of tools/anatomy/fetus.rs, mm, as the scene file's head has them: biparietal diameter.
const BPD: f64 = 17.0;
/// Occipitofrontal diameter.
const OFD: f64 = 21.5;
/// Abdominal circumference.
const AC: f64 = TAU * (7.9 + 1.5 / 4.0);
/// Crown-rump length.
const CRL: f64 = 43.0;

fn scene(name: &str, overrides: &[(String, String)]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    Scene::load(&path, overrides).expect("it ships").0
}

/// Corners of the triangles, mm in the world.
fn corners(mesh: &Mesh, place: &DAffine3) -> Vec<[DVec3; 3]> {
    let at =
        |v: u32| place.transform_point3(DVec3::from(mesh.positions[v as usize].map(f64::from)));
    mesh.triangles.iter().map(|triangle| triangle.map(at)).collect()
}

fn placed(scene: &Scene, name: &str) -> Vec<[DVec3; 3]> {
    let instance = scene.instances.iter().find(|i| i.name == name).expect("there is one");
    corners(&scene.meshes[instance.mesh], &instance.world_from_object)
}

/// An image plane: the middle of the probe's face, the lateral axis and the depth.
fn plane(at: DVec3, lateral: DVec3, depth: DVec3) -> DAffine3 {
    let (x, z) = (lateral.normalize(), depth.normalize());
    DAffine3::from_cols(x, z.cross(x), z, at)
}

/// The cut of a surface with the image plane, mm lateral and mm deep.
fn cut(triangles: &[[DVec3; 3]], world_from_probe: &DAffine3) -> Vec<[DVec2; 2]> {
    let inverse = world_from_probe.inverse();
    let mut out = Vec::new();
    for triangle in triangles {
        let p = triangle.map(|corner| inverse.transform_point3(corner));
        let sides = [(p[0], p[1]), (p[1], p[2]), (p[2], p[0])];
        let crossed = sides.into_iter().filter(|(a, b)| (a.y < 0.0) != (b.y < 0.0));
        let ends: Vec<DVec2> = crossed
            .map(|(a, b)| a.lerp(b, a.y / (a.y - b.y)))
            .map(|point| DVec2::new(point.x, point.z))
            .collect();
        if let [a, b] = ends[..] {
            out.push([a, b]);
        }
    }
    out
}

/// The outermost points of a cut, once around from `start` rad on.
fn outline(cut: &[[DVec2; 2]], centre: DVec2, start: f64, count: u32) -> Vec<DVec2> {
    let ray = |i| DVec2::from_angle(start + TAU * f64::from(i) / f64::from(count));
    let far = |way: DVec2| {
        let crossed = cut.iter().filter_map(|[a, b]| {
            let (p, side) = (*a - centre, *b - *a);
            let across = way.perp_dot(side);
            let (along, part) = (p.perp_dot(side) / across, p.perp_dot(way) / across);
            (across != 0.0 && along > 0.0 && (0.0..=1.0).contains(&part)).then_some(along)
        });
        crossed.max_by(f64::total_cmp).map(|along| centre + along * way)
    };
    (0..count).filter_map(|i| far(ray(i))).collect()
}

fn named(kind: CaliperKind, points: Vec<DVec2>, name: &str) -> Measured {
    Caliper { label: name.into(), ..Caliper::new(kind, points) }.measured()
}

fn middle(triangles: &[[DVec3; 3]]) -> DVec3 {
    let all = triangles.iter().flatten();
    let [low, high] = all
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)]);
    (low + high) / 2.0
}

/// Within `part` of what is expected; a value off by twice as much would be noticed.
fn close(name: &str, found: f64, expected: f64, part: f64) {
    let off = found / expected - 1.0;
    println!("{name}: {found:.2}, made as {expected:.2}: {:+.2} %", 100.0 * off);
    assert!(off.abs() <= part, "{name}: {found} {expected}");
    assert!((found * (1.0 + 2.0 * part) / expected - 1.0).abs() > part, "{name}: not told apart");
}

#[test]
fn the_fetus_is_measured_as_large_as_it_was_made() {
    let scene = scene("fetus.toml", &[]);
    let skull = scene.instances.iter().find(|i| i.name == "skull").expect("there is one");
    // In the fetus' own frame x points to the crown, y to the left, z to the back.
    let [crown, left, back] =
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| skull.world_from_object.transform_vector3(axis));
    let head = placed(&scene, "skull");
    let axial = plane(middle(&head) - 40.0 * back, left, back);
    let around = cut(&head, &axial);
    let axis = |way: DVec2| {
        let all = around.iter().flatten();
        all.copied().max_by(|a, b| a.dot(way).total_cmp(&b.dot(way))).expect("a cut")
    };
    let (sides, front) = ([axis(DVec2::X), axis(-DVec2::X)], [axis(DVec2::Y), axis(-DVec2::Y)]);
    let mut all = vec![
        named(CaliperKind::Distance, vec![sides[0], sides[1]], "BPD"),
        named(CaliperKind::Distance, vec![front[0], front[1]], "OFD"),
        named(CaliperKind::Ellipse, vec![front[0], front[1], sides[0]], "HC"),
    ];
    let trunk = placed(&scene, "trunk");
    // Across the trunk at the navel.
    let navel = scene.instances.iter().find(|i| i.name == "trunk").expect("there is one");
    let navel = navel.world_from_object.transform_point3(DVec3::new(-8.0, 0.0, -0.6));
    let around = cut(&trunk, &plane(navel - 40.0 * back, left, back));
    let around = outline(&around, DVec2::new(0.0, 40.0), 0.0, 240);
    let [right, behind, front] = [0, 60, 180].map(|i| around[i]);
    all.push(named(CaliperKind::Ellipse, vec![front, behind, right], "AC"));
    let femur = placed(&scene, "left-femur");
    let ends = femur.iter().flatten();
    let pairs = ends.clone().flat_map(|a| ends.clone().map(move |b| [*a, *b]));
    let far = |[a, b]: &[DVec3; 2]| a.distance(*b);
    let [knee, hip] = pairs.max_by(|a, b| far(a).total_cmp(&far(b))).expect("a femur");
    let across = (hip - knee).any_orthonormal_vector();
    let along = plane(knee - 30.0 * across, hip - knee, across);
    let flat = |point: DVec3| {
        let point = along.inverse().transform_point3(point);
        DVec2::new(point.x, point.z)
    };
    all.push(named(CaliperKind::Distance, vec![flat(knee), flat(hip)], "FL"));
    let rump = trunk.iter().flatten().min_by(|a, b| a.dot(crown).total_cmp(&b.dot(crown)));
    let top = placed(&scene, "head");
    let top = top.iter().flatten().max_by(|a, b| a.dot(crown).total_cmp(&b.dot(crown)));
    let (top, rump) = (*top.expect("a head"), *rump.expect("a trunk"));
    // A plane through both.
    let long = plane(top - 30.0 * back, rump - top, (rump - top).cross(left).cross(rump - top));
    let seen = |point: DVec3| {
        let point = long.inverse().transform_point3(point);
        DVec2::new(point.x, point.z)
    };
    all.push(named(CaliperKind::Distance, vec![seen(top), seen(rump)], "CRL"));
    let sheet = Worksheet::of(Exam::Obstetric, &all);
    for (name, expected) in [
        ("BPD", BPD),
        ("OFD", OFD),
        ("HC", TAU * (BPD + OFD) / 4.0),
        ("AC", AC),
        ("FL", 7.2),
        ("CRL", CRL),
    ] {
        close(name, sheet.mean(name).expect("measured"), expected, 0.03);
    }
    // Eleven weeks, as the model's author meant: 77.5 days.
    close("weeks", sheet.value("age by CRL").expect("derived"), 77.498 / 7.0, 0.02);
}

fn volume(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c))).sum::<f64>().abs() / 6000.0
}

/// Both outlines of a ventricle from annulus to annulus, four chambers and two.
fn apical(ventricle: &[[DVec3; 3]], names: [&str; 2]) -> [Measured; 2] {
    let base = ventricle.iter().flatten().max_by(|a, b| a.z.total_cmp(&b.z)).expect("a base");
    let far = |p: &&DVec3| p.distance(*base);
    let apex =
        ventricle.iter().flatten().max_by(|a, b| far(a).total_cmp(&far(b))).expect("an apex");
    // The annulus lies around the middle of the base, not at its highest point.
    let axis = (*base - *apex).normalize();
    let high = ventricle.iter().flatten().filter(|p| (**p - *base).dot(axis) > -4.0);
    let (sum, count) = high.fold((DVec3::ZERO, 0.0), |(sum, count), p| (sum + *p, count + 1.0));
    let annulus = sum / count;
    let axis = (annulus - *apex).normalize();
    let side = axis.cross(DVec3::Y).normalize();
    let of = |across: DVec3, name: &str| {
        let pose = plane(*apex - 20.0 * axis, across, axis);
        let lines = cut(ventricle, &pose);
        let centre = DVec2::new(0.0, 20.0 + 0.6 * apex.distance(annulus));
        // From the annulus, which lies deepest, once around.
        named(CaliperKind::Trace, outline(&lines, centre, TAU / 4.0, 240), name)
    };
    [of(side, names[0]), of(side.cross(axis), names[1])]
}

#[test]
fn the_ventricle_holds_what_its_mesh_holds() {
    let scene = scene("heart.toml", &[]);
    let ventricles = scene.instances.iter().filter(|i| i.name == "left-ventricle");
    let shapes: Vec<Vec<[DVec3; 3]>> = ventricles
        .flat_map(|i| {
            let meshes: &[usize] = match &i.keyframes.meshes[..] {
                [] => std::slice::from_ref(&i.mesh),
                several => several,
            };
            meshes.iter().map(|&mesh| corners(&scene.meshes[mesh], &i.world_from_object))
        })
        .collect();
    assert!(shapes.len() > 1, "it beats");
    let by = |a: &&Vec<[DVec3; 3]>, b: &&Vec<[DVec3; 3]>| volume(a).total_cmp(&volume(b));
    let diastole = shapes.iter().max_by(by).expect("shapes");
    let systole = shapes.iter().min_by(by).expect("shapes");
    let mut all = apical(diastole, ["LV ED 4C", "LV ED 2C"]).to_vec();
    all.extend(apical(systole, ["LV ES 4C", "LV ES 2C"]));
    let sheet = Worksheet::of(Exam::Cardiac, &all);
    let value = |name: &str| sheet.value(name).expect("derived");
    println!("single plane: {:?} {:?}", sheet.mean("LV ED 4C"), sheet.mean("LV ES 4C"));
    close("EDV", value("EDV, biplane"), volume(diastole), 0.05);
    close("ESV", value("ESV, biplane"), volume(systole), 0.05);
}
