//! Twin of `mask`: along each scanline, whether a sample lies outside the masking instances, and what
//! the acquired volume shows there.

use glam::DVec3;

use super::geometry::{line, world_line};
use super::world::{World, affine};
use crate::sim::layout::{Frame, Fusion};

/// Crossings of one scanline with the masking instances, by distance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Masking instances around the start.
    pub enclosing: i32,
    /// Distance, mm, and whether the scanline goes in.
    pub along: Vec<(f64, bool)>,
}

impl Crossings {
    /// Mask at distance `t`, mm: 1 outside all instances.
    pub fn mask(&self, t: f64) -> f64 {
        let before = self.along.iter().filter(|c| c.0 <= t);
        let net: i32 = before.map(|c| if c.1 { 1 } else { -1 }).sum();
        if self.enclosing + net > 0 { 0.0 } else { 1.0 }
    }
}

/// Start and unit direction of scanline `l` in the middle of the slice, world space.
fn middle(frame: &Frame, l: u32) -> (DVec3, DVec3) {
    let place = affine(&frame.world_from_probe);
    let mut start = line(frame, l, 0).origin;
    start.y = 0.0;
    (
        place.transform_point3(start),
        world_line(frame, l, 0).direction,
    )
}

/// The crossings of each scanline. What it leaves more often than it enters encloses its start.
pub fn crossings(world: &World) -> Vec<Crossings> {
    let masks = |instance: u32| world.instances[instance as usize].masks != 0;
    (0..world.frame.scanlines)
        .map(|l| {
            let (origin, direction) = middle(world.frame, l);
            let all = world.crossings(origin, direction, [0.0, f64::INFINITY]);
            let along: Vec<_> = all
                .iter()
                .filter(|c| masks(c.instance))
                .map(|c| (c.t, c.entry))
                .collect();
            Crossings {
                enclosing: along.iter().map(|c| if c.1 { -1 } else { 1 }).sum(),
                along,
            }
        })
        .collect()
}

/// Distance of sample `k` along its scanline, mm.
pub fn distance(frame: &Frame, k: u32) -> f64 {
    f64::from(k) * f64::from(frame.sample_pitch)
}

/// Place of sample k of scanline l in the volume, in texels: [L][K].
pub fn places(frame: &Frame, fusion: &Fusion) -> Vec<DVec3> {
    let voxel_from_world = affine(&fusion.voxel_from_world);
    let mut out = Vec::new();
    for l in 0..frame.scanlines {
        let (origin, direction) = middle(frame, l);
        let at = |k| origin + distance(frame, k) * direction;
        out.extend((0..frame.samples).map(|k| voxel_from_world.transform_point3(at(k))));
    }
    out
}

/// Grey level at `voxel`: trilinear between texels (first axis fastest), clamped within half a texel
/// of the outermost, 0 beyond.
pub fn acquired(fusion: &Fusion, texels: &[f32], voxel: DVec3) -> f64 {
    let size = [fusion.size_x, fusion.size_y, fusion.size_z];
    let within = |i: usize| (-0.5..=f64::from(size[i]) - 0.5).contains(&voxel[i]);
    if !(0..3).all(within) {
        return 0.0;
    }
    let mut sum = 0.0;
    for corner in 0..8u32 {
        let (mut index, mut weight, mut stride) = (0, 1.0, 1);
        for axis in 0..3 {
            let last = size[axis] - 1;
            let p = voxel[axis].clamp(0.0, f64::from(last));
            let far = corner >> axis & 1;
            weight *= if far == 1 { p.fract() } else { 1.0 - p.fract() };
            index += stride * (p as u32 + far).min(last) as usize;
            stride *= size[axis] as usize;
        }
        if weight > 0.0 {
            sum += weight * f64::from(texels[index]);
        }
    }
    (sum * f64::from(fusion.slope) + f64::from(fusion.intercept)).clamp(0.0, 1.0)
}
