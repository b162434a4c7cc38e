//! Layout of values in a file: axes of space, of time and others, in any order.

/// Meaning of an axis of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    /// Voxels along an axis of space.
    Space,
    /// Volumes over time.
    Time,
    /// Values of a voxel, of which the first is read.
    Values,
}

/// Sizes of the volumes, and distances of their values in the file.
pub(super) struct Layout {
    /// Voxels along each axis.
    pub size: [usize; 3],
    /// Volumes over time.
    pub volumes: usize,
    /// Values of a voxel, of which the first is read.
    pub channels: usize,
    /// Values from one voxel to the next along each axis.
    steps: [usize; 3],
    /// Values from one volume to the next.
    pace: usize,
}

impl Layout {
    /// The layout for axes in the file's order, the fastest first, each with its size: up to three of space, at
    /// most one of time. A product beyond the number range stays at its maximum, which no file holds.
    pub fn new(axes: impl IntoIterator<Item = (Axis, usize)>) -> Self {
        let mut out = Self { size: [1; 3], volumes: 1, channels: 1, steps: [0; 3], pace: 0 };
        let (mut space, mut step) = (0, 1usize);
        for (axis, count) in axes {
            match axis {
                Axis::Space => {
                    (out.size[space], out.steps[space]) = (count, step);
                    space += 1;
                }
                Axis::Time => (out.volumes, out.pace) = (count, step),
                Axis::Values => out.channels = out.channels.saturating_mul(count),
            }
            step = step.saturating_mul(count);
        }
        out
    }

    /// Returns whether the file's order is that of the voxels: values of a voxel beside each other, the first axis
    /// fastest, one volume after another.
    pub fn is_in_order(&self) -> bool {
        let [x, y, z] = self.size;
        let mut step = self.channels;
        let axes =
            [(x, self.steps[0]), (y, self.steps[1]), (z, self.steps[2]), (self.volumes, self.pace)];
        axes.into_iter().all(|(count, own)| {
            let fits = count == 1 || own == step;
            step = step.saturating_mul(count);
            fits
        })
    }

    /// Number of voxels of one volume; none beyond the number range.
    pub fn voxels(&self) -> Option<u64> {
        product(&self.size)
    }

    /// Number of all values of the file; none beyond the number range.
    pub fn values(&self) -> Option<u64> {
        let [x, y, z] = self.size;
        product(&[x, y, z, self.volumes, self.channels])
    }

    /// Turns planes that follow each other in time into the slices of one volume.
    pub fn stack(&mut self) {
        assert_eq!(self.size[2], 1, "planes");
        (self.size[2], self.steps[2]) = (self.volumes, self.pace);
        (self.volumes, self.pace) = (1, 0);
    }

    /// The first value of each row of a volume, and the step along the row.
    pub fn rows(&self, volume: usize) -> (impl Iterator<Item = usize>, usize) {
        let ([_, y, z], [x_step, y_step, z_step]) = (self.size, self.steps);
        let first = volume * self.pace;
        let slice = move |k: usize| (0..y).map(move |j| first + k * z_step + j * y_step);
        ((0..z).flat_map(slice), x_step)
    }
}

fn product(factors: &[usize]) -> Option<u64> {
    let mut factors = factors.iter();
    factors.try_fold(1u64, |p, &f| p.checked_mul(f as u64))
}
