use super::*;
use crate::scene::shapes;

/// Direction and coherence back, for these tests.
fn mean(word: u32) -> (DVec3, f64) {
    let part = |from: u32| f64::from((word << (19 - from)) as i32 >> 19) / 4095.0;
    let (x, y) = (part(0), part(13));
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    let v = DVec3::new(x - t.copysign(x), y - t.copysign(y), z).normalize();
    (v, f64::from(word >> 26) / 63.0)
}

fn unpacked(word: u32) -> DVec3 {
    mean(word).0
}

/// Largest angle between the averaged and the mesh's own normals where `wanted`, by level.
fn worst(mesh: &Mesh, finest: f64, wanted: impl Fn(DVec3) -> bool) -> [f64; LEVELS] {
    let mut worst = [0f64; LEVELS];
    for (v, levels) in smoothed(mesh, finest).iter().enumerate() {
        let place = DVec3::from(mesh.positions[v].map(f64::from));
        let own = DVec3::from(mesh.normals[v].map(f64::from));
        for (worst, &word) in worst.iter_mut().zip(levels).filter(|_| wanted(place)) {
            *worst = worst.max(unpacked(word).angle_between(own));
        }
    }
    worst
}

/// A square of +-40 mm in steps of `edge`, lifted by `height`, with the normals of its slope.
fn terrain(edge: f64, height: impl Fn(f64, f64) -> f64) -> Mesh {
    let n = (80.0 / edge) as u32;
    let at = |i: u32| f64::from(i) * edge - 40.0;
    let mut mesh = Mesh::default();
    for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
        let (x, y, d) = (at(i), at(j), 1e-4);
        let slope =
            |dx: f64, dy: f64| (height(x + dx, y + dy) - height(x - dx, y - dy)) / (2.0 * d);
        let normal = DVec3::new(-slope(d, 0.0), -slope(0.0, d), 1.0).normalize();
        mesh.positions.push(DVec3::new(x, y, height(x, y)).as_vec3().to_array());
        mesh.normals.push(normal.as_vec3().to_array());
        if i < n && j < n {
            let (a, b) = (i * (n + 1) + j, (i + 1) * (n + 1) + j);
            mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }
    mesh
}

#[test]
fn means_survive_packing() {
    for i in 0..2000 {
        let [a, b] = [f64::from(i) * 0.377, f64::from(i) * 0.7131];
        let v = DVec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
        let coherence = f64::from(i) / 1999.0;
        let (direction, kept) = mean(pack(v, coherence));
        assert!(direction.angle_between(v) < 5e-4, "{v}");
        assert!((kept - coherence).abs() < 0.008, "{coherence}");
    }
    for v in DVec3::AXES.iter().flat_map(|&v| [v, -v]) {
        assert_eq!(mean(pack(v, 1.5)), (v, 1.0), "exact");
    }
}

/// Spheres, cylinders and planes look alike from everywhere on them.
#[test]
fn smooth_shapes_keep_their_normals() {
    for angle in worst(&shapes::sphere(20.0, 5), 1.0, |_| true) {
        assert!(angle < 2e-3, "{angle}: an icosahedron's pattern");
    }
    // A scale as large as the sphere still has its direction.
    for angle in worst(&shapes::sphere(6.0, 4), 1.0, |_| true) {
        assert!(angle < 5e-3, "{angle}");
    }
    // Neither edges nor ends count: they are creases.
    let tube = shapes::cylinder(5.0, 60.0, 96);
    for angle in worst(&tube, 1.0, |_| true) {
        assert!(angle < 1e-3, "{angle}");
    }
    for angle in worst(&shapes::cuboid([20.0, 30.0, 5.0]), 1.0, |_| true) {
        assert_eq!(angle, 0.0);
    }
    for angle in worst(&terrain(1.0, |x, y| 0.3 * x - 0.2 * y), 1.0, |_| true) {
        assert!(angle < 1e-4, "{angle}: up to the open edges");
    }
}

/// A ripple of wave number k decays by 1 / (1 + k^2 dt) at each step.
#[test]
fn ripples_decay_with_their_scale() {
    let k = std::f64::consts::TAU / 8.0;
    let slope = 0.1;
    let mesh = terrain(0.5, |x, _| slope / k * (k * x).sin());
    let middle = |p: DVec3| p.x.abs() < 10.0 && p.y.abs() < 10.0;
    let mut expected = f64::atan(slope);
    let mut variance = 0.0;
    let got = smoothed(&mesh, 1.0);
    for level in 0..LEVELS {
        let next = 4f64.powi(level as i32);
        expected /= 1.0 + k * k * (next - variance) / 2.0;
        variance = next;
        let tilts = got.iter().zip(&mesh.positions);
        let tilts = tilts.filter(|(_, p)| middle(DVec3::from(p.map(f64::from))));
        let tilt = tilts.map(|(words, _)| unpacked(words[level]).angle_between(DVec3::Z));
        let tilt = tilt.fold(0.0, f64::max);
        // The chords of 16 steps to the wave, the cosine of the slope.
        assert!((tilt - expected).abs() < 0.03 * expected + 1e-4, "{level}: {tilt} {expected}");
    }
}

/// The means over the area have the mean slope, also of steep bumps.
#[test]
fn steep_bumps_leave_the_slope_that_they_stand_on() {
    let bumps = |x: f64, y: f64| 0.5 * (1.7 * x).sin() * (1.9 * y + 0.4).cos();
    let mesh = terrain(0.4, |x, y| 0.2 * x + bumps(x, y));
    let slope = DVec3::new(-0.2, 0.0, 1.0).normalize();
    for (words, p) in smoothed(&mesh, 1.0).iter().zip(&mesh.positions) {
        if p[0].abs() < 15.0 && p[1].abs() < 15.0 {
            let off = unpacked(words[3]).angle_between(slope);
            assert!(off < 0.01, "{off} of slopes up to 0.9");
            assert_eq!(words.map(|word| mean(word).1), [1.0; LEVELS]);
        }
    }
}

/// The two sides of a sheet do not cancel into nonsense: where the sheet covers the beam it counts whole, at its rim
/// not at all.
#[test]
fn a_thin_sheet_keeps_its_sides() {
    let sheet = shapes::ellipsoid([30.0, 30.0, 0.5], 5);
    let radius = |p: DVec3| p.x.hypot(p.y);
    // Two and a half deviations from the rim.
    for (level, reach) in [(0, 27.0), (1, 25.0), (2, 20.0), (3, 10.0)] {
        let angle = worst(&sheet, 1.0, |p| radius(p) < reach)[level];
        assert!(angle < 0.08, "{level}: {angle}");
    }
    let means = smoothed(&sheet, 1.0);
    for (words, p) in means.iter().zip(&sheet.positions) {
        let radius = radius(DVec3::from(p.map(f64::from)));
        let [finest, .., coarse] = words.map(|word| mean(word).1);
        assert_eq!(finest, 1.0);
        assert!(radius > 10.0 || coarse == 1.0, "{radius}: {coarse}");
        assert!(radius < 29.5 || coarse < 0.2, "{radius}: {coarse}");
    }
}

/// Millimetres of the world, whatever the unit of the mesh.
#[test]
fn scales_follow_the_unit() {
    let bumpy = |edge: f64| terrain(edge, |x, y| 0.4 * (1.3 * x).sin() * (0.9 * y).sin());
    let (mesh, mut metres) = (bumpy(1.0), bumpy(1.0));
    for p in &mut metres.positions {
        *p = p.map(|x| x * 1e-3);
    }
    for (a, b) in smoothed(&mesh, 1.0).iter().zip(smoothed(&metres, 1e-3)) {
        for (&a, b) in a.iter().zip(b) {
            assert!(unpacked(a).angle_between(unpacked(b)) < 1e-3);
        }
    }
}

/// Nothing is asked of meshes that are none.
#[test]
fn odd_meshes_have_normals_too() {
    assert!(smoothed(&Mesh::default(), 1.0).is_empty());
    let flat = Mesh {
        positions: vec![[0.0; 3]; 4],
        normals: vec![[0.0, 1.0, 0.0]; 4],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    for words in smoothed(&flat, 1.0) {
        assert_eq!(words.map(unpacked), [DVec3::Y; LEVELS]);
    }
}
