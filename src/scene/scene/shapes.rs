//! Closed shapes with exact normals, outward, centred at the origin unless stated; mm.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::DVec3;

use super::Mesh;

/// Most subdivisions of a sphere: 20 * 4^8 = 1.3 million triangles.
pub const MAX_SUBDIVISIONS: u32 = 8;

/// Sphere: an icosahedron whose edges are halved `subdivisions` times, 20 * 4^n triangles with
/// vertices on the sphere. At 5 an 8 mm sphere is flat to 2 um.
pub fn sphere(radius: f64, subdivisions: u32) -> Mesh {
    ellipsoid([radius; 3], subdivisions)
}

/// Ellipsoid with the given semi-axes, triangulated as [`sphere`] and stretched.
pub fn ellipsoid(radii: [f64; 3], subdivisions: u32) -> Mesh {
    let radii = DVec3::from(radii);
    let (directions, triangles) = icosphere(subdivisions.min(MAX_SUBDIVISIONS));
    Mesh {
        name: "ellipsoid".to_owned(),
        positions: directions.iter().map(|&d| single(d * radii)).collect(),
        // Gradient of x^2/a^2 + y^2/b^2 + z^2/c^2 at the point a d.
        normals: directions.iter().map(|&d| single((d / radii).normalize())).collect(),
        triangles,
    }
}

/// Cylinder along z with flat ends. Rings along the side keep its triangles well shaped.
pub fn cylinder(radius: f64, length: f64, segments: u32) -> Mesh {
    let n = segments.max(3);
    let mut mesh = Mesh { name: "cylinder".to_owned(), ..Mesh::default() };
    let spoke = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i % n) / f64::from(n)).sin_cos();
        DVec3::new(cos, sin, 0.0)
    };
    let edge = TAU * radius / f64::from(n);
    // At most as many rings as spokes: a long thin wire must not become millions of triangles.
    let rings = ((length / edge).round() as u32).clamp(1, n);
    for ring in 0..=rings {
        let z = length * (f64::from(ring) / f64::from(rings) - 0.5);
        for i in 0..n {
            push(&mut mesh, spoke(i) * radius + DVec3::Z * z, spoke(i));
        }
    }
    for ring in 0..rings {
        for i in 0..n {
            let (a, b) = (ring * n + i, ring * n + (i + 1) % n);
            mesh.triangles.extend([[a, b, b + n], [a, b + n, a + n]]);
        }
    }
    for side in [-1.0, 1.0] {
        let normal = DVec3::Z * side;
        let end = normal * (length / 2.0);
        let hub = push(&mut mesh, end, normal);
        for i in 0..n {
            push(&mut mesh, end + spoke(i) * radius, normal);
        }
        for i in 0..n {
            let (a, b) = (hub + 1 + i, hub + 1 + (i + 1) % n);
            mesh.triangles.push(if side > 0.0 { [hub, a, b] } else { [hub, b, a] });
        }
    }
    mesh
}

/// Box with the given edge lengths.
pub fn cuboid(size: [f64; 3]) -> Mesh {
    let half = DVec3::from(size) / 2.0;
    let mut mesh = Mesh { name: "box".to_owned(), ..Mesh::default() };
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut normal = DVec3::ZERO;
            normal[axis] = side;
            let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
            u[(axis + 1) % 3] = half[(axis + 1) % 3] * side;
            v[(axis + 2) % 3] = half[(axis + 2) % 3];
            let centre = normal * half[axis];
            let [a, b, c, d] =
                [-u - v, u - v, u + v, v - u].map(|p| push(&mut mesh, centre + p, normal));
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Slab of `size` around the z axis from z = 0, its front, to z = `thickness`.
pub fn plane(size: [f64; 2], thickness: f64) -> Mesh {
    let mut mesh = cuboid([size[0], size[1], thickness]);
    "plane".clone_into(&mut mesh.name);
    for p in &mut mesh.positions {
        p[2] += (thickness / 2.0) as f32;
    }
    mesh
}

/// Rings of a round end of a tube, and its tip.
pub const END_RINGS: u32 = 6;

/// Tube around `points`, at least two, all different, with a radius at each, and round ends. Rings of `segments` vertices.
pub fn tube(points: &[DVec3], radii: &[f64], segments: u32) -> Mesh {
    let n = segments.max(3);
    let last = points.len() - 1;
    let part = |i: usize| (points[i + 1] - points[i]).normalize_or_zero();
    let along = |i: usize| {
        let (before, behind) = (part(i.saturating_sub(1)), part(i.min(last - 1)));
        (before + behind).try_normalize().unwrap_or(behind)
    };
    // Centre, direction, radius, and the slope of the surface: of the normal against the ring.
    let mut rings: Vec<(DVec3, DVec3, f64, f64)> = Vec::new();
    let end = |i: usize, side: f64| {
        move |k: u32| {
            let (sin, cos) = (TAU / 4.0 * f64::from(k) / f64::from(END_RINGS)).sin_cos();
            let direction = along(i);
            (points[i] + direction * (side * radii[i] * cos), direction, radii[i] * sin, side * cos)
        }
    };
    rings.extend((1..END_RINGS).map(end(0, -1.0)));
    for i in 0..=last {
        let (before, behind) = (i.saturating_sub(1), (i + 1).min(last));
        let way = points[before].distance(points[i]) + points[i].distance(points[behind]);
        let slope = (radii[behind] - radii[before]) / way;
        rings.push((points[i], along(i), radii[i], -slope / slope.hypot(1.0)));
    }
    rings.extend((1..END_RINGS).rev().map(end(last, 1.0)));
    let mut mesh = Mesh { name: "tube".to_owned(), ..Mesh::default() };
    let tips = [0, last].map(|i| {
        let out = along(i) * if i == 0 { -1.0 } else { 1.0 };
        push(&mut mesh, points[i] + out * radii[i], out)
    });
    // The spokes turn with the line and no further.
    let mut spoke = along(0).any_orthonormal_vector();
    for &(centre, direction, radius, slope) in &rings {
        spoke = (spoke - direction * spoke.dot(direction)).normalize();
        let other = direction.cross(spoke);
        for k in 0..n {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(n)).sin_cos();
            let out = spoke * cos + other * sin;
            let normal = out * (1.0 - slope * slope).max(0.0).sqrt() + direction * slope;
            push(&mut mesh, centre + out * radius, normal);
        }
    }
    let at = |ring: u32, k: u32| 2 + ring * n + k % n;
    let outer = rings.len() as u32 - 1;
    for k in 0..n {
        mesh.triangles.push([tips[0], at(0, k + 1), at(0, k)]);
        mesh.triangles.push([tips[1], at(outer, k), at(outer, k + 1)]);
        for ring in 0..outer {
            let [a, b, c, d] = [at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

fn push(mesh: &mut Mesh, position: DVec3, normal: DVec3) -> u32 {
    mesh.positions.push(single(position));
    mesh.normals.push(single(normal));
    (mesh.positions.len() - 1) as u32
}

fn icosphere(subdivisions: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        points.push(DVec3::new(a, b, 0.0).normalize());
    }
    for k in 0..4 {
        let p = points[k];
        points.push(DVec3::new(0.0, p.x, p.y));
    }
    for k in 0..4 {
        let p = points[k];
        points.push(DVec3::new(p.y, 0.0, p.x));
    }
    let mut triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1u32],
    ];
    for _ in 0..subdivisions {
        let mut middle: HashMap<[u32; 2], u32> = HashMap::new();
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for [a, b, c] in triangles {
            let mut half = |a: u32, b: u32| {
                *middle.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    points.push((points[a as usize] + points[b as usize]).normalize());
                    (points.len() - 1) as u32
                })
            };
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::super::mesh::Soup;
    use super::super::topology;
    use super::*;
    use std::f64::consts::PI;
    use std::path::Path;

    fn volume(mesh: &Mesh) -> f64 {
        let soup = Soup {
            positions: mesh.positions.clone(),
            triangles: mesh.triangles.clone(),
            ..Soup::default()
        };
        topology::volume(&soup)
    }

    /// Asserts that a mesh is closed, wound consistently, and has normals on the outer side of every face.
    fn is_sound(mesh: &Mesh) {
        let mut places: Vec<_> = mesh.positions.clone();
        places.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
        places.dedup();
        let index = |p| places.binary_search_by(|q| q.partial_cmp(p).expect("finite"));
        let mut soup = Soup {
            triangles: mesh
                .triangles
                .iter()
                .map(|t| t.map(|i| index(&mesh.positions[i as usize]).expect("listed") as u32))
                .collect(),
            positions: places.clone(),
            ..Soup::default()
        };
        assert!(topology::clean(Path::new("x"), &mut soup, &[]).is_empty(), "{}", mesh.name);
        assert!(topology::orient(Path::new("x"), &mut soup).is_empty(), "{}", mesh.name);
        assert!(topology::boundary_loops(&soup).is_empty(), "{}", mesh.name);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| glam::Vec3::from(mesh.positions[i as usize]));
            for i in t {
                let n = glam::Vec3::from(mesh.normals[*i as usize]);
                assert!((b - a).cross(c - a).dot(n) > 0.0, "{}", mesh.name);
                assert!((n.length() - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn shapes_are_closed_and_outward() {
        is_sound(&sphere(8.0, 3));
        is_sound(&ellipsoid([5.0, 20.0, 80.0], 3));
        is_sound(&cylinder(3.0, 40.0, 24));
        is_sound(&cuboid([1.0, 2.0, 3.0]));
        is_sound(&plane([100.0, 50.0], 2.0));
        let bend = [[0.0, 0.0, 0.0], [0.0, 0.0, 6.0], [2.0, 0.0, 12.0], [6.0, 1.0, 18.0]];
        is_sound(&tube(&bend.map(DVec3::from), &[3.0, 3.5, 2.0, 2.5], 24));
    }

    /// A tube's volume is that of a cylinder and two half balls, less what its polygons leave out.
    #[test]
    fn a_tube_has_round_ends() {
        let made = volume(&tube(&[DVec3::ZERO, DVec3::new(0.0, 12.0, 16.0)], &[3.0; 2], 96));
        let exact = PI * 9.0 * 20.0 + 4.0 / 3.0 * PI * 27.0;
        assert!(made < exact && made > 0.99 * exact, "{made} {exact}");
        // The planted error: ends that are flat.
        assert!(PI * 9.0 * 20.0 < 0.9 * made);
    }

    #[test]
    fn volumes_approach_the_closed_forms() {
        // An inscribed polyhedron is smaller by O(edge^2): a quarter per subdivision.
        let exact = 4.0 / 3.0 * PI * 512.0;
        let error = |n| (exact - volume(&sphere(8.0, n))) / exact;
        assert!(error(5) > 0.0 && error(5) < 1e-3, "{}", error(5));
        assert!((error(4) / error(5) - 4.0).abs() < 0.05, "{}", error(4) / error(5));
        // Area of the regular polygon times length; f32 positions.
        let polygon = 0.5 * 24.0 * 9.0 * (TAU / 24.0).sin();
        approx::assert_relative_eq!(
            volume(&cylinder(3.0, 40.0, 24)),
            polygon * 40.0,
            max_relative = 1e-6
        );
        approx::assert_relative_eq!(volume(&cuboid([1.0, 2.0, 3.0])), 6.0, max_relative = 1e-6);
        approx::assert_relative_eq!(
            volume(&ellipsoid([2.0, 3.0, 4.0], 4)) / volume(&sphere(1.0, 4)),
            24.0,
            max_relative = 1e-6
        );
    }
}
