//! Wavy surfaces, and rays that meet them.

use std::sync::{Arc, Weak};

use glam::DVec3;
use insonify::gpu::{Binding, Buffer, BufferKind, Commands, Device, GpuError, Kernel, Tlas};
use insonify::scene::triangle;

use super::words;

/// Number of rays of a trace.
pub const RAYS: usize = 400;

/// Positions, mm.
pub type Vertices = Vec<[f32; 3]>;

/// A wavy surface of `2 n^2` triangles over the square of 20 mm about the z axis.
pub fn sheet(n: u32, phase: f32) -> Vertices {
    let along = |i: u32| 20.0 * i as f32 / n as f32 - 10.0;
    let all = (0..=n).flat_map(|i| (0..=n).map(move |j| (along(i), along(j))));
    all.map(|(x, y)| [x, y, 50.0 + 6.0 * (0.5 * x + phase).sin() * (0.3 * y).cos()]).collect()
}

/// Its triangles, in absolute indices from `base` on.
pub fn grid(n: u32, base: u32) -> Vec<[u32; 3]> {
    let vertex = |i: u32, j: u32| base + i * (n + 1) + j;
    let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    all.flat_map(|(i, j)| {
        let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let [a, b, c, d] = corners.map(|(i, j)| vertex(i, j));
        [[a, b, c], [a, c, d]]
    })
    .collect()
}

/// Rays along z, spread evenly below the wavy surface.
pub struct Rays {
    pub device: Weak<Device>,
    kernel: Kernel,
    origins: Buffer,
    places: Vec<[f32; 2]>,
}

impl Rays {
    pub fn new(device: &Arc<Device>) -> Self {
        let spirv = words(include_bytes!("nearest.spv"));
        let place = |i: usize| {
            // Multiples of the golden ratio and of the root of two spread evenly.
            let (u, v) = (i as f32 * 0.618_034, i as f32 * 0.414_213_56);
            [18.0 * u.fract() - 9.0, 18.0 * v.fract() - 9.0]
        };
        let places: Vec<_> = (0..RAYS).map(place).collect();
        let values: Vec<[f32; 4]> = places.iter().map(|p| [p[0], p[1], 0.0, 0.0]).collect();
        let origins = storage(device, "origins", bytemuck::cast_slice(&values));
        Self {
            device: Arc::downgrade(device),
            kernel: Kernel::new(device, "nearest", &spirv, &[]).unwrap(),
            origins,
            places,
        }
    }

    pub fn hits(&self, device: &Arc<Device>) -> Buffer {
        let size = 16 * RAYS as u64;
        device.buffer("hits", size, BufferKind::Storage).unwrap()
    }

    pub fn record(
        &self,
        commands: &mut Commands<'_>,
        tlas: &Tlas,
        hits: &Buffer,
    ) -> Result<(), GpuError> {
        let bindings = [Binding::Tlas(tlas), Binding::Buffer(&self.origins), Binding::Buffer(hits)];
        let count = RAYS as u32;
        commands.dispatch(&self.kernel, [count, 1, 1], bytemuck::bytes_of(&count), &bindings)
    }

    /// Rays whose hit differs from brute force's: distance to 1e-4 mm (50 mm round at 4e-6, over the cosine of
    /// slopes up to 3), on that triangle or one that shares the edge at that place.
    pub fn wrong(
        &self,
        found: &[[f32; 4]],
        vertices: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> usize {
        let wrong = |(place, hit): (&[f32; 2], &[f32; 4])| {
            let origin = DVec3::new(place[0].into(), place[1].into(), 0.0);
            let all = triangles.iter().enumerate().filter_map(|(i, t)| {
                let corners = t.map(|v| DVec3::from(vertices[v as usize].map(f64::from)));
                triangle::crossing(corners, origin, DVec3::Z).map(|[t, ..]| (t, i))
            });
            let expected: Vec<_> = all.collect();
            let nearest = expected.iter().map(|e| e.0).fold(f64::INFINITY, f64::min);
            (f64::from(hit[0]) - nearest).abs() > 1e-4
                || !expected.iter().any(|e| e.1 == hit[2] as usize)
        };
        self.places.iter().zip(found).filter(|&p| wrong(p)).count()
    }
}

/// A storage buffer with the given content.
pub fn storage(device: &Arc<Device>, name: &str, bytes: &[u8]) -> Buffer {
    let size = bytes.len() as u64;
    let buffer = device.buffer(name, size, BufferKind::Storage).unwrap();
    device.upload(&buffer, bytes).unwrap();
    buffer
}
