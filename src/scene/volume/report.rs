//! The text of `insonify check` about a volume.

use std::fmt;

use glam::DVec3;

use super::{Format, Volume};

fn vector(v: DVec3) -> String {
    // Turns -0 into 0.
    let v = v + DVec3::ZERO;
    format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z)
}

impl fmt::Display for Volume {
    /// Writes format, type, size, placement in LPS and mm, and values, a row each.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.size;
        let spacing = self.spacing();
        let [i, j, k] = self.directions().map(vector);
        let (low, high) = self.bounds();
        writeln!(f, "  {}, {x} x {y} x {z} voxels, {}", self.format.name(), self.stored_as.name())?;
        if !self.later.is_empty() {
            let count = self.later.len() + 1;
            let pace = match self.interval {
                // A period over a count has no short value.
                Some(seconds) => format!("one every {} s", (seconds * 1e12).round() / 1e12),
                // 3D Slicer has layers of a segmentation in these.
                None if self.format == Format::Nrrd => {
                    "or layers of a segmentation: how fast they follow each other is not stated"
                        .to_owned()
                }
                None => "how fast they follow each other is not stated".to_owned(),
            };
            writeln!(f, "  {count} volumes over time, {pace}")?;
        }
        writeln!(f, "  spacing {:.4} x {:.4} x {:.4} mm", spacing.x, spacing.y, spacing.z)?;
        writeln!(f, "  orientation in the file: {}", self.frame.name())?;
        writeln!(f, "  direction of the axes {i}, {j}, {k} in LPS")?;
        writeln!(
            f,
            "  first voxel at {} mm, box {} to {} mm in LPS",
            vector(self.world_from_voxel.translation),
            vector(low),
            vector(high)
        )?;
        let values = self.statistics;
        if values.min > values.max {
            write!(f, "  no value is a finite number")
        } else {
            write!(f, "  values {} to {}, mean {:.3}", values.min, values.max, values.mean)
        }
    }
}
