//! Scatterers of the lattices: plane by plane, and in pieces where the tissue is deformed.

use glam::{DVec2, DVec3, I64Vec3};

use super::{Deformed, Loudest, Tube, in_row, is_narrow};
use crate::reference::Accumulator;
use crate::reference::lattice::{Level, level_power, wanted_level};
use crate::reference::texture::factor;
use insonify::sim::layout::{ALL_LEVELS, LATTICE_LEVELS, LEAST_GROWTH, SCATTER_BIN};

/// The enumeration of a lattice under a beam: axis `a` along it, `b` across, `c` through the slab of the layer.
struct Walk {
    a: usize,
    b: usize,
    c: usize,
    /// Per mm of `a` and `b`, within the slab's middle plane: distance along the beam, and across.
    along: DVec2,
    across: DVec2,
    /// Decrease of `c` per mm of `a` and `b` within that plane.
    tilt: DVec2,
    /// Shift across, mm, of a point 1 mm above that plane along `c`.
    slant: f64,
}

impl Walk {
    fn new(tube: &Tube) -> Self {
        let e = tube.elevation.abs();
        let c = if e.x >= e.y && e.x >= e.z {
            0
        } else if e.y >= e.z {
            1
        } else {
            2
        };
        let (mut a, mut b) = ((c + 1) % 3, (c + 2) % 3);
        let plane = |v: DVec3, a: usize, b: usize| {
            DVec2::new(v[a], v[b])
                - v[c] / tube.elevation[c] * DVec2::new(tube.elevation[a], tube.elevation[b])
        };
        let across = plane(tube.lateral, a, b);
        if across.x.abs() > across.y.abs() {
            (a, b) = (b, a);
        }
        Self {
            a,
            b,
            c,
            along: plane(tube.direction, a, b),
            across: plane(tube.lateral, a, b),
            tilt: DVec2::new(tube.elevation[a], tube.elevation[b]) / tube.elevation[c],
            slant: tube.lateral[c] / tube.elevation[c],
        }
    }
}

/// Indices of the cells, of edge `h`, whose centres lie in `low <= x < high`.
fn cells([low, high]: [f64; 2], h: f64) -> std::ops::Range<i64> {
    let first = |x: f64| (x / h - 0.5).ceil() as i64;
    first(low)..first(high)
}

impl Tube<'_> {
    /// Echoes of all lattices in use somewhere along the tube.
    pub(super) fn lattices(&self, loudest: &Loudest, out: &mut Accumulator) {
        for number in 0..=LATTICE_LEVELS {
            let generation = self.field.map_or(0, |field| field.generation);
            let level =
                Level::new(self.tissue, self.world.frame.cell, number).of_generation(generation);
            match self.field {
                None => self.planes(number, &level, loudest, out),
                Some(field) => self.pieces(field, number, &level, loudest, out),
            }
        }
    }

    /// Share of the power of lattice `number` at distance `x`, which lies in `bin`.
    fn power(&self, number: u32, x: f64, bin: u32, loudest: &Loudest, out: &Accumulator) -> f64 {
        let row = self.row(x, out);
        let on = x.clamp(0.0, self.segment.length);
        // A narrow beam that is wider needs fewer scatterers, as no other scanline hears them.
        let wider = if is_narrow(row) { self.ratio(on).log2().max(0.0) } else { 0.0 };
        let level = f64::from(row.shape[3]);
        let wanted = if level > ALL_LEVELS.into() { level + wider } else { level };
        let drowned = self.drowned(bin, loudest, out);
        drowned.map_or(0.0, |d| level_power(wanted_level(self.tissue, wanted, d), number))
    }

    /// Echoes of one lattice, plane by plane. A cell counts if its centre lies within the layer's slab and, of a narrow beam,
    /// within its width where the axis crosses the plane's middle; its scatterer, if it lies within the segment's ends and the
    /// strip of others.
    fn planes(&self, number: u32, level: &Level, loudest: &Loudest, out: &mut Accumulator) {
        if self.bins(out).is_empty() {
            return;
        }
        let h = level.edge;
        let reach = f64::from(self.world.frame.elevation_reach);
        let walk = Walk::new(self);
        let (a, b, c) = (walk.a, walk.b, walk.c);
        let o = self.origin;
        let drift = walk.across.x / walk.across.y;
        let step = walk.along.x - walk.along.y * drift;
        // Larger than the distance of any cell's scatterer from the crossing of its plane.
        let widest =
            (0..self.world.rows.len()).fold(0.0, |w, k| f64::max(w, self.half_width_at(k)));
        let margin = 2.0 * h + 2.0 * widest + 2.0 * reach;
        let ends = [-margin, self.segment.length + margin].map(|x| o[a] + x / step);
        let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        for i in cells(ends, h) {
            let da = (i as f64 + 0.5) * h - o[a];
            let x = step * da;
            let on = x.clamp(0.0, self.segment.length);
            let bins = self.bins(out);
            let bin = self.bin(on, out).clamp(bins.start, bins.end - 1);
            let power = self.power(number, x, bin, loudest, out);
            let row = self.row(x, out);
            let half = self.half_width(row, x);
            if power == 0.0 || half == 0.0 {
                continue;
            }
            // A scatterer may lie as far as its cell's corner from its middle.
            let width = 1.2 * half + h;
            let strength =
                self.weight(x, row) * power.sqrt() * factor(self.tissue, o + x * self.direction);
            let row_middle = o[b] - drift * da;
            let farthest = (width + walk.slant.abs() * reach) / walk.across.y.abs() + h;
            for j in cells([row_middle - farthest, row_middle + farthest], h) {
                let db = (j as f64 + 0.5) * h - o[b];
                let middle = o[c] - walk.tilt.dot(DVec2::new(da, db));
                let slab = self.slab().map(|up| middle + up / self.elevation[c]);
                for k in cells([slab[0].min(slab[1]), slab[0].max(slab[1])], h) {
                    let up = ((k as f64 + 0.5) * h - middle) * self.elevation[c];
                    let across = walk.across.dot(DVec2::new(da, db)) + walk.slant * up;
                    if is_narrow(row) && across.abs() > half {
                        continue;
                    }
                    let mut cell = I64Vec3::ZERO;
                    (cell[a], cell[b], cell[c]) = (i, j, k);
                    let Some(s) = level.scatterer(cell) else {
                        continue;
                    };
                    let from = (cell.as_dvec3() + s.offset) * h - o;
                    let x = from.dot(self.direction);
                    if (0.0..self.segment.length).contains(&x) {
                        let strip = self.between_rows(x, out);
                        let heard = self.heard(from, on, row, self.ratio(x), strip);
                        if heard > 0.0 {
                            let gain = Some(self.gain(x, out));
                            self.echo(from, strength * s.amplitude, heard, gain, out);
                        }
                    }
                }
            }
        }
    }

    /// Echoes of one lattice in deformed tissue, piece by piece: every scatterer that lies within the strip, the
    /// layer's slab and the piece, from wherever in the reference shape the field can bring it there.
    fn pieces(
        &self,
        deformed: Deformed,
        number: u32,
        level: &Level,
        loudest: &Loudest,
        out: &mut Accumulator,
    ) {
        let h = level.edge;
        let reach = f64::from(self.world.frame.elevation_reach);
        for bin in self.bins(out) {
            let samples = self.world.frame.piece;
            for piece in 0..SCATTER_BIN / samples {
                let begin = bin * SCATTER_BIN + piece * samples;
                let ends = [begin, begin + samples].map(|k| self.distance(f64::from(k)));
                // The first and the last piece also have what lies before the first and behind the last sample.
                let first = if begin == 0 { f64::NEG_INFINITY } else { ends[0] };
                let last = if begin + samples >= self.world.frame.samples {
                    f64::INFINITY
                } else {
                    ends[1]
                };
                let x0 = first.max(0.0);
                let x1 = last.min(self.segment.length);
                if x1 <= x0 {
                    continue;
                }
                let sounding =
                    [x0, x0.midpoint(x1), x1].map(|x| self.power(number, x, bin, loudest, out));
                if sounding == [0.0; 3] {
                    continue;
                }
                let middle = self.origin + x0.midpoint(x1) * self.direction;
                let rows = [x0, x1].map(|x| self.half_width(self.row(x, out), x));
                let half = [1.1 * rows[0].max(rows[1]), 1.1 * reach];
                let radius = DVec3::new((x1 - x0) / 2.0, half[0], half[1]).length();
                let (back, spread) = deformed.back(middle, radius);
                let reference = deformed.reference(middle);
                // Squeezed tissue keeps its echo level though its scatterers are closer together.
                let least = f64::from(LEAST_GROWTH);
                let jacobian = deformed.jacobian(reference);
                let growth = jacobian.determinant().abs().clamp(least, least.recip());
                let ahead = jacobian.inverse() * self.direction;
                let (low, high) = self.bounds([x0, x1], half);
                let low = ((low + back - spread) / h).floor().as_i64vec3();
                let high = ((high + back + spread) / h).floor().as_i64vec3();
                for k in low.z..=high.z {
                    for j in low.y..=high.y {
                        for i in low.x..=high.x {
                            let cell = I64Vec3::new(i, j, k);
                            let Some(s) = level.scatterer(cell) else {
                                continue;
                            };
                            let rest = (cell.as_dvec3() + s.offset) * h;
                            let from = deformed.moved(rest) - self.origin;
                            let x = from.dot(self.direction);
                            if !(x0..x1).contains(&x) {
                                continue;
                            }
                            let row = self.row(x, out);
                            let [low, high] = self.slab();
                            if from.dot(self.lateral).abs() >= self.half_width(row, x)
                                || !(low..high).contains(&from.dot(self.elevation))
                            {
                                continue;
                            }
                            let power = self.power(number, x, bin, loudest, out);
                            let on_axis = reference + (x - x0.midpoint(x1)) * ahead;
                            let texture = factor(self.tissue, on_axis);
                            let strength =
                                deformed.weight * self.weight(x, row) * (power * growth).sqrt();
                            let strength = strength * texture;
                            let ratio = self.ratio(x);
                            let heard = self.heard(from, x, row, ratio, in_row(row));
                            if heard > 0.0 {
                                self.echo(from, strength * s.amplitude, heard, None, out);
                            }
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
}
