//! Insertion of pixels into voxels.

use glam::{DAffine3, DVec3};

use super::{Compounding, Fan, Interpolation, Lattice, Settings};
use crate::issue::FileError;
use crate::volume::Sequence;

/// Weight of trilinear interpolation in the middle between eight voxels: maximum and latest ignore pixels
/// of less weight.
const MIN_WEIGHT: f64 = 0.125;
/// Offset that PLUS adds before it rounds, so that a coordinate a rounding below a half is not lost.
const TOLERANCE: f64 = 1.0 / 131_072.0;

/// The pixels to insert.
pub(super) struct Source<'s> {
    sequence: &'s Sequence,
    /// First and last pixel along x and y, in the directions marked and far.
    x: [i32; 2],
    y: [i32; 2],
    flip: [bool; 2],
    fan: Option<Fan>,
    reject_below: f64,
}

impl<'s> Source<'s> {
    pub fn new(sequence: &'s Sequence, settings: &Settings) -> Result<Self, FileError> {
        let orientation = sequence.orientation.as_deref().unwrap_or("MF");
        let mut letters = orientation.chars();
        let flip = match (letters.next(), letters.next()) {
            (Some('M'), Some('F')) => [false, false],
            (Some('U'), Some('F')) => [true, false],
            (Some('M'), Some('N')) => [false, true],
            (Some('U'), Some('N')) => [true, true],
            _ => {
                return Err(FileError::data(
                    format!("the orientation `{orientation}` of the pixels is none of an image"),
                    "give scan-converted images, `MF` or one of its mirror images",
                ));
            }
        };
        let [width, height] = sequence.size.map(|n| n as i32);
        let [x, y, w, h] = settings.clip.unwrap_or([0, 0, width, height]);
        let range = |first: i32, count: i32, size: i32| {
            [first.max(0), first.saturating_add(count).min(size - 1)]
        };
        let (x, y) = (range(x, w, width), range(y, h, height));
        if x[0] > x[1] || y[0] > y[1] {
            return Err(FileError::data(
                format!("the clip rectangle lies outside the {width} x {height} pixels"),
                "give x, y, width and height in pixels of the frames",
            ));
        }
        Ok(Self {
            sequence,
            x,
            y,
            flip,
            fan: settings.fan,
            reject_below: settings.reject_below.unwrap_or(f64::NEG_INFINITY),
        })
    }

    /// Corners of the used part, pixels.
    pub fn corners(&self) -> [DVec3; 4] {
        let at = |x: i32, y: i32| DVec3::new(f64::from(x), f64::from(y), 0.0);
        let ([x0, x1], [y0, y1]) = (self.x, self.y);
        [at(x0, y0), at(x0, y1), at(x1, y0), at(x1, y1)]
    }

    fn value(&self, frame: usize, x: i32, y: i32) -> f64 {
        let [width, height] = self.sequence.size;
        let along = |at: i32, size: usize, flip: bool| {
            let at = at as usize;
            if flip { size - 1 - at } else { at }
        };
        let (x, y) = (along(x, width, self.flip[0]), along(y, height, self.flip[1]));
        let index = self.sequence.first_pixel(frame) + x + width * y;
        self.sequence.pixels.get(index)
    }

    fn in_fan(&self, x: i32, y: i32) -> bool {
        let Some(fan) = self.fan else { return true };
        let (x, y) = (f64::from(x) - fan.origin[0], f64::from(y) - fan.origin[1]);
        let (angle, radius) = (x.atan2(y).to_degrees(), x.hypot(y));
        (fan.angles[0]..=fan.angles[1]).contains(&angle)
            && (fan.radii[0]..=fan.radii[1]).contains(&radius)
    }
}

/// Sums of the pixels that went into each voxel.
pub(super) struct Sums {
    size: [usize; 3],
    interpolation: Interpolation,
    compounding: Compounding,
    /// Sum of weight times value, or the value itself where there is one.
    value: Vec<f32>,
    /// Sum of weights.
    weight: Vec<f32>,
}

impl Sums {
    pub fn new(lattice: &Lattice, settings: &Settings) -> Self {
        let count = lattice.size().iter().product();
        Self {
            size: lattice.size(),
            interpolation: settings.interpolation,
            compounding: settings.compounding,
            value: vec![0.0; count],
            weight: vec![0.0; count],
        }
    }

    /// Voxels along each axis.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Returns whether a pixel reached this voxel.
    pub fn is_reached(&self, voxel: usize) -> bool {
        self.weight[voxel] > 0.0
    }

    /// Number of voxels that pixels reached.
    pub fn reached(&self) -> usize {
        self.weight.iter().filter(|w| **w > 0.0).count()
    }

    /// Values of the voxels, 0 where no pixel came.
    pub fn values(&self) -> Vec<f32> {
        if self.compounding != Compounding::Mean {
            return self.value.clone();
        }
        let pairs = self.value.iter().zip(&self.weight);
        pairs.map(|(sum, weight)| if *weight > 0.0 { sum / weight } else { 0.0 }).collect()
    }

    /// Adds the pixels of a frame.
    pub fn insert(&mut self, source: &Source, frame: usize, voxel_from_image: DAffine3) {
        let step = voxel_from_image.matrix3.x_axis;
        for y in source.y[0]..=source.y[1] {
            let row = DVec3::new(0.0, f64::from(y), 0.0);
            let row = voxel_from_image.transform_point3(row);
            for x in source.x[0]..=source.x[1] {
                let value = source.value(frame, x, y);
                if value < source.reject_below || !source.in_fan(x, y) {
                    continue;
                }
                let at = row + f64::from(x) * step;
                match self.interpolation {
                    Interpolation::Nearest => self.nearest(at, value),
                    Interpolation::Linear => self.linear(at, value),
                }
            }
        }
    }

    fn index(&self, at: DVec3) -> Option<usize> {
        let [x, y, z] = self.size;
        let inside =
            at.cmpge(DVec3::ZERO).all() && at.x < x as f64 && at.y < y as f64 && at.z < z as f64;
        inside.then(|| at.x as usize + x * (at.y as usize + y * at.z as usize))
    }

    fn nearest(&mut self, at: DVec3, value: f64) {
        if let Some(voxel) = self.index((at + (0.5 + TOLERANCE)).floor()) {
            self.put(voxel, 1.0, value);
        }
    }

    fn linear(&mut self, at: DVec3, value: f64) {
        let low = (at + TOLERANCE).floor();
        // A coordinate a rounding below a voxel counts as that voxel.
        let part = (at - low).max(DVec3::ZERO);
        let high = low + DVec3::select(part.cmpgt(DVec3::ZERO), DVec3::ONE, DVec3::ZERO);
        // As in PLUS, a pixel that is not surrounded by all eight voxels is dropped.
        if self.index(low).is_none() || self.index(high).is_none() {
            return;
        }
        for corner in 0..8u32 {
            let upper = [0, 1, 2].map(|axis| corner >> axis & 1 == 1);
            let weights = [0, 1, 2].map(|a| if upper[a] { part[a] } else { 1.0 - part[a] });
            let weight = weights[0] * weights[1] * weights[2];
            let voxel = DVec3::from([0, 1, 2].map(|a| if upper[a] { high[a] } else { low[a] }));
            if weight > 0.0
                && let Some(voxel) = self.index(voxel)
            {
                self.put(voxel, weight, value);
            }
        }
    }

    fn put(&mut self, voxel: usize, weight: f64, value: f64) {
        let (sum, sum_of_weights) = (&mut self.value[voxel], &mut self.weight[voxel]);
        let (weight_, value) = (weight as f32, value as f32);
        match self.compounding {
            Compounding::Mean => {
                *sum += weight_ * value;
                *sum_of_weights += weight_;
            }
            _ if weight < MIN_WEIGHT => {}
            Compounding::Maximum => {
                if *sum_of_weights == 0.0 || value > *sum {
                    *sum = value;
                }
                *sum_of_weights = 1.0;
            }
            Compounding::Latest => {
                *sum = value;
                *sum_of_weights = 1.0;
            }
        }
    }
}
