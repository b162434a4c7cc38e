//! Twin of `scatter`: echoes of scatterers and point targets along the segments.

use glam::{DAffine3, DVec2, DVec3, I64Vec3};

use super::accumulator::NEAREST;
use super::field::Field;
use super::geometry::{beam_weight, probe, world_line};
use super::lattice::{Level, level_power, wanted_level};
use super::texture::{factor, voxel};
use super::world::World;
use super::{Accumulator, Segment};
use insonify::sim::layout::{
    FLAG_VOXEL, LATTICE_LEVELS, LEAST_GROWTH, Row, SCATTER_BIN, SCATTER_PIECE, SCATTER_SLOT,
    Tissue, UNHEARD,
};

/// Distance from the axis, in lateral sigmas, within which points are received.
const POINT_CUT: f64 = 4.0;

/// Shift of the layers' borders, in their pitch, off the round numbers at which points lie: by rounding a point
/// could belong to two layers or to none.
const POINT_SHIFT: f64 = 0.012_34;

/// A segment in one space: the world's or that of its texture.
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
    /// Displacements of the tissue in the tube's space; none where it does not deform.
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
    /// Centre and radius of a ball that holds all points of the reference shape whose tissue can be within
    /// `radius` of `p`, relative to `p`: v differs by no more than `steepness` times the
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

/// For each slot of a scanline, [`Tube::level`] of the loudest segment that fills it.
type Loudest = Vec<f64>;

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
    let numbers = |s: &Segment| [s.length, s.time, s.weight, s.share].into_iter().chain(s.spread);
    let finite = |s: &&Segment| {
        let vectors = [s.origin, s.direction, s.lateral];
        numbers(s).all(f64::is_finite) && vectors.iter().all(|v| v.is_finite())
    };
    let slots = world.frame.samples.div_ceil(SCATTER_SLOT) as usize;
    let mut loudest = vec![vec![f64::NEG_INFINITY; slots]; world.frame.scanlines as usize];
    for tube in segments
        .iter()
        .filter(finite)
        .map(|s| Tube::textured(world, s, &fields))
        .filter(Tube::sounds)
    {
        for slot in tube.filled(&out) {
            let here = &mut loudest[tube.scanline as usize][slot as usize];
            let middle = (f64::from(slot) + 0.5) * f64::from(SCATTER_SLOT);
            *here = here.max(tube.level(tube.distance(middle), &out));
        }
    }
    for segment in segments.iter().filter(finite) {
        let tube = Tube::textured(world, segment, &fields);
        if tube.sounds() {
            if world.frame.flags & FLAG_VOXEL == 0 {
                tube.lattices(&loudest[tube.scanline as usize], &mut out);
            } else {
                tube.voxels(&mut out);
            }
        }
        Tube::new(world, segment, DAffine3::IDENTITY, None).points(&mut out);
    }
    out
}

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

/// 1 / sigma^2 of the beam laterally and in elevation.
fn falling(row: &Row) -> [f64; 2] {
    [row.sigma_lateral, row.sigma_elevation].map(|sigma| f64::from(sigma).powi(-2))
}

/// Indices of the cells, of edge `h`, whose centres lie in `low <= x < high`.
fn cells([low, high]: [f64; 2], h: f64) -> std::ops::Range<i64> {
    let first = |x: f64| (x / h - 0.5).ceil() as i64;
    first(low)..first(high)
}

impl<'a> Tube<'a> {
    fn new(
        world: &'a World,
        segment: &'a Segment,
        space: DAffine3,
        field: Option<Deformed<'a>>,
    ) -> Self {
        let elevation = segment.handedness * segment.direction.cross(segment.lateral);
        let (l, layer) =
            (segment.line % world.frame.scanlines, segment.line / world.frame.scanlines);
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

    /// The segment in the space where its scatterers rest.
    fn textured(world: &'a World, segment: &'a Segment, fields: &[Option<Deformed<'a>>]) -> Self {
        let field = fields.get(segment.instance as usize).copied().flatten();
        Self::new(world, segment, world.texture(segment.instance), field)
    }

    fn sounds(&self) -> bool {
        self.tissue.presence > 0.0 && self.segment.weight > 0.0
    }

    /// One-way time at distance `x`, us.
    fn time(&self, x: f64) -> f64 {
        self.segment.time + x / f64::from(self.tissue.speed)
    }

    /// Distance at which sample `kappa` lies.
    fn distance(&self, kappa: f64) -> f64 {
        let frame = self.world.frame;
        let time = kappa * f64::from(frame.sample_pitch) / f64::from(frame.speed);
        (time - self.segment.time) * f64::from(self.tissue.speed)
    }

    fn row(&self, x: f64, out: &Accumulator) -> &'a Row {
        &self.world.rows[out.sample(self.time(x))]
    }

    /// Weight at distance `x` without absorption: smaller off the scanline, and averaged where a rough
    /// reflection has spread the path over many resolution cells.
    fn weight(&self, x: f64, row: &Row) -> f64 {
        let [a, b, c] = self.segment.spread;
        let variance = a + 2.0 * b * x + c * x * x;
        let wider = |sigma: f32| (1.0 + variance / f64::from(sigma).powi(2)).sqrt();
        let cells = wider(row.sigma_lateral) * wider(row.sigma_elevation);
        let averaged = (self.segment.share / cells).sqrt().min(1.0);
        self.segment.weight
            * averaged
            * beam_weight(self.world.frame, self.off[0] + x * self.off[1])
    }

    fn absorbed(&self, x: f64) -> f64 {
        (-f64::from(self.tissue.absorption) * x).exp()
    }

    /// Level of its speckle at distance `x`: one-way weight times echogenicity, log2.
    fn level(&self, x: f64, out: &Accumulator) -> f64 {
        (self.weight(x, self.row(x, out)) * self.absorbed(x)).log2() + f64::from(self.tissue.level)
    }

    /// Bin of the sample at distance `x`.
    fn bin(&self, x: f64, out: &Accumulator) -> u32 {
        out.sample(self.time(x)) as u32 / SCATTER_BIN
    }

    /// The bins that it passes.
    fn bins(&self, out: &Accumulator) -> std::ops::Range<u32> {
        let end = self.segment.length;
        let passed = out.kappa(self.time(end)) > 0.0
            && out.kappa(self.segment.time) < f64::from(self.world.frame.samples);
        let first = self.bin(0.0, out);
        let last = if passed { self.bin(end, out) + 1 } else { first };
        first..last
    }

    /// The slots that it fills, up to half a sample at either end.
    fn filled(&self, out: &Accumulator) -> std::ops::Range<u32> {
        let samples = f64::from(self.world.frame.samples);
        let at = |x: f64| out.kappa(self.time(x)).clamp(0.0, samples) / f64::from(SCATTER_SLOT);
        let margin = 0.5 / f64::from(SCATTER_SLOT);
        (at(0.0) - margin).ceil() as u32..(at(self.segment.length) + margin).floor() as u32
    }

    /// The place in a bin at which its level is compared with the others there.
    fn within(&self, bin: u32, out: &Accumulator) -> f64 {
        debug_assert!(self.bins(out).contains(&bin));
        let middle = f64::from(bin * SCATTER_BIN + SCATTER_BIN / 2);
        self.distance(middle).clamp(0.0, self.segment.length)
    }

    /// The power, log2, by which something louder masks it all along `bin`, as far as it reaches; none where
    /// it would not be heard.
    fn drowned(&self, bin: u32, loudest: &Loudest, out: &Accumulator) -> Option<f64> {
        let level = self.level(self.within(bin, out), out);
        let middle = (bin * SCATTER_BIN + SCATTER_BIN / 2).min(self.world.frame.samples - 1);
        let black = f64::from(self.world.rows[middle as usize].black);
        let slot = |x: f64| (out.kappa(self.time(x)).max(0.0) / f64::from(SCATTER_SLOT)) as usize;
        let per_bin = (SCATTER_BIN / SCATTER_SLOT) as usize;
        let first = slot(0.0).max(bin as usize * per_bin);
        let last = slot(self.segment.length).min(bin as usize * per_bin + per_bin - 1);
        let over = loudest[first..=last.min(loudest.len() - 1)].iter().copied();
        let above = over.fold(f64::INFINITY, f64::min).max(black) - level;
        (level >= black - f64::from(UNHEARD)).then(|| 2.0 * above.max(0.0))
    }

    /// The slab of a layer about its middle, mm. Borders of layers avoid the round numbers at which cells have their
    /// centres.
    fn slab(&self) -> [f64; 2] {
        let reach = f64::from(self.world.frame.elevation_reach);
        [-1.0, 1.0].map(|side| (side + 2.0 * POINT_SHIFT) * reach)
    }

    /// Half the beam's width at `row`, mm: the beam's section is an ellipse, of which the
    /// edge of the layer nearest to the middle is taken.
    fn half_width(&self, row: &Row) -> f64 {
        let frame = self.world.frame;
        let cut = f64::from(frame.lateral_cut);
        let nearest = (self.layer_offset.abs() - f64::from(frame.elevation_reach)).max(0.0);
        let height = nearest / (cut * f64::from(row.sigma_elevation));
        cut * f64::from(row.sigma_lateral) * (1.0 - height * height).max(0.0).sqrt()
    }

    /// Adds the echo at `from` the tube's origin; `amplitude` is without absorption and `beam`.
    fn echo(&self, from: DVec3, amplitude: f64, beam: f64, out: &mut Accumulator) {
        let x = from.dot(self.direction);
        let scale = f64::from(self.world.frame.volume_scale);
        let amplitude = amplitude * self.absorbed(x) * beam;
        out.deposit_nearest(self.scanline, self.time(x), amplitude, |k| {
            f64::from(self.world.rows[k].volume_gain) * scale
        });
    }

    /// The beam's two-way amplitude off its axis, with the widths of a row.
    fn beam(&self, from: DVec3, row: &Row) -> f64 {
        self.beam_of(from, falling(row))
    }

    /// The same from 1 / sigma^2 laterally and in elevation.
    fn beam_of(&self, from: DVec3, [lateral, elevation]: [f64; 2]) -> f64 {
        let across = from.dot(self.lateral);
        let up = self.layer_offset + from.dot(self.elevation);
        (-0.5 * (across * across * lateral + up * up * elevation)).exp()
    }

    /// 1 / sigma^2 at distance `x`: the value of a row is that of its sample's middle, and between them lies the parabola
    /// through the nearest three.
    fn between_rows(&self, x: f64, out: &Accumulator) -> [f64; 2] {
        let last = self.world.rows.len() - 1;
        let at = (out.kappa(self.time(x)) - 0.5).clamp(0.0, last as f64);
        let middle =
            (at.round() as usize).clamp(1.min(last), last.saturating_sub(1).max(1.min(last)));
        let off = at - middle as f64;
        let [before, here, behind] = [middle.saturating_sub(1), middle, (middle + 1).min(last)]
            .map(|k| falling(&self.world.rows[k]));
        std::array::from_fn(|i| {
            let slope = (behind[i] - before[i]) / 2.0;
            let bend = (behind[i] + before[i]) / 2.0 - here[i];
            here[i] + off * (slope + off * bend)
        })
    }

    /// Echoes of all lattices in use somewhere along the tube.
    fn lattices(&self, loudest: &Loudest, out: &mut Accumulator) {
        for number in 0..=LATTICE_LEVELS {
            let level = Level::new(self.tissue, self.world.frame.cell, number);
            match self.field {
                None => self.planes(number, &level, loudest, out),
                Some(field) => self.pieces(field, number, &level, loudest, out),
            }
        }
    }

    /// Share of the power of lattice `number` at distance `x`, which lies in `bin`.
    fn power(&self, number: u32, x: f64, bin: u32, loudest: &Loudest, out: &Accumulator) -> f64 {
        let wanted = f64::from(self.row(x, out).shape[3]);
        let drowned = self.drowned(bin, loudest, out);
        drowned.map_or(0.0, |d| level_power(wanted_level(self.tissue, wanted, d), number))
    }

    /// Echoes of one lattice, plane by plane. A cell counts if its centre lies within the beam's width, taken where
    /// the axis crosses the plane's middle, and within the layer's slab; its scatterer, if it lies within the
    /// segment's ends.
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
        let widest = (self.world.rows.iter()).fold(0.0, |w, r| f64::max(w, self.half_width(r)));
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
            if power == 0.0 {
                continue;
            }
            let row = self.row(x, out);
            let width = self.half_width(row);
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
                    if across.abs() > width {
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
                        let beam = self.beam_of(from, self.between_rows(x, out));
                        self.echo(from, strength * s.amplitude, beam, out);
                    }
                }
            }
        }
    }

    /// Echoes of one lattice in deformed tissue, piece by piece: every scatterer that lies within the beam's width, the
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
            for piece in 0..SCATTER_BIN / SCATTER_PIECE {
                let begin = bin * SCATTER_BIN + piece * SCATTER_PIECE;
                let ends = [begin, begin + SCATTER_PIECE].map(|k| self.distance(f64::from(k)));
                // The first and the last piece also have what lies before the first and behind the last sample.
                let first = if begin == 0 { f64::NEG_INFINITY } else { ends[0] };
                let last = if begin + SCATTER_PIECE >= self.world.frame.samples {
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
                let rows = [x0, x1].map(|x| self.half_width(self.row(x, out)));
                let half = [1.1 * rows[0].max(rows[1]), 1.1 * reach];
                let radius = DVec3::new((x1 - x0) / 2.0, half[0], half[1]).length();
                let (back, spread) = deformed.back(middle, radius);
                let reference = deformed.field.reference(middle);
                // Squeezed tissue keeps its echo level though its scatterers are closer together.
                let least = f64::from(LEAST_GROWTH);
                let growth = deformed.field.growth(reference);
                let texture =
                    factor(self.tissue, reference) * growth.clamp(least, least.recip()).sqrt();
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
                            let from = rest + deformed.field.displacement(rest) - self.origin;
                            let x = from.dot(self.direction);
                            if !(x0..x1).contains(&x) {
                                continue;
                            }
                            let row = self.row(x, out);
                            let across = from.dot(self.lateral).abs() <= self.half_width(row);
                            let [low, high] = self.slab();
                            if !across || !(low..high).contains(&from.dot(self.elevation)) {
                                continue;
                            }
                            let power = self.power(number, x, bin, loudest, out);
                            let strength = self.weight(x, row) * power.sqrt() * texture;
                            self.echo(from, strength * s.amplitude, self.beam(from, row), out);
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

    /// Echoes in voxel mode: one sample of the voxel grid per axial sample.
    fn voxels(&self, out: &mut Accumulator) {
        let frame = self.world.frame;
        let (h, pitch) = (f64::from(frame.cell), f64::from(frame.sample_pitch));
        let (speed, scale) = (f64::from(frame.speed), f64::from(frame.volume_scale));
        let first = out.kappa(self.segment.time).ceil().max(0.0) as i64;
        let end = out.kappa(self.time(self.segment.length));
        for k in (first..i64::from(frame.samples) + 1).take_while(|&k| (k as f64) < end) {
            let x = self.distance(k as f64);
            let p = self.origin + x * self.direction;
            let p = self.field.map_or(p, |f| f.field.reference(p));
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

    fn points(&self, out: &mut Accumulator) {
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
            if from.dot(self.lateral).abs() > POINT_CUT * f64::from(row.sigma_lateral) {
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

#[cfg(test)]
mod tests;
