//! Surfaces of label maps against closed forms, and with planted errors that these have to catch.

use std::collections::{HashMap, HashSet};

use glam::{DAffine3, DMat3, DVec3};

use super::grid::Grid;
use super::surface::Surfaces;
use super::{composed, nets, raster, relax};
use crate::scene::mesh::Soup;
use crate::scene::topology;

/// Half a voxel less the margin, as the program has it.
const REACH: f32 = relax::REACH;

fn grid(size: [usize; 3], label: impl Fn(DVec3) -> u8) -> Grid {
    let mut voxels = Vec::new();
    for k in 0..size[2] {
        for j in 0..size[1] {
            voxels.extend((0..size[0]).map(|i| label(DVec3::new(i as f64, j as f64, k as f64))));
        }
    }
    // Oblique, left-handed, uneven.
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.4);
    let matrix = turn * DMat3::from_diagonal(DVec3::new(-0.8, 0.8, 1.5));
    let world_from_voxel = DAffine3::from_mat3_translation(matrix, DVec3::new(30.0, -200.0, 900.0));
    Grid { size, world_from_voxel, voxels }
}

/// Every label's surface, smoothed within `reach`, by label.
fn surfaces(grid: &Grid, reach: f32) -> Vec<(u8, Soup)> {
    let volumes = grid.counts();
    let mut separate = grid.clone();
    composed::separate(&mut separate);
    let (faces, _) = nets::count(&separate);
    let mut net = nets::build(&separate, faces, |_| ());
    assert_eq!(net.faces.len() as u64, faces);
    relax::relax(&mut net, &volumes, reach, |_| ());
    let mut surfaces = Surfaces::new(&separate, &net);
    let labels = (1..=Grid::MOST).filter(|&l| volumes[usize::from(l)] > 0);
    labels.map(|l| (l, surfaces.of("", |other| other == l))).collect()
}

/// The least Dice coefficient of the labels with what their surfaces enclose, and the largest error of a volume.
fn figures(grid: &Grid, surfaces: &[(u8, Soup)]) -> (f64, f64) {
    let counts = grid.counts();
    let voxel = grid.world_from_voxel.matrix3.determinant().abs();
    let back = grid.world_from_voxel.inverse();
    let (mut dice, mut error) = (1.0f64, 0.0f64);
    for (label, soup) in surfaces {
        let count = counts[usize::from(*label)] as f64;
        let (mut both, mut enclosed) = (0.0, 0.0);
        raster::rasterise(soup, &back, grid.size, |x, j, k| {
            let row = grid.row(j as isize, k as isize).expect("a row");
            enclosed += x.len() as f64;
            both += row[x].iter().filter(|l| *l == label).count() as f64;
        });
        dice = dice.min(2.0 * both / (count + enclosed));
        error = error.max((topology::volume(soup) / (count * voxel) - 1.0).abs());
    }
    (dice, error)
}

/// Edges of a surface that are not between two triangles of one sense.
fn faults(soup: &Soup) -> usize {
    let edges = topology::Edges::of(soup);
    edges.groups().count() - edges.manifold().count()
}

/// Number of triangles on which two surfaces agree to the last bit, in the opposite sense.
fn shared(a: &Soup, b: &Soup) -> usize {
    let key = |soup: &Soup, t: [u32; 3], turned: bool| {
        let mut corners = t.map(|v| soup.positions[v as usize].map(f32::to_bits));
        if turned {
            corners.swap(1, 2);
        }
        let first = (0..3).min_by_key(|&n| corners[n]).expect("three");
        [0, 1, 2].map(|n| corners[(first + n) % 3])
    };
    let of_a: HashSet<_> = a.triangles.iter().map(|t| key(a, *t, false)).collect();
    b.triangles.iter().filter(|t| of_a.contains(&key(b, **t, true))).count()
}

/// Pairs of neighbouring voxels, by their labels, the smaller first.
fn borders(grid: &Grid) -> HashMap<(u8, u8), usize> {
    let mut out = HashMap::new();
    let [x, y, z] = grid.size.map(|n| n as isize);
    for k in 0..=z {
        for j in 0..=y {
            for i in 0..=x {
                for before in [[i - 1, j, k], [i, j - 1, k], [i, j, k - 1]] {
                    let (a, b) = (grid.at(before), grid.at([i, j, k]));
                    if a != b {
                        *out.entry((a.min(b), a.max(b))).or_default() += 1;
                    }
                }
            }
        }
    }
    out
}

/// A number from 0 to 1 by counter.
fn random(n: u32) -> f64 {
    crate::random::unit(crate::random::pcg4d([n, 1, 2, 3])[0])
}

/// Thirty organs: the cells around thirty points within a body, and vessels through them.
fn thirty() -> Grid {
    let size = [64, 56, 40];
    let middle = DVec3::new(31.5, 27.5, 19.5);
    // Off a lattice of three by three by three.
    let near = |n: u32| {
        let cell = DVec3::new(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9)) - 1.0;
        let off = DVec3::new(random(3 * n), random(3 * n + 1), random(3 * n + 2)) - 0.5;
        middle + cell * DVec3::new(14.0, 12.0, 11.0) + off * 6.0
    };
    let points: Vec<DVec3> = (0..26).map(near).collect();
    grid(size, |p| {
        for vessel in 0..4 {
            let f = f64::from(vessel);
            let axis =
                DVec3::new(10.0 + 12.0 * f + 4.0 * (p.z / 6.0 + f).sin(), 20.0 + 5.0 * f, p.z);
            if p.distance(axis) < 1.6 + 0.8 * f {
                return 27 + vessel as u8;
            }
        }
        if ((p - middle) / DVec3::new(30.0, 26.0, 24.0)).length() > 1.0 {
            return 0;
        }
        let nearest =
            (0..26).min_by(|&a, &b| points[a].distance(p).total_cmp(&points[b].distance(p)));
        nearest.expect("points") as u8 + 1
    })
}

#[test]
fn thirty_organs_are_closed_share_their_faces_and_keep_their_volumes() {
    let grid = thirty();
    let surfaces = surfaces(&grid, REACH);
    assert_eq!(surfaces.len(), 30);
    for (label, soup) in &surfaces {
        assert_eq!(faults(soup), 0, "label {label}");
        assert!(topology::volume(soup) > 0.0, "label {label} faces inwards");
        let places: HashSet<_> = soup.positions.iter().map(|p| p.map(f32::to_bits)).collect();
        assert_eq!(places.len(), soup.positions.len(), "label {label}: vertices that coincide");
    }
    let (dice, error) = figures(&grid, &surfaces);
    println!("Dice {dice:.4}, volume {:.2} %", 100.0 * error);
    assert!(dice >= 0.97 && error < 0.02, "Dice {dice}, volume {error}");
    // But for the voxels that touched along an edge, each label is the same again to the voxel.
    let mut separate = grid.clone();
    composed::separate(&mut separate);
    assert_eq!(figures(&separate, &surfaces).0, 1.0);
    // Two triangles for each pair of neighbouring voxels, in both surfaces.
    for ((a, b), pairs) in borders(&separate) {
        if a > 0 {
            let of = |l: u8| &surfaces.iter().find(|s| s.0 == l).expect("a surface").1;
            assert_eq!(shared(of(a), of(b)), 2 * pairs, "{a} and {b}");
        }
    }
}

#[test]
fn planted_errors_are_caught() {
    let grid = thirty();
    // Smoothing by more than half a voxel moves surfaces over centres of voxels.
    let mut separate = grid.clone();
    composed::separate(&mut separate);
    let (dice, _) = figures(&separate, &surfaces(&separate, 1.0));
    assert!(dice < 1.0, "{dice}");
    // A surface per label, each smoothed by itself, shares next to nothing with its neighbours.
    let alone = |label: u8| {
        let mut one = grid.clone();
        one.voxels.iter_mut().for_each(|v| *v = u8::from(*v == label));
        surfaces(&one, REACH).remove(0).1
    };
    let ((a, b), pairs) =
        borders(&grid).into_iter().filter(|b| b.0.0 > 0).max_by_key(|b| b.1).expect("neighbours");
    assert!(shared(&alone(a), &alone(b)) < pairs / 5);
    // Diagonal contacts that are left are edges of four triangles.
    let mut net = nets::build(&grid, nets::count(&grid).0, |_| ());
    relax::relax(&mut net, &grid.counts(), REACH, |_| ());
    let mut surfaces = Surfaces::new(&grid, &net);
    assert!((1..31).any(|l| faults(&surfaces.of("", |other| other == l)) > 0));
}

#[test]
fn a_sphere_is_round_and_as_large_as_its_voxels() {
    let (middle, radius) = (DVec3::splat(15.3), 11.0);
    let grid = Grid {
        world_from_voxel: DAffine3::IDENTITY,
        ..grid([32; 3], |p| u8::from(p.distance(middle) < radius))
    };
    let rms = |surface: &Soup| {
        let off = |p: &[f32; 3]| (DVec3::from(p.map(f64::from)).distance(middle) - radius).powi(2);
        (surface.positions.iter().map(off).sum::<f64>() / surface.positions.len() as f64).sqrt()
    };
    let [(_, smooth)] = surfaces(&grid, REACH).try_into().expect("one label");
    let [(_, blocks)] = surfaces(&grid, 0.0).try_into().expect("one label");
    // The steps of the voxels alone: a corner is off by up to half a diagonal, 0.87 voxels.
    println!("{:.3} of {:.3} voxels", rms(&smooth), rms(&blocks));
    assert!(rms(&blocks) > 0.4 && rms(&smooth) < 0.13);
    let ball = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    approx::assert_relative_eq!(topology::volume(&smooth), ball, max_relative = 0.01);
    assert_eq!(faults(&smooth), 0);
}

#[test]
fn slabs_stay_plane_and_end_at_the_border() {
    // Two slabs that fill the volume: their common face is a plane of it, and each is closed behind the border.
    let grid = Grid {
        world_from_voxel: DAffine3::IDENTITY,
        ..grid([12, 10, 9], |p| if p.z < 4.0 { 1 } else { 2 })
    };
    let surfaces = surfaces(&grid, REACH);
    let (dice, error) = figures(&grid, &surfaces);
    assert!(dice == 1.0 && error < 0.005, "{dice} {error}");
    assert_eq!(shared(&surfaces[0].1, &surfaces[1].1), 2 * 12 * 10);
    let border = |p: &&[f32; 3]| (3.0..6.0).contains(&p[0]) && (3.0..6.0).contains(&p[1]);
    let between = surfaces[0].1.positions.iter().filter(border).filter(|p| p[2] > 1.5);
    for p in between {
        assert!((p[2] - 3.5).abs() < 0.06, "{p:?}");
    }
}

#[test]
fn what_touches_along_an_edge_is_joined_and_the_rest_is_left_alone() {
    let whole = grid([8; 3], |p| u8::from(p.x < 4.0) + 2 * u8::from(p.y < 3.0));
    let mut same = whole.clone();
    assert_eq!(composed::separate(&mut same), 0);
    assert_eq!(same, whole);
    // Noise of four labels is nothing but such contacts.
    let mut noise =
        grid([20; 3], |p| (random((p.x + 20.0 * (p.y + 20.0 * p.z)) as u32 + 7) * 4.0) as u8);
    assert!(composed::separate(&mut noise) > 100);
    assert_eq!(composed::separate(&mut noise), 0);
    for (label, soup) in surfaces(&noise, REACH) {
        assert_eq!(faults(&soup), 0, "label {label}");
    }
}

#[test]
fn resampling_is_a_vote() {
    let fine = grid([12, 12, 12], |p| if p.x < 6.0 { 3 } else { u8::from(p.y < 6.0) });
    let coarse = fine.resampled(fine.spacing() * 3.0);
    assert_eq!(coarse.size, [4; 3]);
    assert_eq!(
        coarse,
        Grid {
            world_from_voxel: coarse.world_from_voxel,
            ..grid([4; 3], |p| { if p.x < 2.0 { 3 } else { u8::from(p.y < 2.0) } })
        }
    );
    // The same box: its corner stays.
    let corner = |g: &Grid| g.world_from_voxel.transform_point3(DVec3::splat(-0.5));
    assert!(corner(&fine).distance(corner(&coarse)) < 1e-9);
    let far =
        |g: &Grid| g.world_from_voxel.transform_point3(DVec3::from(g.size.map(|n| n as f64 - 0.5)));
    assert!(far(&fine).distance(far(&coarse)) < 1e-9);
    // And back: every voxel is repeated.
    assert_eq!(coarse.resampled(fine.spacing()).voxels, fine.voxels);
}

#[test]
fn holes_are_what_the_outside_does_not_reach() {
    let shell = |p: DVec3| {
        let r = p.distance(DVec3::splat(7.0));
        u8::from((3.0..6.0).contains(&r))
    };
    let mut closed = grid([15; 3], shell);
    let hollow = closed.voxels.iter().filter(|v| **v == 0).count() as u64;
    let inner = grid([15; 3], |p| u8::from(p.distance(DVec3::splat(7.0)) < 3.0)).counts()[1];
    assert_eq!(closed.fill_holes(1), inner);
    assert_eq!(closed.counts()[0], hollow - inner);
    // A channel to the border lets the outside in.
    let mut open =
        grid([15; 3], |p| if p.y == 7.0 && p.z == 7.0 && p.x < 7.0 { 0 } else { shell(p) });
    assert_eq!(open.fill_holes(1), 0);
}
