//! A heart from cine MRI: three surfaces in 25 phases of a beat, open at the valves.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use insonify::scene::Mesh;
use insonify::scene::mesh::{Choice, Options, Units, load_animated, load_keyframes};

use crate::common::shared_data::shared_data;
use crate::keyframes::compare::{Corners, ROUNDING, reach};

const SURFACES: [&str; 3] = ["LV_ENDOCARDIAL", "RV_ENDOCARDIAL", "EPICARDIAL"];
const PHASES: usize = 25;

fn files(folder: &Path, surface: &str) -> Vec<PathBuf> {
    let file = |k| folder.join(format!("obj/patient1_{surface}_{k:03}.obj"));
    (0..PHASES).map(file).collect()
}

fn options() -> Options {
    Options { units: Units::named("mm"), cap_openings: true, ..Options::default() }
}

/// Vertices and triangles of a file with `v` and `f` lines of text.
fn parse(path: &Path) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let text = std::fs::read_to_string(path).expect("readable");
    let words =
        |line: &str| -> Vec<String> { line.split(' ').skip(1).map(str::to_owned).collect() };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines().map(str::trim) {
        let words = words(line);
        let number = |i: usize| words[i].parse::<f64>().expect("a number");
        if line.starts_with("v ") {
            vertices.push([number(0), number(1), number(2)]);
        } else if line.starts_with("f ") {
            triangles.push([0, 1, 2].map(|i| number(i) as usize - 1));
        }
    }
    (vertices, triangles)
}

fn point(mesh: &Mesh, i: u32) -> [f64; 3] {
    mesh.positions[i as usize].map(f64::from)
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    let part = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// Enclosed volume, ml.
fn volume(mesh: &Mesh) -> f64 {
    let six = mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|i| point(mesh, i));
        dot(a, cross(b, c))
    });
    six.sum::<f64>() / 6000.0
}

/// Number of directed edges without exactly one partner in the other direction; corners at equal positions are
/// the same.
fn unpaired(mesh: &Mesh) -> usize {
    let mut runs: HashMap<_, [usize; 2]> = HashMap::new();
    let key = |i: u32| mesh.positions[i as usize].map(f32::to_bits);
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
            runs.entry((a.min(b), a.max(b))).or_default()[usize::from(a < b)] += 1;
        }
    }
    runs.values().filter(|runs| **runs != [1, 1]).count()
}

/// Largest distance of a cap's centre from the mean of the vertices around it.
fn off_centre(mesh: &Mesh, stored: usize) -> f64 {
    let mut counts: HashMap<[u32; 3], (usize, Vec<[f64; 3]>)> = HashMap::new();
    let key = |i: u32| mesh.positions[i as usize].map(f32::to_bits);
    for t in &mesh.triangles[stored..] {
        for k in 0..3 {
            let entry = counts.entry(key(t[k])).or_default();
            entry.0 += 1;
            entry.1.push(point(mesh, t[(k + 1) % 3]));
        }
    }
    // A rim's vertex has two triangles of a cap, its centre has all.
    let centres = counts.iter().filter(|(_, (count, _))| *count > 2);
    let off = centres.map(|(centre, (count, ring))| {
        let centre = centre.map(|v| f64::from(f32::from_bits(v)));
        let mean: [f64; 3] =
            std::array::from_fn(|i| ring.iter().map(|p| p[i]).sum::<f64>() / *count as f64);
        let away = minus(centre, mean);
        dot(away, away).sqrt()
    });
    let off: Vec<f64> = off.collect();
    assert!(off.len() >= 2, "a cap for each valve");
    off.into_iter().fold(0.0, f64::max)
}

/// Largest angle between the shading normals of `mesh` and those of the shape of `of`, degrees: means of the
/// faces weighted by their corner angles.
fn turned(mesh: &Mesh, of: &Mesh) -> f64 {
    let mut sums = vec![[0.0; 3]; of.positions.len()];
    for t in &of.triangles {
        let p = t.map(|i| point(of, i));
        let face = cross(minus(p[1], p[0]), minus(p[2], p[0]));
        let area = dot(face, face).sqrt();
        for k in 0..3 {
            let (a, b) = (minus(p[(k + 1) % 3], p[k]), minus(p[(k + 2) % 3], p[k]));
            let angle = (dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()).acos();
            let sum = &mut sums[t[k] as usize];
            *sum = std::array::from_fn(|i| sum[i] + face[i] / area * angle);
        }
    }
    let angle = |(sum, normal): (&[f64; 3], &[f32; 3])| {
        let normal = normal.map(f64::from);
        let sine = cross(*sum, normal);
        dot(sine, sine).sqrt().atan2(dot(*sum, normal)).to_degrees()
    };
    sums.iter().zip(&mesh.normals).map(angle).fold(0.0, f64::max)
}

#[test]
fn phases_share_one_closed_outward_surface() {
    let Some(data) = shared_data() else { return };
    for surface in SURFACES {
        let files = files(&data.join("heart-4d-bivme"), surface);
        let (meshes, issues) = load_keyframes(&files, &options()).expect(surface);
        assert_eq!(meshes.len(), PHASES);
        let stored: Vec<_> = files.iter().map(|f| parse(f)).collect();
        let triangles = &stored[0].1;
        let corners = Corners::new(&meshes[0], triangles, &stored[0].0);
        let (mut volumes, mut off, mut shading) = (Vec::new(), 0f64, 0f64);
        for (mesh, (vertices, _)) in meshes.iter().zip(&stored) {
            assert!(mesh.shares_topology(&meshes[0]));
            assert_eq!(unpaired(mesh), 0, "{surface}: closed");
            volumes.push(volume(mesh));
            // Decimal text, rounded once to single precision.
            let allowed = 2.0 * ROUNDING * reach(vertices);
            off = off.max(corners.off(mesh, vertices));
            assert!(off <= allowed, "{surface}: {off:e}");
            let centre = off_centre(mesh, triangles.len());
            assert!(centre <= allowed, "{surface}: {centre:e}");
            shading = shading.max(turned(mesh, mesh));
        }
        let (least, most) = (
            volumes.iter().copied().fold(f64::INFINITY, f64::min),
            volumes.iter().copied().fold(0.0, f64::max),
        );
        println!(
            "{surface}: {} triangles, {} vertices, {least:.1} to {most:.1} ml, off by {off:.1e} mm, \
             normals by {shading:.4} degrees, {} findings",
            meshes[0].triangles.len(),
            meshes[0].positions.len(),
            issues.len(),
        );
        assert!(least > 50.0 && most < 700.0, "{surface}: outward");
        // Single precision in the corners of triangles of a tenth of a millimetre.
        assert!(shading < 0.01, "{surface}: {shading}");

        // Planted errors for the comparisons: another phase's vertices, its normals, a hole.
        let allowed = 2.0 * ROUNDING * reach(&stored[0].0);
        assert!(corners.off(&meshes[0], &stored[1].0) > allowed);
        assert!(turned(&meshes[0], &meshes[9]) > 0.1);
        let mut open = meshes[0].clone();
        open.triangles.pop();
        assert!(unpaired(&open) > 0);
        let mut moved = meshes[9].clone();
        let hub = moved.triangles[triangles.len()];
        hub.iter().for_each(|&i| moved.positions[i as usize][0] += 1e-3);
        assert!(off_centre(&moved, triangles.len()) > allowed);
    }
}

#[test]
fn the_morphing_file_is_the_phases() {
    let Some(data) = shared_data() else { return };
    let folder = data.join("heart-4d-bivme");
    let glb = folder.join("heart-4d-25frames-morph.glb");
    let (animated, _) = load_animated(&glb, &options(), Choice::First).expect("the GLB");
    assert_eq!(animated.meshes.len(), SURFACES.len());
    for surface in SURFACES {
        let (phases, _) = load_keyframes(&files(&folder, surface), &options()).expect(surface);
        let morphed = animated.meshes.iter().find(|m| m.name == surface);
        let shapes = &morphed.expect("the surface").shapes;
        assert_eq!(shapes.len(), PHASES);
        let compare = |shapes: &[Mesh]| {
            let (mut off, mut far) = (0f64, 0f64);
            for (phase, shape) in phases.iter().zip(shapes) {
                assert!(phase.shares_topology(shape), "{surface}");
                for (a, b) in phase.positions.iter().zip(&shape.positions) {
                    let away = minus(a.map(f64::from), b.map(f64::from));
                    off = off.max(dot(away, away).sqrt());
                    far = a.iter().fold(far, |m, v| m.max(f64::from(v.abs())));
                }
            }
            // Both are rounded to single precision, and the displacement is; three roundings of half
            // a unit along each axis.
            (off, 3.0 * 3f64.sqrt() * ROUNDING * far)
        };
        let (off, allowed) = compare(shapes);
        println!("{surface}: off by {off:.1e} mm, {allowed:.1e} allowed");
        assert!(off <= allowed, "{surface}: {off:e}");
        let mut late = shapes.clone();
        late.rotate_left(1);
        let (off, allowed) = compare(&late);
        assert!(off > allowed, "a phase late is noticed");
    }
}
