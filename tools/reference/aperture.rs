//! Twin of `aperture`: what lies on the way counts by the part of the aperture that it lies in front of.

use super::geometry::line_pitch;
use insonify::sim::layout::{
    APERTURE_ALIKE, APERTURE_BANDS, APERTURE_FRONT, APERTURE_JUMP, APERTURE_RAYS, Aperture,
    BENT_ALIKE, FLAG_APERTURE, FLAG_MASKED, Frame, KIND_PHASED, LEAST_LEVEL, LEAST_MAIN,
    LEAST_MISSED, LEAST_PITCH, LEVEL_STEP, Row,
};

/// True if losses count by the aperture.
pub fn loses_by_aperture(frame: &Frame) -> bool {
    frame.flags & FLAG_APERTURE != 0
}

/// Nepers that a main path of this weight has lost.
pub fn lost_of(weight: f64) -> f64 {
    -weight.max(LEAST_MAIN.into()).ln()
}

/// Loss where the main path was not followed.
pub const UNKNOWN: f64 = -1e3;

/// A node of a main path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passed {
    /// Nepers that it has lost down to it.
    pub lost: f64,
    /// Sine by which a ray on it is turned towards its lateral axis between the node above and this one.
    pub bent: f64,
}

/// Factors at a target, as its apertures make them of that.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Factor on amplitudes, nepers.
    pub gain: f64,
    /// Factor on the amplitude of speckle, nepers; of each LEVEL_STEPth node, scanline of the face and layer.
    pub level: f64,
}

/// Gain and loss of each node, for [`nepers`].
pub fn counted(nodes: &[Aperture]) -> impl Fn(usize) -> [f64; 2] {
    |at| [nodes[at].gain.into(), nodes[at].lost.into()]
}

/// Place of a line's node in the tables.
pub fn place(frame: &Frame, line: u32, node: u32) -> usize {
    let (layer, l) = (line / frame.scanlines, line % frame.scanlines);
    ((layer * (APERTURE_BANDS + 1) + node) * frame.scanlines + l) as usize
}

/// One-way time of a node, us.
pub fn time_of(frame: &Frame, node: u32) -> f64 {
    f64::from(frame.depth) / f64::from(frame.speed) * f64::from(node) / f64::from(APERTURE_BANDS)
}

/// The node before a one-way time, of nodes `step` apart, and the share of the way from there to the next.
fn bands(frame: &Frame, time: f64, step: u32) -> (u32, f64) {
    let bands = APERTURE_BANDS / step;
    let way = (time * f64::from(frame.speed) / f64::from(frame.depth)).clamp(0.0, 1.0);
    let way = way * f64::from(bands);
    let node = (way.floor() as u32).min(bands - 1);
    (step * node, way - f64::from(node))
}

/// Factor on the amplitude of speckle of a line at a one-way time, in nepers, by surfaces that bend its beam: between the
/// nodes, scanlines and layers that have one.
pub fn level(frame: &Frame, nodes: &[Aperture], line: u32, time: f64) -> f64 {
    let (node, share) = bands(frame, time, LEVEL_STEP);
    let (layer, l) = (line / frame.scanlines, line % frame.scanlines);
    let mut sum = 0.0;
    for (layer, part) in levelled(layer, 0, frame.layers) {
        for (l, beside) in levelled(l, frame.first_line, frame.scanlines) {
            let line = layer * frame.scanlines + l;
            let [above, below] = [node, node + LEVEL_STEP]
                .map(|node| f64::from(nodes[place(frame, line, node)].level));
            sum += part * beside * (above + share * (below - above));
        }
    }
    sum
}

/// Of `count` scanlines or layers those between which one lies and whose numbers, from `first` on, LEVEL_STEP divides, each with
/// its share. At the border it is one, and where there is none the given one itself.
fn levelled(at: u32, first: u32, count: u32) -> Vec<(u32, f64)> {
    let has = |n: &u32| (first + n).is_multiple_of(LEVEL_STEP);
    let before = (0..=at).rev().find(has);
    let next = (at..count).find(has);
    match (before, next) {
        (Some(before), Some(next)) if before < next => {
            let part = f64::from(at - before) / f64::from(next - before);
            vec![(before, 1.0 - part), (next, part)]
        }
        _ => vec![(before.or(next).unwrap_or(at), 1.0)],
    }
}

/// Factor on amplitudes of a line at a one-way time, in nepers, where its main path has lost `lost` nepers. `at` gives
/// the factor and the loss of a node.
pub fn nepers(
    frame: &Frame,
    at: impl Fn(usize) -> [f64; 2],
    line: u32,
    time: f64,
    lost: f64,
) -> f64 {
    let (node, share) = bands(frame, time, 1);
    let [above, below] = [node, node + 1].map(|node| at(place(frame, line, node)));
    let jump = below[1] - above[1];
    let part = match jump > f64::from(APERTURE_JUMP) {
        true => ((lost - above[1]) / jump).clamp(0.0, 1.0),
        false => share,
    };
    above[0] + part * (below[0] - above[0])
}

/// The factors of all nodes, from what their main paths have passed.
pub fn aperture(frame: &Frame, rows: &[Row], passed: &[Passed]) -> Vec<Found> {
    let mut out = vec![Found::default(); passed.len()];
    if passed.is_empty() {
        return out;
    }
    for layer in 0..frame.layers {
        for node in 1..=APERTURE_BANDS {
            let depth = f64::from(frame.depth) * f64::from(node) / f64::from(APERTURE_BANDS);
            let row = (depth / f64::from(frame.sample_pitch)).floor() as usize;
            let row = &rows[row.min(rows.len() - 1)];
            let target = Target { frame, row, passed, layer, node };
            for l in 0..frame.scanlines {
                let line = layer * frame.scanlines + l;
                if target.is_heard(l) {
                    out[place(frame, line, node)] = target.converged(l);
                }
            }
        }
    }
    out
}

/// The targets at a node of a layer.
struct Target<'a> {
    frame: &'a Frame,
    /// At the node's depth.
    row: &'a Row,
    passed: &'a [Passed],
    layer: u32,
    node: u32,
}

impl Target<'_> {
    /// False around masks: no main path reaches a place for which the gain or the level of scanline `l` here is interpolated.
    fn is_heard(&self, l: u32) -> bool {
        let frame = self.frame;
        let reach = if self.has_level(l) { LEVEL_STEP } else { 1 };
        let around =
            |at: u32, reach: u32, last: u32| at.saturating_sub(reach)..=(at + reach).min(last);
        let reached = |layer: u32, l: u32| {
            around(self.node, reach, APERTURE_BANDS).any(|node| {
                self.passed[place(frame, layer * frame.scanlines + l, node)].lost > UNKNOWN
            })
        };
        frame.flags & FLAG_MASKED == 0
            || around(self.layer, reach - 1, frame.layers - 1)
                .any(|layer| around(l, reach - 1, frame.scanlines - 1).any(|l| reached(layer, l)))
    }

    /// True if rays that miss the target are followed.
    fn has_level(&self, l: u32) -> bool {
        [self.node, self.layer, self.frame.first_line + l]
            .iter()
            .all(|n| n.is_multiple_of(LEVEL_STEP))
    }

    /// Loss of scanline `l` between two nodes; none where it was not followed.
    fn lost_in(&self, l: u32, [begin, end]: [u32; 2]) -> Option<f64> {
        let line = self.layer * self.frame.scanlines + l;
        let [above, below] = [begin, end].map(|n| self.passed[place(self.frame, line, n)].lost);
        (above != UNKNOWN && below != UNKNOWN).then_some(below - above)
    }

    /// Sine by which scanline `l` turns a ray in a band.
    fn bent_in(&self, l: u32, band: u32) -> f64 {
        let line = self.layer * self.frame.scanlines + l;
        self.passed[place(self.frame, line, band + 1)].bent
    }

    /// The same `lines` beside scanline `l`, between two.
    fn bent_beside(&self, l: u32, lines: f64, band: u32) -> f64 {
        let low = lines.clamp(-1e6, 1e6).floor();
        let last = i64::from(self.frame.scanlines) - 1;
        let [below, above] = [0, 1].map(|next| {
            let at = (i64::from(l) + low as i64 + next).clamp(0, last);
            self.bent_in(at as u32, band)
        });
        below + (lines - low).min(1.0) * (above - below)
    }

    /// The steps in which the way to the node is followed, from the node up: of one band, farther away of two and of four.
    fn steps(&self) -> Vec<[u32; 2]> {
        let mut steps = Vec::new();
        let mut end = self.node;
        while end > 0 {
            let size = match self.node - end {
                0..8 => 1,
                8..24 => 2,
                _ => 4,
            };
            let begin = end.saturating_sub(size);
            steps.push([begin, end]);
            end = begin;
        }
        steps
    }

    /// Scanlines aside that a ray has crossed at a depth, in nodes, for each mm beside the scanline on the aperture.
    fn lines_per_mm(&self, at: f64) -> f64 {
        (1.0 - at / f64::from(self.node)) / self.pitch(at)
    }

    /// Scanlines aside that a ray crosses at a depth, in nodes, for each deviation beside the scanline on the transmit aperture.
    fn lines_sent(&self, at: f64) -> f64 {
        let way =
            f64::from(self.frame.depth) / f64::from(APERTURE_BANDS) * (f64::from(self.node) - at);
        (f64::from(self.row.defocus) + f64::from(self.row.transmit_sine) * way) / self.pitch(at)
    }

    /// Deviations of the receive aperture in `beside` mm.
    fn deviations(&self, beside: f64) -> f64 {
        let depth = f64::from(self.frame.depth) * f64::from(self.node) / f64::from(APERTURE_BANDS);
        beside / (f64::from(self.row.receive_sine) * depth).max(LEAST_PITCH.into())
    }

    /// Distance of neighbouring scanlines at a depth, in nodes.
    fn pitch(&self, at: f64) -> f64 {
        let [pitch, growth] = line_pitch(self.frame);
        let depth = f64::from(self.frame.depth) * at / f64::from(APERTURE_BANDS);
        (pitch + depth * growth).max(LEAST_PITCH.into())
    }

    /// The first node of a scanline behind a surface that lets hardly anything through.
    fn front(&self, l: u32) -> Option<u32> {
        let lost = |node: &u32| self.lost_in(l, [node - 1, *node]);
        (1..=APERTURE_BANDS)
            .find(|node| lost(node).is_some_and(|lost| lost > APERTURE_FRONT.into()))
    }

    /// True if a ray crosses such a surface from the first node of a step to the last: it was in front of that of the
    /// scanline there, is behind that of the scanline here, and both are near.
    fn crosses_front(&self, [above, below]: [u32; 2], [begin, end]: [u32; 2]) -> bool {
        let size = end - begin;
        let before = self.front(above).is_some_and(|n| begin < n && n <= end + size);
        before && self.front(below).is_some_and(|n| n <= end && n + size > begin)
    }

    /// The scanline that a ray crosses at a depth, in nodes.
    fn crossed(&self, l: u32, beside: f64, at: f64) -> u32 {
        let line = (f64::from(l) + 0.5 + beside * self.lines_per_mm(at)).floor();
        line.clamp(0.0, f64::from(self.frame.scanlines - 1)) as u32
    }

    /// Steps and bands in which neighbours differ, among the scanlines that rays from `widest` mm beside scanline `l` to its node
    /// cross.
    fn different(&self, l: u32, widest: f64) -> Different {
        let mut found = Different::default();
        for step in self.steps() {
            let sent = step.map(|at| self.lines_sent(at.into()).abs());
            let sent = self.deviations(widest) * sent[0].max(sent[1]);
            let received = widest * self.lines_per_mm(step[0].into());
            let reach = received.max(sent).min(1e6).ceil() as u32;
            let pairs = l.saturating_sub(reach)..(l + reach).min(self.frame.scanlines - 1);
            let lose = |band: u32| pairs.clone().any(|l| self.lose_otherwise(l, band));
            let turn = |band: &u32| pairs.clone().any(|l| self.turn_otherwise(l, *band));
            found.losses.extend((step[0]..step[1]).any(lose).then_some(step));
            if self.has_level(l) {
                found.turns.extend((step[0]..step[1]).filter(turn));
            }
        }
        found
    }

    /// True if scanline `l` and the next lose differently in a band.
    fn lose_otherwise(&self, l: u32, band: u32) -> bool {
        let [one, next] = [l, l + 1].map(|l| self.lost_in(l, [band, band + 1]));
        match one.zip(next) {
            Some((one, next)) => apart(one, next, APERTURE_ALIKE),
            None => one != next,
        }
    }

    /// True if scanline `l` and the next turn rays differently in a band.
    fn turn_otherwise(&self, l: u32, band: u32) -> bool {
        apart(self.bent_in(l, band), self.bent_in(l + 1, band), BENT_ALIKE)
    }

    /// For each aperture the mean over its rays of what reaches scanline `l`, over that of its own, nepers of both; and what
    /// rays that miss the target make of speckle around it.
    fn converged(&self, l: u32) -> Found {
        let frame = self.frame;
        let halves = [self.row.transmit_half, self.row.receive_half].map(f64::from);
        let [pitch, _] = line_pitch(frame);
        let widest = halves[0].max(halves[1]);
        let spacing = 2.0 * widest / f64::from(APERTURE_RAYS);
        let different = self.different(l, widest);
        if different.losses.is_empty() && different.turns.is_empty() {
            return Found::default();
        }
        let (mut sums, mut counts) = ([0.0_f64; 2], [0.0_f64; 2]);
        let mut rays = Vec::new();
        for i in 0..APERTURE_RAYS {
            let beside = spacing * (f64::from(i) + 0.5) - widest;
            let first = f64::from(frame.first_line + l) + 0.5;
            let element = first + beside / pitch.max(LEAST_PITCH.into());
            let exists = (0.0..=f64::from(frame.face_lines())).contains(&element);
            if frame.kind != KIND_PHASED && !exists {
                continue;
            }
            let ray = self.followed(l, beside, &different);
            let reached = ray.reached;
            rays.push(ray);
            for ((half, sum), count) in halves.iter().zip(&mut sums).zip(&mut counts) {
                let share = ((half - beside.abs()) / spacing + 0.5).clamp(0.0, 1.0);
                *sum += if share > 0.0 { share * reached } else { 0.0 };
                *count += share;
            }
        }
        let gain = sums.iter().zip(counts).map(|(sum, count)| (sum.max(1e-30) / count).ln()).sum();
        let level = if self.has_level(l) { self.level(&rays) } else { 0.0 };
        Found { gain, level }
    }

    /// The ray from `beside` mm beside scanline `l` on the aperture.
    fn followed(&self, l: u32, beside: f64, different: &Different) -> Ray {
        let (frame, row) = (self.frame, self.row);
        let from = self.deviations(beside);
        let even = f64::from(row.defocus) * from;
        let (mut more, mut missed, mut aside) = (0.0, 0.0, even);
        for &step in &different.losses {
            let [begin, end] = step.map(f64::from);
            let other = self.crossed(l, beside, (begin + end) / 2.0);
            let losses = self.lost_in(other, step).zip(self.lost_in(l, step));
            let ends = [begin, end].map(|at| self.crossed(l, beside, at));
            more += losses.map_or(0.0, |(there, own)| there - own);
            more += if self.crosses_front(ends, step) { lost_of(0.0) } else { 0.0 };
        }
        for &band in &different.turns {
            let middle = f64::from(band) + 0.5;
            let way = f64::from(frame.depth) / f64::from(APERTURE_BANDS)
                * (f64::from(self.node) - middle);
            let own = self.bent_in(l, band);
            missed += (self.bent_beside(l, beside * self.lines_per_mm(middle), band) - own) * way;
            aside += (self.bent_beside(l, from * self.lines_sent(middle), band) - own) * way;
        }
        Ray { from, reached: (-more / 2.0).exp(), missed, even, aside }
    }

    /// Factor on the amplitude of speckle around the target, nepers: of the intensities that a ray of the transmit and one of
    /// the receive aperture leave there, Gaussians as wide as in a focus, the overlap's mean over all pairs, over that of
    /// rays that nothing bends. NaN where one of them is: what comparisons make of that is the device's own.
    fn level(&self, rays: &[Ray]) -> f64 {
        let defocus = f64::from(self.row.defocus);
        let fall = (f64::from(self.row.variances) - defocus * defocus).recip();
        let moves = |ray: &Ray| ray.missed.powi(2).max((ray.aside - ray.even).powi(2)) * fall;
        let spoilt = rays.iter().any(|ray| (ray.missed + ray.aside).is_nan());
        if !spoilt && rays.iter().map(moves).fold(0.0, f64::max) < f64::from(LEAST_MISSED) {
            return 0.0;
        }
        let weight = |ray: &Ray| ray.reached * (-ray.from.powi(2)).exp();
        let overlap = |apart: f64| (-apart * apart * fall).exp();
        let (mut met, mut even) = (0.0, 0.0);
        for sent in rays {
            for heard in rays {
                let weight = weight(sent) * weight(heard);
                met += weight * overlap(sent.aside - heard.missed);
                even += weight * overlap(sent.even);
            }
        }
        let floor = |sum: f64| if sum < 1e-30 { 1e-30 } else { sum };
        (0.5 * (floor(met) / floor(even)).ln()).clamp(LEAST_LEVEL.into(), 0.0)
    }
}

/// True if two numbers are farther apart than what counts as alike, or one of them is none.
fn apart(one: f64, other: f64, alike: f32) -> bool {
    let apart = (one - other).abs();
    apart.is_nan() || apart > f64::from(alike)
}

/// Steps and bands of the way to a target in which neighbouring scanlines differ.
#[derive(Default)]
struct Different {
    /// Steps, as pairs of nodes, in which they lose differently.
    losses: Vec<[u32; 2]>,
    /// Bands in which they turn rays differently.
    turns: Vec<u32>,
}

/// A ray from an aperture to a target.
struct Ray {
    /// Place on the aperture that it comes from, in deviations of that.
    from: f64,
    /// Amplitude that reaches the target, over that of the scanline's own path.
    reached: f64,
    /// By how much it misses the target, mm, over what one on that path does.
    missed: f64,
    /// Distance from the axis, mm, of its like of the transmit aperture at the target's depth if nothing bends it,
    even: f64,
    /// and as it is bent.
    aside: f64,
}

#[cfg(test)]
mod tests;
