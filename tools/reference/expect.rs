//! Twin of `expect`: the expected power of the scatterers' echoes in each sample.

use glam::DAffine3;

use super::scatter::{Tube, is_finite};
use super::world::World;
use super::{Accumulator, Segment};
use insonify::sim::layout::FLAG_VOXEL;

/// Power of each sample, [L][K]: what came straight, and what was reflected before. `speckle` has the power of
/// speckle of 0 dB that nothing weakens, by sample and layer.
pub fn expect(world: &World, segments: &[Segment], speckle: &[f32]) -> Vec<[f64; 2]> {
    let frame = world.frame;
    let clock = Accumulator::new(frame);
    let mut sums = vec![[0.0; 2]; frame.scanlines as usize * frame.samples as usize];
    for segment in segments.iter().filter(|s| is_finite(s)) {
        let tube = Tube::new(world, segment, DAffine3::IDENTITY, None);
        if !tube.sounds() {
            continue;
        }
        let tissue = &world.tissues[segment.tissue as usize];
        let (scanline, layer) = (segment.line % frame.scanlines, segment.line / frame.scanlines);
        let behind = segment.time + segment.length / f64::from(tissue.speed);
        let ends = [segment.time, behind].map(|time| clock.kappa(time));
        for k in 0..frame.samples {
            let from = ends[0].max(f64::from(k) - 0.5);
            let to = ends[1].min(f64::from(k) + 0.5);
            if from >= to {
                continue;
            }
            let x = tube.distance((from + to) / 2.0);
            let row = &world.rows[k as usize];
            let echo = tube.weight(x, row) * tube.absorbed(x) * f64::from(tissue.level).exp2();
            let mut power = echo * echo * (to - from);
            if frame.flags & FLAG_VOXEL == 0 {
                // Fainter by as much as the beam would be wider; a sample is as much longer as sound is faster.
                power *= f64::from(tissue.speed) / f64::from(frame.speed);
                power *= tube.scattered(x, row).powi(2);
            }
            let at = (scanline * frame.samples + k) as usize;
            let unit = f64::from(speckle[(k * frame.layers + layer) as usize]);
            sums[at][usize::from(segment.reflected)] += power * unit;
        }
    }
    sums
}
