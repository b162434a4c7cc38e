//! Comparison of a loaded surface with the places of its vertices, one by one.

use insonify::scene::Mesh;

/// Half a unit in the last place of a single-precision number, relative to it.
pub const ROUNDING: f64 = 1.0 / (1u64 << 24) as f64;

/// The stored corner of each loaded corner, and the largest distance so far.
pub struct Corners {
    /// Stored vertices of the corners of each loaded triangle.
    stored: Vec<[usize; 3]>,
}

impl Corners {
    /// Triangles keep their order; the program turns some around, and appends those of caps. The turned ones are found
    /// in one shape, and must be the same in all.
    pub fn new(mesh: &Mesh, triangles: &[[usize; 3]], expected: &[[f64; 3]]) -> Self {
        assert!(mesh.triangles.len() >= triangles.len());
        let stored = triangles.iter().zip(&mesh.triangles).map(|(&[a, b, c], loaded)| {
            let off = |corners: [usize; 3]| -> f64 {
                let pairs = corners.iter().zip(loaded);
                pairs
                    .map(|(&e, &l)| distance(expected[e], mesh.positions[l as usize]))
                    .fold(0.0, f64::max)
            };
            match off([a, b, c]) <= off([a, c, b]) {
                true => [a, b, c],
                false => [a, c, b],
            }
        });
        Self { stored: stored.collect() }
    }

    /// Largest distance of a vertex from its place.
    pub fn off(&self, mesh: &Mesh, expected: &[[f64; 3]]) -> f64 {
        let pairs = self.stored.iter().zip(&mesh.triangles);
        let corners = pairs.flat_map(|(stored, loaded)| stored.iter().zip(loaded));
        corners
            .map(|(&e, &l)| distance(expected[e], mesh.positions[l as usize]))
            .fold(0.0, f64::max)
    }
}

fn distance(expected: [f64; 3], found: [f32; 3]) -> f64 {
    let square = |axis: usize| (expected[axis] - f64::from(found[axis])).powi(2);
    let sum: f64 = (0..3).map(square).sum();
    match sum.is_nan() {
        true => f64::INFINITY,
        false => sum.sqrt(),
    }
}

/// Largest coordinate.
pub fn reach(points: &[[f64; 3]]) -> f64 {
    points.iter().flatten().fold(0.0, |m, v| m.max(v.abs()))
}
