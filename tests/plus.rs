//! A sweep of PLUS, compared with the volume that PLUS made of it: first by our reconstruction, then by PLUS's
//! arithmetic written here, which explains the difference.

use std::path::Path;

use glam::{DAffine3, DVec3};
use insonify::volume::{Compounding, Config, Sequence, Volume, reconstruct};

use crate::common::shared_data::shared_data;

/// Differences of a volume from the stored one.
#[derive(Debug)]
struct Figures {
    /// Shares of voxels that are equal, and that are within 2 grey levels.
    equal: f64,
    close: f64,
    /// Mean difference and root of the mean square, grey levels.
    mean: f64,
    rms: f64,
}

fn compare(size: [usize; 3], value: impl Fn([usize; 3]) -> f64, stored: &Volume) -> Figures {
    let [x, y, z] = [0, 1, 2].map(|a| size[a].min(stored.size[a]));
    let (mut equal, mut close, mut sum, mut square) = (0u32, 0u32, 0.0, 0.0);
    for k in 0..z {
        for (j, i) in (0..y).flat_map(|j| (0..x).map(move |i| (j, i))) {
            let difference = value([i, j, k]) - stored.value([i, j, k]);
            equal += u32::from(difference == 0.0);
            close += u32::from(difference.abs() <= 2.0);
            sum += difference;
            square += difference * difference;
        }
    }
    let count = (x * y * z) as f64;
    Figures {
        equal: f64::from(equal) / count,
        close: f64::from(close) / count,
        mean: sum / count,
        rms: (square / count).sqrt(),
    }
}

struct Sweep {
    config: Config,
    sequence: Sequence,
    poses: Vec<Option<DAffine3>>,
    stored: Volume,
}

/// A sweep over a phantom of a spine, with PLUS's own configuration: linear, mean, sticks of 9.
fn spine(data: &Path) -> Sweep {
    let data = data.join("us-plus");
    let (config, images) = (data.join("ConfigFiles/Testing"), data.join("TestImages"));
    let config = config.join("PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml");
    let config = Config::load(&config).expect("a configuration");
    let sequence = Sequence::load(&images.join("SpinePhantomFreehand.igs.mha"));
    let (sequence, _) = sequence.expect("a sweep");
    let stored = Volume::load(&images.join("SpinePhantomFreehandReconstructed.mha"));
    let poses = config.transforms.of_frames(&sequence, "Image", "Reference");
    Sweep { poses: poses.expect("joined"), config, sequence, stored: stored.expect("a volume").0 }
}

/// Nine voxels in ten are within the 2 grey levels that PLUS's own tests allow between machines, and the
/// brightness is the same. The stored volume has one plane less: PLUS used to truncate the extent, which it
/// rounds now.
#[test]
fn a_volume_is_what_plus_made_of_the_sweep() {
    let Some(data) = shared_data() else { return };
    let Sweep { config, sequence, poses, stored } = spine(&data);
    let made = reconstruct(&sequence, &poses, &config.settings).expect("made");
    assert_eq!(made.frames, 21);
    assert_eq!(made.volume.size, [147, 106, 105]);
    assert_eq!(stored.size, [147, 106, 104]);
    // The stored origin has six digits.
    let away = made.volume.world_from_voxel.translation - stored.world_from_voxel.translation;
    assert!(away.abs().max_element() < 1e-3, "{away}");
    let holds = |f: &Figures| f.close > 0.9 && f.mean.abs() < 0.05 && f.rms < 5.0;
    let of = |volume: &Volume| compare(volume.size, |at| volume.value(at), &stored);
    let figures = of(&made.volume);
    println!("{figures:?}");
    assert!(holds(&figures), "{figures:?}");
    // Planted: three pixels off, half a voxel, and another method of compounding.
    let off = DAffine3::from_translation(DVec3::new(0.0, 3.0, 0.0));
    let planted: Vec<_> = poses.iter().map(|p| p.map(|p| p * off)).collect();
    let mut settings = config.settings.clone();
    settings.lattice = Some((stored.world_from_voxel.translation, stored.size));
    let made = reconstruct(&sequence, &planted, &settings).expect("made");
    assert!(!holds(&of(&made.volume)));
    settings.compounding = Compounding::Maximum;
    let made = reconstruct(&sequence, &poses, &settings).expect("made");
    assert!(!holds(&of(&made.volume)));
}

/// Number of fraction bits of PLUS's fixed-point numbers (its `Optimization="FULL"`).
const BITS: u32 = 14;

fn fixed(value: f64) -> i32 {
    (value * f64::from(1 << BITS)).round_ties_even() as i32
}

fn product(a: i32, b: i32) -> i32 {
    (a * b + (1 << (BITS - 1))) >> BITS
}

fn real(value: i32) -> f64 {
    f64::from(value) / f64::from(1 << BITS)
}

/// Voxels with the sum of their weights, 256 for a whole pixel and 65535 at most.
struct Voxels {
    size: [usize; 3],
    value: Vec<f64>,
    weight: Vec<f64>,
}

impl Voxels {
    fn index(&self, at: [i32; 3]) -> Option<usize> {
        let inside = (0..3).all(|a| at[a] >= 0 && at[a] < self.size[a] as i32);
        let [i, j, k] = at.map(|n| n as usize);
        inside.then(|| i + self.size[0] * (j + self.size[1] * k))
    }

    /// Inserts a pixel at a position in fixed point. Without `rounded` the mean keeps its fractions.
    fn insert(&mut self, at: [i32; 3], pixel: f64, rounded: bool) {
        let low = at.map(|v| v >> BITS);
        let part = [0, 1, 2].map(|a| at[a] - (low[a] << BITS));
        let high = [0, 1, 2].map(|a| low[a] + i32::from(part[a] != 0));
        if self.index(low).is_none() || self.index(high).is_none() {
            return;
        }
        for corner in 0..8 {
            let upper = [corner >> 2 & 1, corner >> 1 & 1, corner & 1].map(|bit| bit == 1);
            let pick = |a: usize| {
                if upper[a] { part[a] } else { (1 << BITS) - part[a] }
            };
            let weight = real(product(pick(0), product(pick(1), pick(2))));
            let voxel = [0, 1, 2].map(|a| if upper[a] { high[a] } else { low[a] });
            let Some(voxel) = self.index(voxel).filter(|_| weight > 0.0) else {
                continue;
            };
            let (value, sum) = (&mut self.value[voxel], &mut self.weight[voxel]);
            let before = *sum / 256.0;
            let mean = (weight * pixel + before * *value) / (weight + before);
            if rounded {
                *value = mean.round();
                *sum = ((weight + before) * 256.0).round().min(65535.0);
            } else {
                *value = mean;
                *sum += weight * 256.0;
            }
        }
    }

    fn walk(&self, from: [i32; 3], step: [i32; 3], limit: i32) -> Option<(i32, f64)> {
        for count in 1..=limit {
            let at = self.index([0, 1, 2].map(|a| from[a] + count * step[a]))?;
            if self.weight[at] > 0.0 {
                return Some((count, self.value[at]));
            }
        }
        None
    }

    /// The value of a hole between the ends of the shortest lines of at most 9 voxels; PLUS cuts fractions off.
    fn filled(&self, at: [i32; 3]) -> f64 {
        let mut lines: Vec<(f64, f64)> = Vec::new();
        let around = -1..=1;
        let steps = around.clone().flat_map(|z| {
            let around = around.clone();
            around.clone().flat_map(move |y| around.clone().map(move |x| [x, y, z]))
        });
        // Each line once: the first step that is not 0, from z on, goes up.
        for step in steps.filter(|[x, y, z]| (*z, *y, *x) > (0, 0, 0)) {
            let Some((after, a)) = self.walk(at, step, 8) else {
                continue;
            };
            let Some((before, b)) = self.walk(at, step.map(|s| -s), 8 - after) else {
                continue;
            };
            let voxels = f64::from(after + before + 1);
            let weight = f64::from(before + 1) / voxels;
            let length = f64::from(step.iter().map(|s| s * s).sum::<i32>()).sqrt();
            lines.push((voxels * length, (weight * a + (1.0 - weight) * b).floor()));
        }
        let shortest = lines.iter().map(|l| l.0).fold(f64::INFINITY, f64::min);
        let used: Vec<_> = lines.iter().filter(|l| l.0 == shortest).collect();
        let sum: f64 = used.iter().map(|l| l.1).sum();
        (sum / used.len().max(1) as f64).floor()
    }
}

/// Computed as by PLUS, the volume comes out as stored: the difference of ours is its arithmetic. Positions and
/// weights have 14 fraction bits, and a voxel is rounded to 8 bits after every one of the hundreds of pixels
/// that reach it.
#[test]
fn the_arithmetic_of_plus_explains_the_difference() {
    let Some(data) = shared_data() else { return };
    let Sweep { config, sequence, poses, stored } = spine(&data);
    let ours = reconstruct(&sequence, &poses, &config.settings).expect("made");
    let voxel_from_reference = ours.volume.world_from_voxel.inverse();
    let size = ours.volume.size;
    let count = size.iter().product();
    let [width, height] = sequence.size;
    let run = |rounded: bool| {
        let mut voxels = Voxels { size, value: vec![0.0; count], weight: vec![0.0; count] };
        for (frame, pose) in poses.iter().enumerate() {
            let m = voxel_from_reference * pose.expect("all poses are OK");
            let column = |v: DVec3| v.to_array().map(fixed);
            let (x, y) = (column(m.matrix3.x_axis), column(m.matrix3.y_axis));
            let origin = column(m.translation);
            for (row, at) in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
                let pixel = sequence.pixels.get(sequence.first_pixel(frame) + row * width + at);
                let (row, at) = (row as i32, at as i32);
                let place = [0, 1, 2].map(|a| origin[a] + row * y[a] + at * x[a]);
                voxels.insert(place, pixel, rounded);
            }
        }
        let value = |at: [usize; 3]| {
            let at = at.map(|n| n as i32);
            let index = voxels.index(at).expect("inside");
            if voxels.weight[index] > 0.0 { voxels.value[index].round() } else { voxels.filled(at) }
        };
        compare(size, value, &stored)
    };
    let (plus, exact) = (run(true), run(false));
    println!("PLUS's arithmetic {plus:?}\nwithout its rounding {exact:?}");
    // Half a percent still differs, nearly all of it by a grey level. The stored volume was made by an older PLUS
    // than the one modelled here, as its extent shows.
    assert!(plus.equal > 0.99 && plus.close > 0.999, "{plus:?}");
    // Planted: without the rounding it is no better than ours.
    assert!(exact.close < 0.95, "{exact:?}");
}
