//! Labels of a picture: for each pixel the class of the tissue there.

use crate::probe::{Kind, Probe};
use crate::scene::Scene;
use crate::sim::layout::Frame;

/// Class of a pixel beside the sector.
const BESIDE: u8 = 0;

/// Class of each pixel of a frame's picture, row by row: 0 beside the sector, else the place of the tissue's name in
/// `classes`, counted from 1. `labels` are the frame's, an instance and a tissue for each sample; a pixel has those of
/// the sample that is nearest.
pub(super) fn classes(
    frame: &Frame,
    scene: &Scene,
    labels: &[[u32; 2]],
    classes: &[String],
) -> Vec<u8> {
    let class = |name: &str| classes.iter().position(|c| c == name).map_or(BESIDE, |i| i as u8 + 1);
    let of_tissue: Vec<u8> = scene.tissues.iter().map(|t| class(&t.name)).collect();
    let (pitch, left, top) =
        (f64::from(frame.pixel_pitch), f64::from(frame.image_left), f64::from(frame.image_top));
    let mut out = Vec::with_capacity((frame.image_width * frame.image_height) as usize);
    for row in 0..frame.image_height {
        for column in 0..frame.image_width {
            let [x, z] =
                [left + (f64::from(column) + 0.5) * pitch, top + (f64::from(row) + 0.5) * pitch];
            let sample = nearest(&scene.probe, [x, z]);
            let tissue = sample.map(|i| labels[i][1] as usize);
            out.push(tissue.map_or(BESIDE, |tissue| of_tissue[tissue]));
        }
    }
    out
}

/// Index of the sample nearest to (x, z), mm in the probe's image plane, line by line; none beside the sector. As
/// `glsl/sector.glsl`, with functions that are the same on every machine.
fn nearest(probe: &Probe, [x, z]: [f64; 2]) -> Option<usize> {
    let fan = |radius: f64, field_of_view: f64| {
        let from_apex = (x * x + (z + radius) * (z + radius)).sqrt();
        (from_apex - radius, libm::atan2(x, z + radius) / field_of_view)
    };
    let (depth, across) = match probe.kind {
        Kind::Convex { radius, field_of_view } => fan(radius, field_of_view),
        Kind::Phased { field_of_view } => fan(0.0, field_of_view),
        Kind::Linear { width } => (z, x / width),
    };
    if across.abs() > 0.5 || !(0.0..probe.depth).contains(&depth) {
        return None;
    }
    let within = |at: f64, count: u32| (at.round().max(0.0) as u32).min(count - 1) as usize;
    let line = within((across + 0.5) * f64::from(probe.scanlines) - 0.5, probe.scanlines);
    let sample = within(depth / probe.sample_pitch(), probe.samples);
    Some(line * probe.samples as usize + sample)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_found_where_their_rays_lead() {
        for probe in [Probe::linear(), Probe::abdominal(), Probe::phased()] {
            for line in [0, probe.scanlines / 3, probe.scanlines - 1] {
                // From a depth on where the lines of a phased probe lie apart.
                for sample in [probe.samples / 3, probe.samples - 2] {
                    let (origin, direction) = probe.ray(line, 0);
                    let at = origin + direction * f64::from(sample) * probe.sample_pitch();
                    let expected = (line * probe.samples + sample) as usize;
                    assert_eq!(
                        nearest(&probe, [at.x, at.z]),
                        Some(expected),
                        "{:?} {line} {sample}",
                        probe.kind
                    );
                }
            }
            let [left, top, right, bottom] = probe.bounds();
            assert_eq!(nearest(&probe, [left - 0.1, 0.5 * (top + bottom)]), None);
            assert_eq!(nearest(&probe, [0.0, bottom + 0.1]), None);
            assert!(nearest(&probe, [0.5 * (left + right), 0.5 * bottom]).is_some());
        }
    }
}
