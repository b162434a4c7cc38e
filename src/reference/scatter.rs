//! Twin of `scatter`: echoes of scatterers and point targets along the segments.

use glam::{DAffine3, DVec3, I64Vec3};

use super::accumulator::NEAREST;
use super::field::Field;
use super::geometry::{beam_weight, probe, world_line};
use super::texture::{factor, scatterer};
use super::world::World;
use super::{Accumulator, Segment};
use crate::sim::layout::{FLAG_VOXEL, Row, Tissue};

/// Length of the pieces, mm, whose bounding boxes are searched for lattice cells.
const PIECE: f64 = 2.0;
/// Points are seen this many lateral sigmas off the axis.
const POINT_CUT: f64 = 4.0;

/// Layers meet this part of their pitch off the round numbers at which points lie: rounding must not
/// give one to two layers, or to none.
const POINT_SHIFT: f64 = 0.012_34;

/// A segment seen from one space: world or its texture's.
struct Tube<'a> {
    world: &'a World<'a>,
    segment: &'a Segment,
    tissue: &'a Tissue,
    origin: DVec3,
    direction: DVec3,
    lateral: DVec3,
    elevation: DVec3,
    scanline: u32,
    layer_offset: f64,
    /// Distance from the geometric scanline, mm: at the start and per mm.
    off: [f64; 2],
    /// How the tissue is displaced in the tube's space.
    field: Option<Deformed<'a>>,
}

/// A field and its bounds.
#[derive(Clone, Copy)]
struct Deformed<'a> {
    field: Field<'a>,
    /// mm.
    reach: f64,
    steepness: f64,
}

impl Deformed<'_> {
    /// A middle and a distance of all points of the reference shape from which tissue can be within
    /// `radius` of `p`, relative to where it is: v differs by no more than `steepness` times the
    /// distance there, which is no more than radius / (1 - steepness).
    fn back(&self, p: DVec3, radius: f64) -> (DVec3, f64) {
        if self.steepness < 1.0 {
            let spread = self.steepness / (1.0 - self.steepness) * radius;
            (self.field.reference(p) - p, spread)
        } else {
            (DVec3::ZERO, self.reach)
        }
    }
}

/// Echoes of all segments, in units of 1 / volume_scale.
pub fn scatter(world: &World, segments: &[Segment]) -> Accumulator {
    let mut out = Accumulator::new(world.frame);
    let deformed = |instance: u32| {
        world.field(instance).map(|field| Deformed {
            field,
            reach: field.reach(),
            steepness: field.steepness(),
        })
    };
    let fields: Vec<_> = (0..world.instances.len() as u32).map(deformed).collect();
    for segment in segments {
        let finite = [segment.length, segment.time].iter().all(|x| x.is_finite());
        if !(finite && segment.origin.is_finite() && segment.direction.is_finite()) {
            continue;
        }
        let field = fields.get(segment.instance as usize).copied().flatten();
        let tube = Tube::new(world, segment, world.texture(segment.instance), field);
        if tube.tissue.presence > 0.0 {
            if world.frame.flags & FLAG_VOXEL == 0 {
                tube.lattice(&mut out);
            } else {
                tube.voxels(&mut out);
            }
        }
        Tube::new(world, segment, DAffine3::IDENTITY, None).points(&mut out);
    }
    out
}

impl<'a> Tube<'a> {
    fn new(
        world: &'a World,
        segment: &'a Segment,
        space: DAffine3,
        field: Option<Deformed<'a>>,
    ) -> Self {
        let elevation = segment.handedness * segment.direction.cross(segment.lateral);
        let (l, layer) = (
            segment.line % world.frame.scanlines,
            segment.line / world.frame.scanlines,
        );
        let line = world_line(world.frame, l, layer);
        Self {
            world,
            segment,
            tissue: &world.tissues[segment.tissue as usize],
            origin: space.transform_point3(segment.origin),
            direction: space.transform_vector3(segment.direction),
            lateral: space.transform_vector3(segment.lateral),
            elevation: space.transform_vector3(elevation),
            scanline: l,
            layer_offset: probe(world.frame).elevation(layer),
            off: [
                (segment.origin - line.origin).dot(line.lateral),
                segment.direction.dot(line.lateral),
            ],
            field,
        }
    }

    /// One-way time at distance `x`, us.
    fn time(&self, x: f64) -> f64 {
        self.segment.time + x / f64::from(self.tissue.speed)
    }

    fn row(&self, time: f64, out: &Accumulator) -> &'a Row {
        &self.world.rows[out.sample(time)]
    }

    /// Weight at distance `x`: absorbed, less off the scanline, and averaged down where a rough
    /// reflection has spread the path over many resolution cells.
    fn weight(&self, x: f64, row: &Row) -> f64 {
        let [a, b, c] = self.segment.spread;
        let variance = a + 2.0 * b * x + c * x * x;
        let wider = |sigma: f32| (1.0 + variance / f64::from(sigma).powi(2)).sqrt();
        let cells = wider(row.sigma_lateral) * wider(row.sigma_elevation);
        let averaged = (self.segment.share / cells).sqrt().min(1.0);
        self.segment.weight
            * (-f64::from(self.tissue.absorption) * x).exp()
            * averaged
            * beam_weight(self.world.frame, self.off[0] + x * self.off[1])
    }

    /// Echo of something of `amplitude` at `p`, seen at distances up to `cut` sigmas and `reach` mm.
    fn echo(
        &self,
        p: DVec3,
        amplitude: f64,
        [cut, reach]: [f64; 2],
        gain: impl Fn(&Row) -> f32,
        out: &mut Accumulator,
    ) {
        let from = p - self.origin;
        let x = from.dot(self.direction);
        let (across, up) = (from.dot(self.lateral), from.dot(self.elevation));
        let time = self.time(x);
        let row = self.row(time, out);
        let [lateral, elevation] = [row.sigma_lateral, row.sigma_elevation].map(f64::from);
        let outside =
            x < 0.0 || x >= self.segment.length || across.abs() > cut * lateral || up.abs() > reach;
        if outside {
            return;
        }
        let height = self.layer_offset + up;
        let beam = (-across * across / (2.0 * lateral * lateral)
            - height * height / (2.0 * elevation * elevation))
            .exp();
        let scale = f64::from(self.world.frame.volume_scale);
        let amplitude = self.weight(x, row) * amplitude * beam;
        out.deposit(
            self.scanline,
            time,
            amplitude,
            0.0,
            |k| f64::from(gain(&self.world.rows[k])) * scale,
            NEAREST,
        );
    }

    /// Every lattice cell that touches the tube. Pieces own disjoint ranges of x, so that no
    /// scatterer is met twice. Of deformed tissue, every cell from which the field can reach it.
    fn lattice(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let h = f64::from(frame.cell);
        let reach = f64::from(frame.elevation_reach);
        let cut = f64::from(frame.lateral_cut);
        let widest = self.world.rows.iter().map(|r| r.sigma_lateral);
        let half = [cut * f64::from(widest.fold(0.0, f32::max)), reach];
        let length = (self.field).map_or(PIECE, |f| (f.field.spacing() / 4.0).max(4.0 * h));
        let pieces = (self.segment.length / length).ceil() as u32;
        for piece in 0..pieces {
            let x0 = f64::from(piece) * length;
            let x1 = (x0 + length).min(self.segment.length);
            let (low, high) = self.bounds([x0, x1], half);
            let middle = self.origin + (x0 + x1) / 2.0 * self.direction;
            let radius = DVec3::new((x1 - x0) / 2.0, half[0], half[1]).length();
            let (back, spread) =
                (self.field).map_or((DVec3::ZERO, 0.0), |f| f.back(middle, radius));
            let (low, high) = (
                ((low + back - spread) / h).floor().as_i64vec3(),
                ((high + back + spread) / h).floor().as_i64vec3(),
            );
            let of_piece = (self.field).map(|f| factor(self.tissue, f.field.reference(middle)));
            for k in low.z..=high.z {
                for j in low.y..=high.y {
                    for i in low.x..=high.x {
                        let cell = I64Vec3::new(i, j, k);
                        let Some(s) = scatterer(self.tissue, cell) else {
                            continue;
                        };
                        let rest = (cell.as_dvec3() + s.offset) * h;
                        let moved = |f: Deformed| rest + f.field.displacement(rest);
                        let p = self.field.map_or(rest, moved);
                        let x = (p - self.origin).dot(self.direction);
                        if (x0..x1).contains(&x) {
                            let texture = of_piece
                                .unwrap_or_else(|| factor(self.tissue, self.on_plane(cell, h)));
                            let amplitude = s.amplitude * texture;
                            self.echo(p, amplitude, [cut, reach], |r| r.volume_gain, out);
                        }
                    }
                }
            }
        }
    }

    /// Axis-aligned bounds of the stretch from x0 to x1 with half widths lateral and elevational.
    fn bounds(&self, [x0, x1]: [f64; 2], half: [f64; 2]) -> (DVec3, DVec3) {
        let [a, b] = [x0, x1].map(|x| self.origin + x * self.direction);
        let around = half[0] * self.lateral.abs() + half[1] * self.elevation.abs();
        (a.min(b) - around, a.max(b) + around)
    }

    /// Where the ray crosses the middle of the lattice plane of `cell` across its dominant axis:
    /// the texture is far coarser than a cell, and one value serves a plane.
    fn on_plane(&self, cell: I64Vec3, h: f64) -> DVec3 {
        let d = self.direction.abs();
        let axis = if d.x >= d.y && d.x >= d.z {
            0
        } else if d.y >= d.z {
            1
        } else {
            2
        };
        let plane = (cell.as_dvec3()[axis] + 0.5) * h;
        self.origin + (plane - self.origin[axis]) / self.direction[axis] * self.direction
    }

    /// One sample of the voxel grid per axial sample.
    fn voxels(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let (h, pitch) = (f64::from(frame.cell), f64::from(frame.sample_pitch));
        let (speed, scale) = (f64::from(frame.speed), f64::from(frame.volume_scale));
        let first = out.kappa(self.segment.time).ceil().max(0.0) as i64;
        let end = out.kappa(self.time(self.segment.length));
        for k in (first..i64::from(frame.samples) + 1).take_while(|&k| (k as f64) < end) {
            let x = (k as f64 * pitch / speed - self.segment.time) * f64::from(self.tissue.speed);
            let p = self.origin + x * self.direction;
            let p = self.field.map_or(p, |f| f.field.reference(p));
            let cell = (p / h).floor().as_i64vec3();
            let Some(s) = scatterer(self.tissue, cell) else {
                continue;
            };
            let row = &self.world.rows[k.min(i64::from(frame.samples) - 1) as usize];
            let sigma = f64::from(row.sigma_elevation);
            let slice = (-self.layer_offset.powi(2) / (2.0 * sigma * sigma)).exp();
            let amplitude = self.weight(x, row) * s.amplitude * factor(self.tissue, p) * slice;
            let time = (k as f64 + s.offset.x - 0.5) * pitch / speed;
            out.deposit(
                self.scanline,
                time,
                amplitude,
                0.0,
                |k| f64::from(self.world.rows[k].volume_gain) * scale,
                NEAREST,
            );
        }
    }

    fn points(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let pitch = f64::from(frame.slice_thickness) / f64::from(frame.layers);
        for point in self.world.points {
            let [x, y, z, amplitude] = point.map(f64::from);
            let p = DVec3::new(x, y, z);
            let height = (p - self.origin).dot(self.elevation) / pitch - POINT_SHIFT;
            if (-0.5..0.5).contains(&height) {
                let everywhere = [POINT_CUT, f64::INFINITY];
                self.echo(p, amplitude, everywhere, |r| r.point_gain, out);
            }
        }
    }
}

#[cfg(test)]
#[path = "scatter_tests.rs"]
mod tests;
