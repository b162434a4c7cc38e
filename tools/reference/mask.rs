//! Twin of `mask`: along each scanline the mask, 1 outside the masking instances, and the grey level
//! of the acquired volume.

use glam::DVec3;

use super::geometry::{line, world_line};
use super::world::{Crossing, World, affine};
use insonify::sim::layout::{Frame, Fusion, MASK_SPEED_PROBE};

/// Crossings of one scanline with the masking instances, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Number of masking instances around the start.
    pub enclosing: i32,
    /// Crossings along the scanline.
    pub along: Vec<Met>,
    /// Distance per depth before the first crossing.
    rate: f64,
}

/// A crossing. Its depth, mm at the probe's speed, is that of an echo from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// Distance, mm.
    pub distance: f64,
    /// Depth, mm.
    pub depth: f64,
    /// True if the scanline enters the instance.
    pub entry: bool,
    /// Distance per depth behind it.
    rate: f64,
}

impl Crossings {
    /// Mask at a depth, mm: 1 outside all instances.
    pub fn mask(&self, depth: f64) -> f64 {
        let before = self.along.iter().filter(|met| met.depth <= depth);
        let net: i32 = before.map(|met| if met.entry { 1 } else { -1 }).sum();
        if self.enclosing + net > 0 { 0.0 } else { 1.0 }
    }

    /// Distance along the scanline, mm, of a depth.
    fn distance(&self, depth: f64) -> f64 {
        match self.along.iter().rfind(|met| met.depth <= depth) {
            Some(met) => met.distance + met.rate * (depth - met.depth),
            None => self.rate * depth,
        }
    }
}

/// Start and unit direction of scanline `l` in the middle of the slice, world space.
pub(super) fn middle(frame: &Frame, l: u32) -> (DVec3, DVec3) {
    let place = affine(&frame.world_from_probe);
    let mut start = line(frame, l, 0).origin;
    start.y = 0.0;
    (place.transform_point3(start), world_line(frame, l, 0).direction)
}

/// The crossings of each scanline. Instances that it leaves more often than it enters enclose its start.
pub fn crossings(world: &World, fusion: &Fusion) -> Vec<Crossings> {
    let masks = |instance: u32| world.instances[instance as usize].masks != 0;
    (0..world.frame.scanlines)
        .map(|l| {
            let (origin, direction) = middle(world.frame, l);
            let mut all = world.crossings(origin, direction, [0.0, f64::INFINITY]);
            all.retain(|c| masks(c.instance));
            let rate = |passed: usize| match fusion.mask_speed {
                MASK_SPEED_PROBE => 1.0,
                _ => rate_behind(world, &all, passed),
            };
            let (mut distance, mut depth) = (0.0, 0.0);
            let along = all.iter().enumerate().map(|(i, crossing)| {
                depth += (crossing.t - distance) / rate(i);
                distance = crossing.t;
                Met { distance, depth, entry: crossing.entry, rate: rate(i + 1) }
            });
            Crossings {
                along: along.collect(),
                enclosing: -all.iter().map(Crossing::sign).sum::<i32>(),
                rate: rate(0),
            }
        })
        .collect()
}

/// Distance per depth behind the first `passed` crossings: the speed of the masking instance there over the probe's.
fn rate_behind(world: &World, all: &[Crossing], passed: usize) -> f64 {
    world.behind(all, passed).map_or(1.0, |instance| {
        let tissue = world.instances[instance as usize].tissue;
        f64::from(world.tissues[tissue as usize].speed) / f64::from(world.frame.speed)
    })
}

/// Depth of sample `k`, mm at the probe's speed.
pub fn depth(frame: &Frame, k: u32) -> f64 {
    f64::from(k) * f64::from(frame.sample_pitch)
}

/// Place of sample k of scanline l in the volume, in texels: [L][K].
pub fn places(frame: &Frame, fusion: &Fusion, lines: &[Crossings]) -> Vec<DVec3> {
    let voxel_from_world = affine(&fusion.voxel_from_world);
    let mut out = Vec::new();
    for (l, line) in (0..frame.scanlines).zip(lines) {
        let (origin, direction) = middle(frame, l);
        let at = |k| origin + line.distance(depth(frame, k)) * direction;
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
