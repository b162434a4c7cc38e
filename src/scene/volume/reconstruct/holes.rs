//! Filling of voxels that no pixel reached.

use rayon::prelude::*;

use super::Filling;
use super::insert::Sums;

/// Half of the 26 directions to neighbours; the others are their opposites.
const STICKS: [[isize; 3]; 13] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
    [1, 1, 0],
    [1, 0, 1],
    [0, 1, 1],
    [1, -1, 0],
    [1, 0, -1],
    [0, 1, -1],
    [1, 1, 1],
    [-1, 1, 1],
    [1, -1, 1],
    [-1, -1, 1],
];

/// Values with holes filled, and the number of filled ones. Only voxels that pixels reached are a source.
pub(super) fn fill(values: Vec<f32>, sums: &Sums, ways: &[Filling]) -> (Vec<f32>, usize) {
    if ways.is_empty() {
        return (values, 0);
    }
    let [x, y, _] = sums.size();
    let volume = Reached { values: &values, sums };
    let mut out = values.clone();
    let filled = out
        .par_chunks_mut(x * y)
        .enumerate()
        .map(|(k, slice)| {
            let mut filled = 0;
            for (at, value) in slice.iter_mut().enumerate() {
                if sums.is_reached(at + k * x * y) {
                    continue;
                }
                let voxel = [at % x, at / x, k].map(|n| n as isize);
                let found = ways.iter().find_map(|way| match *way {
                    Filling::Stick { length, count } => volume.sticks(voxel, length, count),
                    Filling::Nearest { size, share } => volume.nearest(voxel, size, share),
                });
                if let Some(found) = found {
                    *value = found;
                    filled += 1;
                }
            }
            filled
        })
        .sum();
    (out, filled)
}

struct Reached<'v> {
    values: &'v [f32],
    sums: &'v Sums,
}

impl Reached<'_> {
    /// Value of a voxel that a pixel reached; an error outside the volume.
    fn get(&self, at: [isize; 3]) -> Result<Option<f32>, ()> {
        let size = self.sums.size();
        let inside = (0..3).all(|a| at[a] >= 0 && at[a] < size[a] as isize);
        if !inside {
            return Err(());
        }
        let [i, j, k] = at.map(|n| n as usize);
        let index = i + size[0] * (j + size[1] * k);
        Ok(self.sums.is_reached(index).then(|| self.values[index]))
    }

    /// Steps to the first voxel along a direction that a pixel reached, at most `limit`, and its
    /// value.
    fn walk(&self, from: [isize; 3], step: [isize; 3], limit: usize) -> Option<(usize, f32)> {
        for count in 1..=limit {
            let at = [0, 1, 2].map(|a| from[a] + count as isize * step[a]);
            match self.get(at) {
                Err(()) => return None,
                Ok(Some(value)) => return Some((count, value)),
                Ok(None) => {}
            }
        }
        None
    }

    fn sticks(&self, at: [isize; 3], length: usize, count: usize) -> Option<f32> {
        let mut found = Vec::new();
        for step in STICKS {
            let Some((forward, after)) = self.walk(at, step, length.saturating_sub(1)) else {
                continue;
            };
            let rest = length.saturating_sub(forward + 1);
            let Some((back, before)) = self.walk(at, step.map(|s| -s), rest) else {
                continue;
            };
            // PLUS counts the voxels of the line, both ends included, and takes them for its
            // length: the ends weigh by (steps to the other end + 1), the rest goes to the other.
            let voxels = (forward + back + 1) as f32;
            let weight = (back + 1) as f32 / voxels;
            let squared: isize = step.iter().map(|s| s * s).sum();
            let line = voxels * (squared as f32).sqrt();
            found.push((line, weight * after + (1.0 - weight) * before));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Lines as long as the last used one are also used.
        let last = found.get(count.max(1).min(found.len()).checked_sub(1)?)?.0;
        let used = found.iter().take_while(|(line, _)| *line <= last);
        let (sum, weights) =
            used.fold((0.0, 0.0), |(s, w), (line, value)| (s + value / line, w + 1.0 / line));
        Some(sum / weights)
    }

    fn nearest(&self, at: [isize; 3], size: usize, share: f64) -> Option<f32> {
        let reach = size.saturating_sub(1) as isize / 2;
        for range in 1..=reach {
            let (mut sum, mut count) = (0.0, 0);
            let around = -range..=range;
            for dx in around.clone() {
                for dy in around.clone() {
                    for dz in around.clone() {
                        let [i, j, k] = at;
                        if let Ok(Some(value)) = self.get([i + dx, j + dy, k + dz]) {
                            sum += f64::from(value);
                            count += 1;
                        }
                    }
                }
            }
            if count > 0 {
                let enough = f64::from(count) / (size as f64).powi(3) > share;
                return enough.then(|| (sum / f64::from(count)) as f32);
            }
        }
        None
    }
}
