//! Twin of `aperture`: losses by the part of the aperture that they lie in front of.

use super::geometry::line_pitch;
use insonify::sim::layout::{
    APERTURE_ALIKE, APERTURE_BANDS, APERTURE_FRONT, APERTURE_JUMP, APERTURE_RAYS, FLAG_APERTURE,
    Frame, KIND_PHASED, LEAST_MAIN, LEAST_PITCH, Row,
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

/// Place of a line's node in the tables.
pub fn place(frame: &Frame, line: u32, node: u32) -> usize {
    let (layer, l) = (line / frame.scanlines, line % frame.scanlines);
    ((layer * (APERTURE_BANDS + 1) + node) * frame.scanlines + l) as usize
}

/// One-way time of a node, us.
pub fn time_of(frame: &Frame, node: u32) -> f64 {
    f64::from(frame.depth) / f64::from(frame.speed) * f64::from(node) / f64::from(APERTURE_BANDS)
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
    let bands = f64::from(APERTURE_BANDS);
    let way = (time * f64::from(frame.speed) / f64::from(frame.depth)).clamp(0.0, 1.0) * bands;
    let node = (way.floor() as u32).min(APERTURE_BANDS - 1);
    let [above, below] = [node, node + 1].map(|node| at(place(frame, line, node)));
    let jump = below[1] - above[1];
    let part = match jump > f64::from(APERTURE_JUMP) {
        true => ((lost - above[1]) / jump).clamp(0.0, 1.0),
        false => way - f64::from(node),
    };
    above[0] + part * (below[0] - above[0])
}

/// The factors of all nodes, nepers, from the losses of their main paths.
pub fn aperture(frame: &Frame, rows: &[Row], lost: &[f64]) -> Vec<f64> {
    let mut gains = vec![0.0; lost.len()];
    if lost.is_empty() {
        return gains;
    }
    for layer in 0..frame.layers {
        for node in 1..=APERTURE_BANDS {
            let depth = f64::from(frame.depth) * f64::from(node) / f64::from(APERTURE_BANDS);
            let row = (depth / f64::from(frame.sample_pitch)).floor() as usize;
            let row = &rows[row.min(rows.len() - 1)];
            let halves = [row.transmit_half, row.receive_half].map(f64::from);
            let target = Target { frame, lost, layer, node };
            for l in 0..frame.scanlines {
                let line = layer * frame.scanlines + l;
                gains[place(frame, line, node)] = target.converged(l, halves);
            }
        }
    }
    gains
}

/// The targets at a node of a layer.
struct Target<'a> {
    frame: &'a Frame,
    lost: &'a [f64],
    layer: u32,
    node: u32,
}

impl Target<'_> {
    /// Loss of scanline `l` between two nodes; none where it was not followed.
    fn lost_in(&self, l: u32, [begin, end]: [u32; 2]) -> Option<f64> {
        let line = self.layer * self.frame.scanlines + l;
        let [above, below] = [begin, end].map(|n| self.lost[place(self.frame, line, n)]);
        (above != UNKNOWN && below != UNKNOWN).then_some(below - above)
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
        let [pitch, growth] = line_pitch(self.frame);
        let depth = f64::from(self.frame.depth) * at / f64::from(APERTURE_BANDS);
        (1.0 - at / f64::from(self.node)) / (pitch + depth * growth).max(LEAST_PITCH.into())
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

    /// True if in some band of a step neighbours among the scanlines that rays from `widest` mm beside scanline `l` cross
    /// lose differently.
    fn unlike(&self, l: u32, step: [u32; 2], widest: f64) -> bool {
        let reach = (widest * self.lines_per_mm(step[0].into())).min(1e6).ceil() as u32;
        let last = (l + reach).min(self.frame.scanlines - 1);
        (l.saturating_sub(reach)..last).any(|l| {
            (step[0]..step[1]).any(|band| {
                let [one, next] = [l, l + 1].map(|l| self.lost_in(l, [band, band + 1]));
                match one.zip(next) {
                    Some((one, next)) => (one - next).abs() > f64::from(APERTURE_ALIKE),
                    None => one != next,
                }
            })
        })
    }

    /// For each aperture, half as wide as one of `halves`, the mean over its rays of what reaches scanline `l`, over that
    /// of its own; nepers of both.
    fn converged(&self, l: u32, halves: [f64; 2]) -> f64 {
        let frame = self.frame;
        let [pitch, _] = line_pitch(frame);
        let widest = halves[0].max(halves[1]);
        let spacing = 2.0 * widest / f64::from(APERTURE_RAYS);
        let steps: Vec<[u32; 2]> =
            self.steps().into_iter().filter(|step| self.unlike(l, *step, widest)).collect();
        if steps.is_empty() {
            return 0.0;
        }
        let (mut sums, mut counts) = ([0.0_f64; 2], [0.0_f64; 2]);
        for i in 0..APERTURE_RAYS {
            let beside = spacing * (f64::from(i) + 0.5) - widest;
            let first = f64::from(frame.first_line + l) + 0.5;
            let element = first + beside / pitch.max(LEAST_PITCH.into());
            let exists = (0.0..=f64::from(frame.face_lines())).contains(&element);
            if frame.kind != KIND_PHASED && !exists {
                continue;
            }
            let more = steps.iter().map(|&step| {
                let [begin, end] = step.map(f64::from);
                let other = self.crossed(l, beside, (begin + end) / 2.0);
                let losses = self.lost_in(other, step).zip(self.lost_in(l, step));
                let ends = [begin, end].map(|at| self.crossed(l, beside, at));
                let blocked = if self.crosses_front(ends, step) { lost_of(0.0) } else { 0.0 };
                losses.map_or(0.0, |(there, own)| there - own) + blocked
            });
            let reached = (-more.sum::<f64>() / 2.0).exp();
            for ((half, sum), count) in halves.iter().zip(&mut sums).zip(&mut counts) {
                let share = ((half - beside.abs()) / spacing + 0.5).clamp(0.0, 1.0);
                *sum += if share > 0.0 { share * reached } else { 0.0 };
                *count += share;
            }
        }
        sums.iter().zip(counts).map(|(sum, count)| (sum.max(1e-30) / count).ln()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use insonify::sim::layout::KIND_LINEAR;

    /// A linear array of 101 lines of 0.2 mm, a band for each mm, f/2; lines left of the middle lose `nepers` from 16 mm on.
    fn half_plane(nepers: f64) -> (Frame, Vec<Row>, Vec<f64>) {
        let frame = Frame {
            kind: KIND_LINEAR,
            scanlines: 101,
            layers: 1,
            samples: 10 * APERTURE_BANDS,
            depth: APERTURE_BANDS as f32,
            sample_pitch: 0.1,
            width: 20.2,
            speed: 1.54,
            ..Frame::default()
        };
        let rows = (0..10 * APERTURE_BANDS).map(|k| {
            let half = 0.1 * k as f32 / 4.0;
            Row { transmit_half: half, receive_half: half, ..Row::default() }
        });
        let mut lost = vec![0.0; 101 * (APERTURE_BANDS as usize + 1)];
        for line in 0..50 {
            for node in 17..=APERTURE_BANDS {
                lost[place(&frame, line, node)] = nepers;
            }
        }
        (frame, rows.collect(), lost)
    }

    #[test]
    fn behind_a_half_plane_the_amplitude_is_the_square_of_the_free_part_of_the_aperture() {
        let (frame, rows, lost) = half_plane(46.0);
        let gains = aperture(&frame, &rows, &lost);
        for node in [20, 32, 40] {
            // Width of the aperture where it passes the plane, in the middle of the band.
            let width = f64::from(node) / 2.0 * (1.0 - 16.5 / f64::from(node));
            for line in 30..70 {
                let left =
                    (gains[place(&frame, line, node)] - lost[place(&frame, line, node)]).exp();
                let beside = (f64::from(line) - 49.5) * 0.2;
                let free = (0.5 + beside / width).clamp(0.0, 1.0);
                // A ray of 16, the line that it falls on, and where in a step of four bands the plane lies.
                let step = 2.0 / (f64::from(node) - 16.5) * beside.abs() / width;
                let allowed = 1.0 / 16.0 + 0.1 / width + step;
                assert!((left.sqrt() - free).abs() < allowed, "{node} {line}: {left} {free}");
            }
        }
    }

    #[test]
    fn what_all_lines_lose_alike_changes_nothing_and_little_losses_add_up_to_their_mean() {
        let (frame, rows, lost) = half_plane(0.0);
        assert!(aperture(&frame, &rows, &lost).iter().all(|&gain| gain == 0.0));
        // 1 % of the amplitude on one side: on the border the mean is half of it.
        let (frame, rows, lost) = half_plane(0.01);
        let gains = aperture(&frame, &rows, &lost);
        let at = place(&frame, 50, 40);
        assert!((gains[at] + 0.005).abs() < 5e-4, "{}", gains[at]);
    }

    #[test]
    fn an_inclined_surface_is_passed_by_no_ray() {
        // Lines lose everything where a surface falls by 60 degrees across them: 0.35 mm, or bands, per line.
        let (frame, rows, mut lost) = half_plane(0.0);
        for line in 0..101 {
            for node in 0..=APERTURE_BANDS {
                let behind = f64::from(node) >= 3.0 + 0.35 * f64::from(line);
                lost[place(&frame, line, node)] = if behind { 46.0 } else { 0.0 };
            }
        }
        let gains = aperture(&frame, &rows, &lost);
        for (line, node) in [(20, 30), (40, 40), (60, 46)] {
            // A tenth of the rays may slip through: 20 dB on either way.
            let left = gains[place(&frame, line, node)] - 46.0;
            assert!(left < -4.0, "{line} {node}: {left}");
        }
    }

    #[test]
    fn in_front_of_a_surface_counts_what_is_there() {
        let frame = half_plane(0.0).0;
        let table = |at: usize| if at == place(&frame, 3, 17) { [30.0, 40.0] } else { [0.0, 0.0] };
        let time = 1.54_f64.recip() * 16.4;
        assert_eq!(nepers(&frame, table, 3, time, 0.0), 0.0);
        assert_eq!(nepers(&frame, table, 3, time, 40.0), 30.0);
        // Without a surface in between, as deep as it is.
        let even = |at: usize| if at == place(&frame, 3, 17) { [0.3, 0.1] } else { [0.1, 0.0] };
        assert!((nepers(&frame, even, 3, time, 0.0) - 0.18).abs() < 1e-6);
    }
}
