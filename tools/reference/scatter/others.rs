//! Scatterers of the voxel grid, and point targets.

use glam::DVec3;

use super::{POINT_SHIFT, Tube};
use crate::reference::Accumulator;
use crate::reference::accumulator::NEAREST;
use crate::reference::texture::{factor, voxel};

/// Distance from the axis, in lateral sigmas, within which points are received.
const POINT_CUT: f64 = 4.0;

impl Tube<'_> {
    /// Echoes in voxel mode: one sample of the voxel grid per axial sample.
    pub(super) fn voxels(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let (h, pitch) = (f64::from(frame.cell), f64::from(frame.sample_pitch));
        let (speed, scale) = (f64::from(frame.speed), f64::from(frame.volume_scale));
        let first = out.kappa(self.segment.time).ceil().max(0.0) as i64;
        let end = out.kappa(self.time(self.segment.length));
        for k in (first..i64::from(frame.samples) + 1).take_while(|&k| (k as f64) < end) {
            let x = self.distance(k as f64);
            let p = self.origin + x * self.direction;
            let p = self.field.map_or(p, |f| f.reference(p));
            let cell = (p / h).floor().as_i64vec3();
            let Some(s) = voxel(self.tissue, cell) else {
                continue;
            };
            let row = &self.world.rows[k.min(i64::from(frame.samples) - 1) as usize];
            let sigma = f64::from(row.sigma_elevation);
            let slice = (-self.layer_offset.powi(2) / (2.0 * sigma * sigma)).exp();
            let amplitude = self.weight(x, row)
                * self.absorbed(x)
                * s.amplitude
                * factor(self.tissue, p)
                * slice;
            let time = (k as f64 + s.jitter - 0.5) * pitch / speed;
            out.deposit_nearest(self.scanline, time, amplitude, |k| {
                f64::from(self.world.rows[k].volume_gain) * scale
            });
        }
    }

    /// Echoes of the point targets within the beam and between the ends.
    pub(super) fn points(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let pitch = f64::from(frame.slice_thickness) / f64::from(frame.layers);
        let scale = f64::from(frame.volume_scale);
        for point in self.world.points {
            let [x, y, z, amplitude] = point.map(f64::from);
            let from = DVec3::new(x, y, z) - self.origin;
            let height = from.dot(self.elevation) / pitch - POINT_SHIFT;
            let x = from.dot(self.direction);
            if !(-0.5..0.5).contains(&height) || !(0.0..self.segment.length).contains(&x) {
                continue;
            }
            let row = self.row(x, out);
            let sigma = f64::from(row.sigma_lateral);
            let widened = self.widened(x, row);
            if from.dot(self.lateral).abs() > POINT_CUT * sigma * widened.sqrt() {
                continue;
            }
            let amplitude =
                amplitude * self.weight(x, row) * self.absorbed(x) * self.beam(from, row);
            out.deposit(
                self.scanline,
                self.time(x),
                amplitude,
                0.0,
                |k| f64::from(self.world.rows[k].point_gain) * scale,
                NEAREST,
            );
        }
    }
}
