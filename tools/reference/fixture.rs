//! Worlds of boxes and spheres for the twins' own tests: one linear probe looking along z from 0.

use glam::{DAffine3, DVec3};

pub use super::Owned as Fixture;
use insonify::sim::layout::{ALL_LEVELS, Frame, Instance, NONE, Row, Rows, Surface, Tissue};
use insonify::sim::tables::beam_shape;

pub fn rows_of(m: &DAffine3) -> Rows {
    std::array::from_fn(|i| {
        let r = m.matrix3.row(i);
        [r.x, r.y, r.z, m.translation[i]].map(|x| x as f32)
    })
}

/// A tissue with scatterers of amplitude sigma 1.
pub fn tissue(speed: f32, impedance: f32, absorption: f32) -> Tissue {
    Tissue {
        speed,
        impedance,
        absorption,
        presence: 1.0,
        sigma: 1.0,
        density: 1.0,
        amplitude: 1.0,
        texture_length: 1.0,
        seed: 77,
        ..Tissue::default()
    }
}

impl Fixture {
    /// A world without meshes. The background is the first of `tissues`; surface 0 is a thin perfect mirror's lobe.
    pub fn new(tissues: Vec<Tissue>) -> Self {
        let identity = rows_of(&DAffine3::IDENTITY);
        let samples = 400;
        let row = Row {
            shape: beam_shape(0.8, 0.6, 1.0, ALL_LEVELS.into()),
            sigma_lateral: 0.4,
            sigma_elevation: 0.6,
            aperture: 0.1,
            transmit_sine: 0.1,
            variances: 0.64,
            volume_gain: 1.0,
            point_gain: 1.0,
            surface_gain: 1.0,
            incoherent_gain: 1.0,
            compensation: 1.0,
            black: ALL_LEVELS,
            ..Row::default()
        };
        Self {
            frame: Frame {
                couplant: NONE,
                world_from_probe: identity,
                probe_from_world: identity,
                kind: 1,
                scanlines: 1,
                layers: 1,
                samples,
                depth: 100.0,
                width: 10.0,
                slice_thickness: 6.0,
                speed: 1.5,
                sample_pitch: 0.25,
                frequency: 3.0,
                paths: 1,
                max_interactions: 10,
                max_reflections: 3,
                seed: 1,
                cell: 0.25,
                elevation_reach: 2.4,
                elevation_cut: 3.0,
                surface_scale: 1.0,
                volume_scale: 1.0,
                segment_capacity: 1000,
                face_height: 6.0,
                piece: 32,
                ..Frame::default()
            },
            rows: vec![row; samples as usize],
            tissues,
            surfaces: vec![Surface {
                roughness: 1e9,
                specularity: 1.0,
                gain: 1.0,
                coherence: 1.0,
                ..Surface::default()
            }],
            ..Self::default()
        }
    }

    /// Places triangles given as flat corner triples, outward, with a normal per corner.
    fn place_flat(&mut self, corners: &[[DVec3; 2]], tissue: u32, priority: i32, at: &DAffine3) {
        let positions: Vec<_> = corners.iter().map(|c| c[0].as_vec3().to_array()).collect();
        let normals: Vec<_> = corners.iter().map(|c| c[1].as_vec3().to_array()).collect();
        let indices: Vec<u32> = (0..corners.len() as u32).collect();
        let (triangles, _) = indices.as_chunks::<3>();
        self.place(
            &positions,
            &normals,
            triangles,
            Instance {
                world_from_object: rows_of(at),
                object_from_world: rows_of(&at.inverse()),
                texture_from_world: rows_of(&at.inverse()),
                tissue,
                priority,
                field: NONE,
                ..Instance::default()
            },
        );
    }

    /// An axis-aligned box.
    pub fn block(&mut self, low: [f64; 3], high: [f64; 3], tissue: u32, priority: i32) {
        self.block_at(low, high, tissue, priority, &DAffine3::IDENTITY);
    }

    /// A placed box.
    pub fn block_at(
        &mut self,
        low: [f64; 3],
        high: [f64; 3],
        tissue: u32,
        priority: i32,
        at: &DAffine3,
    ) {
        let mut corners = Vec::new();
        for axis in 0..3 {
            for side in [low, high] {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let outward = side == high;
                let mut n = DVec3::ZERO;
                n[axis] = if outward { 1.0 } else { -1.0 };
                // Off-centre fans: no test ray along an axis of symmetry runs along an edge.
                let at = |a: f64, b: f64| {
                    let mut p = DVec3::ZERO;
                    p[axis] = side[axis];
                    p[u] = low[u] + a * (high[u] - low[u]);
                    p[v] = low[v] + b * (high[v] - low[v]);
                    [p, n]
                };
                let middle = at(0.37, 0.41);
                let ring = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
                for i in 0..4 {
                    let (a, b) = (ring[i], ring[(i + 1) % 4]);
                    corners.extend(if outward { [middle, a, b] } else { [middle, b, a] });
                }
            }
        }
        self.place_flat(&corners, tissue, priority, at);
    }

    /// A sphere of 2 n^2 triangles with exact normals.
    pub fn sphere(&mut self, centre: DVec3, radius: f64, n: u32, tissue: u32, priority: i32) {
        let point = |i: u32, j: u32| {
            let polar = std::f64::consts::PI * f64::from(i) / f64::from(n);
            let azimuth = std::f64::consts::TAU * f64::from(j) / f64::from(n) + 0.1;
            let (s, c) = azimuth.sin_cos();
            // Exactly zero at both poles, where the triangles must close.
            let sin = if i == 0 || i == n { 0.0 } else { polar.sin() };
            let normal = DVec3::new(sin * c, polar.cos(), sin * s);
            [centre + radius * normal, normal]
        };
        let mut corners = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let [a, b, c, d] =
                    [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
                corners.extend([a, c, b, a, d, c]);
            }
        }
        self.place_flat(&corners, tissue, priority, &DAffine3::IDENTITY);
    }
}
