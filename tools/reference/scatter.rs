//! Twin of `scatter`: echoes of scatterers and point targets along the segments. A scanline hears the scatterers of its own
//! strip, and all point targets in its beam.

mod lattices;
mod others;

use glam::{DAffine3, DMat3, DVec3};

use super::aperture::{counted, level, loses_by_aperture, lost_of, nepers};
use super::field::{Field, Flowed};
use super::geometry::{beam_weight, line_pitch, probe, world_line};
use super::world::World;
use super::{Accumulator, Segment};
use insonify::sim::layout::{
    FLAG_VOXEL, LEAST_PITCH, MOST_WIDENED, PART_FLOWING, PART_STILL, Row, SCATTER_BIN,
    SCATTER_SLOT, STRIP_CUT, STRIP_LIMIT, Tissue, UNHEARD,
};
use insonify::sim::push::Scatter;

/// Shift of the layers' borders, in their pitch, off the round numbers at which points lie: by rounding a point
/// could belong to two layers or to none.
const POINT_SHIFT: f64 = 0.012_34;

/// A segment in one space: the world's or that of its texture.
pub(super) struct Tube<'a> {
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

/// How tissue comes from where it rests to where it is now: blood is carried by its flow, then with what it is in.
#[derive(Clone, Copy)]
pub(super) struct Deformed<'a> {
    fields: [Option<Field<'a>>; 2],
    /// Bound on the displacement, mm.
    reach: f64,
    /// Bound on its change per mm.
    steepness: f64,
    /// Factor on amplitudes, and number of the generation.
    weight: f64,
    generation: u32,
}

impl<'a> Deformed<'a> {
    fn new(fields: [Option<Field<'a>>; 2], weight: f64, generation: u32) -> Self {
        let all = || fields.iter().flatten();
        Self {
            fields,
            reach: all().map(Field::reach).sum(),
            steepness: all().map(|field| 1.0 + field.steepness()).product::<f64>() - 1.0,
            weight,
            generation,
        }
    }

    /// Where the tissue that rests at `p` is now.
    fn moved(&self, p: DVec3) -> DVec3 {
        self.fields.iter().flatten().fold(p, |p, field| p + field.displacement(p))
    }

    /// Where the tissue that is at `p` now rests.
    fn reference(&self, p: DVec3) -> DVec3 {
        self.fields.iter().rev().flatten().fold(p, |p, field| field.reference(p))
    }

    /// The derivative of [`Self::moved`].
    fn jacobian(&self, p: DVec3) -> DMat3 {
        let all = self.fields.iter().flatten();
        let (_, jacobian) = all.fold((p, DMat3::IDENTITY), |(p, before), field| {
            (p + field.displacement(p), field.jacobian(p) * before)
        });
        jacobian
    }

    /// Centre and radius of a ball that holds all points of the reference shape whose tissue can be within
    /// `radius` of `p`, relative to `p`: v differs by no more than `steepness` times the
    /// distance there, which is no more than radius / (1 - steepness).
    fn back(&self, p: DVec3, radius: f64) -> (DVec3, f64) {
        if self.steepness < 1.0 {
            let spread = self.steepness / (1.0 - self.steepness) * radius;
            (self.reference(p) - p, spread)
        } else {
            (DVec3::ZERO, self.reach)
        }
    }
}

/// For each slot of a scanline, [`Tube::level`] of the loudest segment that fills it.
type Loudest = Vec<f64>;

/// True if a segment has numbers only.
pub(super) fn is_finite(s: &Segment) -> bool {
    let numbers = [s.length, s.time, s.weight, s.share]
        .into_iter()
        .chain(s.spread)
        .chain(s.lens)
        .chain(s.strip);
    let vectors = [s.origin, s.direction, s.lateral];
    numbers.into_iter().all(f64::is_finite) && vectors.iter().all(|v| v.is_finite())
}

/// Echoes of the scatterers along all segments that a dispatch hears, in units of 1 / volume_scale.
pub fn scatter(world: &World, segments: &[Segment], heard: Scatter) -> Accumulator {
    let mut out = Accumulator::new(world.frame);
    // Of each instance as many as it has generations of scatterers; none where it is rigid.
    let deformed = |instance: u32| -> Vec<Deformed<'_>> {
        let field = world.field(instance);
        let flows = world.flows(instance, heard);
        match (flows.is_empty(), field) {
            (false, field) => flows
                .into_iter()
                .map(|Flowed { weight, generation, field: flow }| {
                    Deformed::new([Some(flow), field], weight, generation)
                })
                .collect(),
            (true, Some(field)) => vec![Deformed::new([None, Some(field)], 1.0, 0)],
            (true, None) => Vec::new(),
        }
    };
    let fields: Vec<Vec<Deformed<'_>>> = (0..world.instances.len() as u32).map(deformed).collect();
    let slots = world.frame.samples.div_ceil(SCATTER_SLOT) as usize;
    let mut loudest = vec![vec![f64::NEG_INFINITY; slots]; world.frame.scanlines as usize];
    for tube in segments
        .iter()
        .filter(|s| is_finite(s))
        .map(|s| Tube::new(world, s, world.texture(s.instance), None))
        .filter(Tube::sounds)
    {
        for slot in tube.filled(&out) {
            let here = &mut loudest[tube.scanline as usize][slot as usize];
            let middle = (f64::from(slot) + 0.5) * f64::from(SCATTER_SLOT);
            *here = here.max(tube.level(tube.distance(middle), &out));
        }
    }
    for segment in segments.iter().filter(|s| is_finite(s)) {
        let all = fields.get(segment.instance as usize).map_or(&[][..], Vec::as_slice);
        let space = world.texture(segment.instance);
        let tube = Tube::new(world, segment, space, all.first().copied());
        let flows = all.iter().any(|of| of.fields[0].is_some());
        let part = if flows { PART_FLOWING } else { PART_STILL };
        if !tube.sounds() || heard.part & part == 0 {
            continue;
        }
        if world.frame.flags & FLAG_VOXEL != 0 {
            // Voxels are carried by no flow.
            let still = world.field(segment.instance);
            let still = still.map(|field| Deformed::new([None, Some(field)], 1.0, 0));
            Tube { field: still, ..tube }.voxels(&mut out);
            continue;
        }
        let loudest = &loudest[tube.scanline as usize];
        tube.lattices(loudest, &mut out);
        for later in all.iter().skip(1) {
            Tube::new(world, segment, space, Some(*later)).lattices(loudest, &mut out);
        }
    }
    out
}

/// Echoes of the point targets along all segments, in the same units.
pub fn points(world: &World, segments: &[Segment]) -> Accumulator {
    let mut out = Accumulator::new(world.frame);
    for segment in segments.iter().filter(|s| is_finite(s)) {
        Tube::new(world, segment, DAffine3::IDENTITY, None).points(&mut out);
    }
    out
}

impl<'a> Tube<'a> {
    pub(super) fn new(
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

    pub(super) fn sounds(&self) -> bool {
        self.tissue.presence > 0.0 && self.segment.weight > 0.0
    }

    /// One-way time at distance `x`, us.
    fn time(&self, x: f64) -> f64 {
        self.segment.time + x / f64::from(self.tissue.speed)
    }

    /// Distance at which sample `kappa` lies.
    pub(super) fn distance(&self, kappa: f64) -> f64 {
        let frame = self.world.frame;
        let time = kappa * f64::from(frame.sample_pitch) / f64::from(frame.speed);
        (time - self.segment.time) * f64::from(self.tissue.speed)
    }

    fn row(&self, x: f64, out: &Accumulator) -> &'a Row {
        &self.world.rows[self.sample(x, out)]
    }

    /// The factor by the aperture at distance `x`; 1 behind a reflection.
    fn by_aperture(&self, x: f64) -> f64 {
        let (frame, segment) = (self.world.frame, self.segment);
        if !loses_by_aperture(frame) || segment.reflected {
            return 1.0;
        }
        let table = counted(self.world.apertures);
        let lost = lost_of(segment.weight) + f64::from(self.tissue.absorption) * x;
        let nepers = nepers(frame, table, segment.line, self.time(x), lost);
        if nepers - lost < f64::from(frame.min_weight).ln() { 0.0 } else { nepers.exp() }
    }

    /// Weight at distance `x` without absorption: smaller off the scanline, and averaged where a rough
    /// reflection has spread the path over many resolution cells; with the factor by the aperture.
    pub(super) fn weight(&self, x: f64, row: &Row) -> f64 {
        let [a, b, c] = self.segment.spread;
        let variance = a + 2.0 * b * x + c * x * x;
        let wider = |sigma: f32| (1.0 + variance / f64::from(sigma).powi(2)).sqrt();
        let cells = wider(row.sigma_lateral) * wider(row.sigma_elevation);
        let averaged = (self.segment.share / cells).sqrt().min(1.0);
        self.segment.weight
            * self.by_aperture(x)
            * averaged
            * beam_weight(self.world.frame, self.off[0] + x * self.off[1])
    }

    pub(super) fn absorbed(&self, x: f64) -> f64 {
        (-f64::from(self.tissue.absorption) * x).exp()
    }

    /// Level of its speckle at distance `x`: one-way weight times echogenicity, log2.
    fn level(&self, x: f64, out: &Accumulator) -> f64 {
        (self.weight(x, self.row(x, out)) * self.absorbed(x)).log2() + f64::from(self.tissue.level)
    }

    /// Index of the sample at distance `x`.
    fn sample(&self, x: f64, out: &Accumulator) -> usize {
        out.sample(self.time(x))
    }

    /// Bin of the sample at distance `x`.
    fn bin(&self, x: f64, out: &Accumulator) -> u32 {
        self.sample(x, out) as u32 / SCATTER_BIN
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

    /// Variance across of the beam at distance `x`, over that behind even surfaces, which `row` has: lenses widen the
    /// transmitted and the received beam, and the product of both by half as much.
    pub(super) fn widened(&self, x: f64, row: &Row) -> f64 {
        let [a, b, c] = self.segment.lens;
        let off = (a + x * (b + x * c)) / f64::from(row.sigma_lateral);
        1.0 + (0.5 * off * off).min(MOST_WIDENED.into())
    }

    /// Power of speckle at distance `x` over that behind even surfaces: of beams whose intensities are Gaussians it goes by
    /// the root of the sum of their variances. What comes from one deviation of the aperture misses the axis by `off` on the
    /// received beam; on the transmitted one it was `defocus` beside it and is `moved` farther. A lens that would mend the focus is
    /// too small to have all of the beam.
    fn spoiled(&self, x: f64, row: &Row) -> f64 {
        let [a, b, c] = self.segment.lens;
        let (off, turn) = (a + x * (b + x * c), b + 2.0 * x * c);
        let defocus = f64::from(row.defocus);
        let aperture = f64::from(row.aperture);
        let moved = turn / 2.0 * defocus / aperture + off * f64::from(row.transmit_sine) / aperture;
        let more = off.powi(2) + (defocus + moved).powi(2) - defocus.powi(2);
        (1.0 + (more / f64::from(row.variances)).clamp(0.0, MOST_WIDENED.into())).sqrt().recip()
    }

    /// Factor on the amplitude of speckle at distance `x`, by surfaces that bend the beam; on the main path by the aperture.
    pub(super) fn scattered(&self, x: f64, row: &Row) -> f64 {
        let (frame, segment) = (self.world.frame, self.segment);
        if loses_by_aperture(frame) && !segment.reflected {
            return level(frame, self.world.apertures, segment.line, self.time(x)).exp();
        }
        self.spoiled(x, row).sqrt()
    }

    /// Distance of the neighbouring scanlines' paths at distance `x`, over that of the scanlines, with its limits.
    fn ratio(&self, x: f64) -> f64 {
        let [pitch, growth] = line_pitch(self.world.frame);
        let nominal = pitch + growth * f64::from(self.world.frame.speed) * self.time(x);
        let [distance, wider] = self.segment.strip;
        let limit = f64::from(STRIP_LIMIT);
        ((distance + x * wider).abs() / nominal.max(LEAST_PITCH.into())).clamp(1.0 / limit, limit)
    }

    /// Half the strip's width at distance `x`, whose row is given, mm; 0 where the whole layer lies beyond the beam's edge in
    /// elevation. A narrow beam's section is an ellipse, of which the edge of the layer nearest to the middle is taken.
    fn half_width(&self, row: &Row, x: f64) -> f64 {
        let frame = self.world.frame;
        let nearest = (self.layer_offset.abs() - f64::from(frame.elevation_reach)).max(0.0);
        let beside = nearest / (f64::from(frame.elevation_cut) * f64::from(row.sigma_elevation));
        let part = if is_narrow(row) { (1.0 - beside * beside).max(0.0).sqrt() } else { 1.0 };
        if beside < 1.0 { part * f64::from(row.shape[0]) * self.ratio(x) } else { 0.0 }
    }

    /// [`Self::half_width`] at the middle of sample `k`.
    fn half_width_at(&self, k: usize) -> f64 {
        self.half_width(&self.world.rows[k], self.distance(k as f64 + 0.5))
    }

    /// Adds the echo at `from` the tube's origin; `amplitude` is without absorption and `beam`. Without a `gain` it is that of
    /// the sample that it is added to.
    fn echo(
        &self,
        from: DVec3,
        amplitude: f64,
        beam: f64,
        gain: Option<f64>,
        out: &mut Accumulator,
    ) {
        let x = from.dot(self.direction);
        let scale = f64::from(self.world.frame.volume_scale);
        let amplitude = amplitude * self.absorbed(x) * beam;
        out.deposit_nearest(self.scanline, self.time(x), amplitude, |k| {
            gain.unwrap_or_else(|| self.world.rows[k].volume_gain.into()) * scale
        });
    }

    /// The two-way amplitude of a point off the beam's axis, with the widths of a row.
    fn beam(&self, from: DVec3, row: &Row) -> f64 {
        let across = from.dot(self.lateral) / f64::from(row.sigma_lateral);
        let up = (self.layer_offset + from.dot(self.elevation)) / f64::from(row.sigma_elevation);
        let widened = self.widened(from.dot(self.direction), row);
        // As much fainter as it is wider.
        (-0.5 * (across * across / widened + up * up)).exp() / widened.sqrt()
    }

    /// The two-way amplitude of a scatterer off the axis in a strip `half` to either side and as wide as `ratio` says, and a
    /// beam whose 1 / sigma^2 in elevation is `falling`; lenses weaken it as at distance `x`.
    fn heard(&self, from: DVec3, x: f64, row: &Row, ratio: f64, [half, falling]: [f64; 2]) -> f64 {
        let across = from.dot(self.lateral).abs() / (half * ratio);
        let share = strip_share(row, across);
        let up = self.layer_offset + from.dot(self.elevation);
        // A wider strip has more scatterers.
        let fainter = ratio.sqrt() / self.scattered(x, row);
        share * (-0.5 * up * up * falling).exp() / fainter
    }

    /// Half the strip's width among even surfaces and 1 / sigma^2 in elevation at distance `x`: the value of a row is that of
    /// its sample's middle.
    fn between_rows(&self, x: f64, out: &Accumulator) -> [f64; 2] {
        self.parabola(out.kappa(self.time(x)) - 0.5, in_row)
    }

    /// The gain at distance `x`: an echo on a sample has that of the sample's row.
    fn gain(&self, x: f64, out: &Accumulator) -> f64 {
        let [octaves] = self.parabola(out.kappa(self.time(x)), |row| [row.shape[2].into()]);
        octaves.exp2()
    }

    /// Values of rows, where the first has those of `at` = 0: between them lies the parabola through the nearest three.
    fn parabola<const N: usize>(&self, at: f64, of: impl Fn(&Row) -> [f64; N]) -> [f64; N] {
        let last = self.world.rows.len() - 1;
        let at = at.clamp(0.0, last as f64);
        let middle =
            (at.round() as usize).clamp(1.min(last), last.saturating_sub(1).max(1.min(last)));
        let off = at - middle as f64;
        let [before, here, behind] = [middle.saturating_sub(1), middle, (middle + 1).min(last)]
            .map(|k| of(&self.world.rows[k]));
        std::array::from_fn(|i| {
            let slope = (behind[i] - before[i]) / 2.0;
            let bend = (behind[i] + before[i]) / 2.0 - here[i];
            here[i] + off * (slope + off * bend)
        })
    }
}

/// True if the strip is a narrow beam's, of which no other scanline hears scatterers.
fn is_narrow(row: &Row) -> bool {
    row.strip_core < 0.0
}

/// The part of a scatterer's amplitude that is heard at `off` of half the strip's width, of narrow beams at any distance.
fn strip_share(row: &Row, off: f64) -> f64 {
    let core = f64::from(row.strip_core);
    let deviations = f64::from(STRIP_CUT) * off;
    match is_narrow(row) {
        true => (-deviations * deviations / 2.0).exp(),
        false => ((1.0 - off) / (1.0 - core)).clamp(0.0, 1.0),
    }
}

/// Half a strip's width among even surfaces, mm, and 1 / sigma^2 in elevation.
fn in_row(row: &Row) -> [f64; 2] {
    [row.shape[0].into(), f64::from(row.sigma_elevation).powi(-2)]
}

#[cfg(test)]
mod tests;
