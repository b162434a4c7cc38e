//! Label maps in memory: a voxel is 0 or belongs to one of up to 254 labels.

use glam::{DAffine3, DMat3, DVec3};

/// A volume of labels.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along each axis, all at least 1.
    pub size: [usize; 3],
    /// Voxel indices (integers at centres) to LPS, mm.
    pub world_from_voxel: DAffine3,
    /// Labels, first axis fastest; 0 belongs to none.
    pub voxels: Vec<u8>,
}

impl Grid {
    /// Largest label. One more value marks voxels for a while.
    pub const MOST: u8 = 254;

    /// Label at these indices; 0 outside.
    pub fn at(&self, [i, j, k]: [isize; 3]) -> u8 {
        let [x, y, z] = self.size.map(|n| n as isize);
        if (0..x).contains(&i) && (0..y).contains(&j) && (0..z).contains(&k) {
            self.voxels[(i + x * (j + y * k)) as usize]
        } else {
            0
        }
    }

    /// Label of the voxel around a point of the world, mm; 0 outside.
    pub fn at_point(&self, voxel_from_world: &DAffine3, point: DVec3) -> u8 {
        let p = voxel_from_world.transform_point3(point).round();
        self.at([p.x as isize, p.y as isize, p.z as isize])
    }

    /// The row of voxels at (j, k); none outside.
    pub fn row(&self, j: isize, k: isize) -> Option<&[u8]> {
        let [x, y, z] = self.size;
        let inside = (0..y as isize).contains(&j) && (0..z as isize).contains(&k);
        inside.then(|| {
            let start = x * (j as usize + y * k as usize);
            &self.voxels[start..start + x]
        })
    }

    /// Distance of voxels along each axis, mm.
    pub fn spacing(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Number of voxels of each label.
    pub fn counts(&self) -> [u64; 256] {
        let mut out = [0; 256];
        for &label in &self.voxels {
            out[usize::from(label)] += 1;
        }
        out
    }

    /// The same at about this distance of voxels, mm, a whole number of which fill the box: each voxel belongs to the
    /// label that most of the voxels in it have, of equals to the one of fewest voxels (so that what is thin stays).
    pub fn resampled(&self, spacing: DVec3) -> Self {
        let own = self.spacing();
        let size = [0, 1, 2]
            .map(|a| ((self.size[a] as f64 * own[a] / spacing[a]).round() as usize).max(1));
        // Voxels of the old grid for one of the new.
        let step = DVec3::from([0, 1, 2].map(|a| self.size[a] as f64 / size[a] as f64));
        let m = self.world_from_voxel.matrix3;
        let columns = [m.x_axis * step.x, m.y_axis * step.y, m.z_axis * step.z];
        let first = self.world_from_voxel.transform_point3((step - 1.0) / 2.0);
        let world_from_voxel = DAffine3::from_mat3_translation(
            DMat3::from_cols(columns[0], columns[1], columns[2]),
            first,
        );
        // The old voxels whose centres lie in a new one; the nearest where there is none.
        let spans = [0, 1, 2].map(|a| {
            let span = |n: usize| {
                let edge = |n: usize| (n as f64 * step[a] - 1e-9).round().max(0.0) as usize;
                let (from, to) = (edge(n), edge(n + 1));
                let nearest = (((n as f64 + 0.5) * step[a]) as usize).min(self.size[a] - 1);
                if from < to { from..to } else { nearest..nearest + 1 }
            };
            (0..size[a]).map(span).collect::<Vec<_>>()
        });
        let all = self.counts();
        let mut voxels = Vec::with_capacity(size.iter().product());
        let mut votes = [0u32; 256];
        let mut seen = Vec::new();
        for z in &spans[2] {
            for y in &spans[1] {
                for x in &spans[0] {
                    for k in z.clone() {
                        for j in y.clone() {
                            let start = self.size[0] * (j + self.size[1] * k);
                            for &label in &self.voxels[start + x.start..start + x.end] {
                                if votes[usize::from(label)] == 0 {
                                    seen.push(label);
                                }
                                votes[usize::from(label)] += 1;
                            }
                        }
                    }
                    let key = |l: &u8| {
                        let l = usize::from(*l);
                        (votes[l], u64::MAX - all[l])
                    };
                    voxels.push(seen.iter().copied().max_by_key(key).unwrap_or(0));
                    for label in seen.drain(..) {
                        votes[usize::from(label)] = 0;
                    }
                }
            }
        }
        Self { size, world_from_voxel, voxels }
    }

    /// Gives to `label` the voxels of 0 that are not connected to the border by voxels of 0. Returns their number.
    pub fn fill_holes(&mut self, label: u8) -> u64 {
        const OUTSIDE: u8 = u8::MAX;
        let [x, y, z] = self.size;
        // One voxel of each run along x that is still to be visited: runs are few where voxels are many.
        let mut todo: Vec<usize> = Vec::new();
        for k in 0..z {
            for j in 0..y {
                let border = j == 0 || k == 0 || j + 1 == y || k + 1 == z;
                let step = if border { 1 } else { (x - 1).max(1) };
                todo.extend((0..x).step_by(step).map(|i| i + x * (j + y * k)));
                while let Some(at) = todo.pop() {
                    if self.voxels[at] != 0 {
                        continue;
                    }
                    let row = at - at % x;
                    let before = self.voxels[row..at].iter().rposition(|v| *v != 0);
                    let after = self.voxels[at..row + x].iter().position(|v| *v != 0);
                    let run =
                        before.map_or(row, |n| row + n + 1)..after.map_or(row + x, |n| at + n);
                    self.voxels[run.clone()].fill(OUTSIDE);
                    let (j, k) = (at / x % y, at / (x * y));
                    let rows = [
                        (j > 0).then(|| run.start.wrapping_sub(x)),
                        (j + 1 < y).then(|| run.start + x),
                        (k > 0).then(|| run.start.wrapping_sub(x * y)),
                        (k + 1 < z).then(|| run.start + x * y),
                    ];
                    for start in rows.into_iter().flatten() {
                        let beside = &self.voxels[start..start + run.len()];
                        let first = |n: &usize| beside[*n] == 0 && (*n == 0 || beside[n - 1] != 0);
                        todo.extend((0..run.len()).filter(first).map(|n| start + n));
                    }
                }
            }
        }
        let mut filled = 0;
        for voxel in &mut self.voxels {
            *voxel = match *voxel {
                OUTSIDE => 0,
                0 => {
                    filled += 1;
                    label
                }
                other => other,
            };
        }
        filled
    }
}
