//! The samples of the scanlines around the mask.

use crate::probe::Probe;
use crate::scene::{Acquired, Scene};
use crate::sim::fusion::FusionSteps;
use crate::sim::layout::Frame;

/// Least share of samples above black within [`HALF_WINDOW`]; with less the place is fluid, shadow, or
/// was never acquired, and shows no speckle.
const LEAST_ECHOING: f64 = 0.5;
/// Half the edge of the square around a sample in which it is judged, mm.
const HALF_WINDOW: f64 = 1.0;

/// Samples around the mask, [L][K].
pub(super) struct Band {
    /// Distance from the mask's border in the image, mm, of samples that belong to the band; NaN of others.
    distance: Vec<f32>,
    /// True where the acquired volume has a value.
    acquired: Vec<bool>,
    lines: usize,
    samples: usize,
}

impl Band {
    /// The samples of `scene` up to `width` mm outside its mask, whose last frame was `frame` with the
    /// intermediate `steps`. Those behind the mask do not belong to it: the sound of the simulation has gone
    /// through what is inside the mask, that of the volume through something else.
    pub fn new(
        scene: &Scene,
        acquired: &Acquired,
        frame: &Frame,
        steps: &FusionSteps,
        width: f64,
    ) -> Self {
        let probe = &scene.probe;
        let (lines, samples) = (probe.scanlines as usize, probe.samples as usize);
        let (columns, rows) = (frame.image_width as usize, frame.image_height as usize);
        // 1 is the volume, 0 the simulation.
        let masked = |i: usize| steps.simulated[4 * i + 3] > 0 && steps.mask[i] < 0.5;
        let to_mask = squared_distances(columns, rows, masked);
        let voxel_from_probe = acquired.world_from_voxel.inverse() * scene.world_from_probe;
        let mut band = Self {
            distance: vec![f32::NAN; lines * samples],
            acquired: vec![false; lines * samples],
            lines,
            samples,
        };
        for l in 0..lines {
            let (mut origin, direction) = probe.ray(l as u32, 0);
            origin.y = 0.0;
            for k in 0..samples {
                let at = l * samples + k;
                if steps.prescan[2 * at] < 0.5 {
                    break;
                }
                let p = origin + k as f64 * probe.sample_pitch() * direction;
                let v = voxel_from_probe.transform_point3(p).to_array();
                let within = |(x, n): (&f64, &usize)| (-0.5..=*n as f64 - 0.5).contains(x);
                band.acquired[at] = v.iter().zip(&acquired.size).all(within);
                let pitch = f64::from(frame.pixel_pitch);
                let column = (p.x - f64::from(frame.image_left)) / pitch;
                let row = (p.z - f64::from(frame.image_top)) / pitch;
                if !(0.0..columns as f64).contains(&column) || !(0.0..rows as f64).contains(&row) {
                    continue;
                }
                let pixel = row as usize * columns + column as usize;
                // Half a pixel lies between the border and the pixels beside it.
                let distance = (to_mask[pixel].sqrt() - 0.5) * pitch;
                if distance > 0.0 && distance <= width {
                    band.distance[at] = distance as f32;
                }
            }
        }
        band
    }

    /// True if no sample belongs to it.
    pub fn is_empty(&self) -> bool {
        self.distance.iter().all(|d| d.is_nan())
    }

    /// Those of `values`, one for each sample, that belong to the band.
    pub fn of<'v, T>(&self, values: &'v [T]) -> impl Iterator<Item = &'v T> {
        let all = self.distance.iter().zip(values);
        all.filter(|(d, _)| !d.is_nan()).map(|(_, value)| value)
    }

    /// Removes the samples of which `wanted` is false.
    pub fn keep(&mut self, wanted: impl Fn(usize) -> bool) {
        for (at, distance) in self.distance.iter_mut().enumerate() {
            if !wanted(at) {
                *distance = f32::NAN;
            }
        }
    }

    /// Removes the samples that were not acquired.
    pub fn keep_acquired(&mut self) {
        let acquired = std::mem::take(&mut self.acquired);
        self.keep(|at| acquired[at]);
    }

    /// True for samples of the band that are farther than `margin` of their row from the mask's border.
    pub fn chosen(&self, margin: impl Fn(usize) -> f64) -> Vec<bool> {
        let margins: Vec<f64> = (0..self.samples).map(margin).collect();
        let far = |(i, &d): (usize, &f32)| f64::from(d) > margins[i % self.samples];
        self.distance.iter().enumerate().map(far).collect()
    }

    /// Removes the samples around which most is black: `floor` of the row.
    pub fn keep_echoing(&self, probe: &Probe, levels: &[f32], floor: &[f32], chosen: &mut [bool]) {
        let (lines, samples) = (self.lines, self.samples);
        // Sums of both over all scanlines and rows before.
        let mut sums = vec![[0u32; 2]; (lines + 1) * (samples + 1)];
        for l in 0..lines {
            let mut row = [0u32; 2];
            for k in 0..samples {
                let at = l * samples + k;
                if chosen[at] {
                    row[0] += 1;
                    row[1] += u32::from(levels[at] > floor[k]);
                }
                let before = sums[l * (samples + 1) + k + 1];
                sums[(l + 1) * (samples + 1) + k + 1] = [before[0] + row[0], before[1] + row[1]];
            }
        }
        let rows = (HALF_WINDOW / probe.sample_pitch()) as usize;
        for k in 0..samples {
            let pitch = probe.line_pitch(k as f64 * probe.sample_pitch());
            let columns = ((HALF_WINDOW / pitch.max(1e-9)) as usize).clamp(1, lines);
            let (k0, k1) = (k.saturating_sub(rows), (k + rows + 1).min(samples));
            for l in 0..lines {
                let (l0, l1) = (l.saturating_sub(columns), (l + columns + 1).min(lines));
                let sum = |i: usize| {
                    let at = |l: usize, k: usize| sums[l * (samples + 1) + k][i];
                    f64::from(at(l1, k1) + at(l0, k0) - at(l0, k1) - at(l1, k0))
                };
                let at = l * samples + k;
                chosen[at] &= sum(1) > LEAST_ECHOING * sum(0);
            }
        }
    }
}

/// Squared distance of each pixel, in pixels, from the nearest `wanted` one; infinite where there is
/// none (Felzenszwalb and Huttenlocher, Distance transforms of sampled functions, 2012).
fn squared_distances(width: usize, height: usize, wanted: impl Fn(usize) -> bool) -> Vec<f64> {
    let seed = |i| if wanted(i) { 0.0 } else { f64::INFINITY };
    let mut out: Vec<f64> = (0..width * height).map(seed).collect();
    let mut column = vec![0.0; height];
    for x in 0..width {
        (0..height).for_each(|y| column[y] = out[y * width + x]);
        let envelope = lower_envelope(&column);
        (0..height).for_each(|y| out[y * width + x] = envelope[y]);
    }
    for row in out.chunks_mut(width) {
        let envelope = lower_envelope(row);
        row.copy_from_slice(&envelope);
    }
    out
}

/// min over p of (q - p)^2 + f(p) for each q: the lower envelope of parabolas.
fn lower_envelope(f: &[f64]) -> Vec<f64> {
    // The parabola at each place begins to be the lowest at the second number.
    let mut lowest: Vec<(usize, f64)> = Vec::new();
    let height = |p: usize| f[p] + (p * p) as f64;
    for q in (0..f.len()).filter(|&q| f[q].is_finite()) {
        let mut from = f64::NEG_INFINITY;
        while let Some(&(p, begins)) = lowest.last() {
            from = (height(q) - height(p)) / (2.0 * (q - p) as f64);
            if from > begins {
                break;
            }
            lowest.pop();
            from = f64::NEG_INFINITY;
        }
        lowest.push((q, from));
    }
    let mut current = 0;
    let at = |q: usize| {
        while lowest.get(current + 1).is_some_and(|next| next.1 < q as f64) {
            current += 1;
        }
        lowest.get(current).map_or(f64::INFINITY, |&(p, _)| {
            let step = q.abs_diff(p) as f64;
            step * step + f[p]
        })
    };
    (0..f.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_nearest() {
        let (width, height) = (23, 17);
        let wanted = |i: usize| [5, 200, 201, 377].contains(&i);
        let place = |i: usize| ((i % width) as f64, (i / width) as f64);
        let found = squared_distances(width, height, wanted);
        for (i, found) in found.iter().enumerate() {
            let (x, y) = place(i);
            let all = (0..width * height).filter(|&j| wanted(j)).map(|j| {
                let (a, b) = place(j);
                (x - a).powi(2) + (y - b).powi(2)
            });
            let nearest = all.fold(f64::INFINITY, f64::min);
            assert_eq!(*found, nearest, "pixel {i}");
        }
        let none = squared_distances(width, height, |_| false);
        assert!(none.iter().all(|d| d.is_infinite()));
    }
}
