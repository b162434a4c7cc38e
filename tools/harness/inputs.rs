//! Random inputs and the frames that the cases have in common.

use glam::DAffine3;

use super::worlds;
use super::{Case, Input, Size};
use crate::reference::geometry;
use insonify::sim::layout::{FLAG_COINCIDENT, Frame, KIND_CONVEX, KIND_LINEAR, KIND_PHASED, Row};
use insonify::sim::placement::matrix_rows;
use insonify::sim::tables;

/// SplitMix64 (Steele, Lea, Flood 2014): unrelated to the generator under test.
pub struct Random(pub u64);

impl Random {
    /// 32 uniform bits.
    pub fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z >> 32) as u32
    }

    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.word()) / 4_294_967_296.0
    }

    /// `count` numbers uniform in [low, high).
    pub fn floats(&mut self, count: usize, low: f64, high: f64) -> Vec<f32> {
        (0..count).map(|_| self.within(low, high) as f32).collect()
    }
}

/// Scanlines, layers, samples of a case.
pub fn dimensions(case: Case, size: Size) -> [u32; 3] {
    match (case, size) {
        (Case::Random, Size::Standard) => [192, 7, 2048],
        (Case::Random, Size::Small) => [48, 3, 320],
        // No lines: a frame without samples has no sample pitch.
        (Case::Empty, _) => [0, 1, 16],
        (Case::One, _) => [1, 1, 1],
        (Case::Odd, _) => [23, 5, 131],
        (Case::Modes, _) => [31, 4, 260],
        (Case::NotFinite, _) => [12, 2, 130],
    }
}

/// The frame of a kernel that goes straight along the scanlines: as [`frame`], placed nowhere in the case that
/// is not finite, with surfaces that coincide in the one of modes.
pub fn straight_frame(case: Case, size: Size) -> Frame {
    let mut frame = frame(case, size);
    match case {
        // Not the factors of the rays' elevation: it is a constant 0, so a compiler may leave the product out.
        Case::NotFinite => frame.world_from_probe[0][2] = f32::NAN,
        Case::Modes => frame.flags |= FLAG_COINCIDENT,
        _ => {}
    }
    frame
}

/// A convex, linear or phased frame by the case, depth 60 mm; every number that a kernel might read
/// is plausible.
pub fn frame(case: Case, size: Size) -> Frame {
    let [scanlines, layers, samples] = dimensions(case, size);
    let kind = match case {
        Case::Odd => KIND_LINEAR,
        Case::One | Case::Modes => KIND_PHASED,
        _ => KIND_CONVEX,
    };
    let identity = matrix_rows(&DAffine3::IDENTITY);
    let depth = 60.0;
    Frame {
        world_from_probe: identity,
        probe_from_world: identity,
        kind,
        scanlines,
        layers,
        samples,
        depth,
        radius: if kind == KIND_CONVEX { 40.0 } else { 0.0 },
        field_of_view: 1.1,
        width: 38.0,
        slice_thickness: 5.0,
        speed: 1.54,
        sample_pitch: depth / samples as f32,
        frequency: 3.5,
        paths: 4,
        max_interactions: 8,
        max_reflections: 3,
        min_weight: 1e-4,
        volume_floor: 1e-6,
        branch_floor: 0.02,
        seed: 0x5eed,
        origin_jitter: 0.05,
        emission_lobe: 3000.0,
        ray_mask: 0xff,
        beam_width: 4.0,
        cell: 0.3,
        elevation_reach: 0.9,
        elevation_cut: 2.5,
        surface_scale: 65536.0,
        volume_scale: 65536.0,
        segment_capacity: 256,
        face_height: 4.4,
        axial_sigma: 2.3,
        inverse_reference: 1.0,
        inverse_range: 1.0 / 60.0,
        frame_index: 5,
        couplant: worlds::couplant(case),
        // The odd case makes some of the face's scanlines.
        first_line: if case == Case::Odd { 3 } else { 0 },
        lines_beside: if case == Case::Odd { 9 } else { 0 },
        echo_lines: scanlines,
        beam_lines: scanlines,
        end_sample: samples,
        // Some pieces have a bin, some an eighth of one.
        piece: match case {
            Case::Odd => 64,
            Case::Modes => 8,
            _ => 32,
        },
        image_width: 1,
        image_height: 1,
        pixel_pitch: 0.25,
        ..Frame::default()
    }
}

/// The frame of a case for the stages behind the segments: that of a packet, in the odd case, is without the samples near
/// the face and without the outer scanlines.
pub fn narrow(case: Case, frame: Frame) -> Frame {
    match case {
        Case::Odd => Frame { first_sample: 5, beam_first: 2, beam_lines: 12, ..frame },
        _ => frame,
    }
}

/// Complex samples by line, 0 where the frame does not make them.
pub fn made<T: Copy + Default>(frame: &Frame, values: &[T]) -> Vec<T> {
    let line = 2 * frame.samples.max(1) as usize;
    let heard = 2 * frame.first_sample as usize..2 * frame.end_sample as usize;
    let beams = frame.beam_first..frame.beam_first + frame.beam_lines;
    let kept = |(i, &v): (usize, &T)| match heard.contains(&(i % line))
        && beams.contains(&((i / line) as u32))
    {
        true => v,
        false => T::default(),
    };
    values.iter().enumerate().map(kept).collect()
}

/// One row per sample; widths grow with depth.
pub fn rows(frame: &Frame) -> Vec<Row> {
    (0..frame.samples)
        .map(|k| {
            let depth = k as f32 * frame.sample_pitch;
            let sigmas = [0.4 + 0.01 * depth, 0.9 + 0.005 * depth];
            let gain = 1.0 + 0.01 * depth;
            let level = 0.5 + 0.05 * depth;
            Row {
                shape: tables::beam_shape(
                    0.3 + 0.01 * f64::from(depth),
                    sigmas[1].into(),
                    gain.into(),
                    level.into(),
                ),
                sigma_lateral: sigmas[0],
                sigma_elevation: sigmas[1],
                volume_gain: gain,
                point_gain: 0.8,
                surface_gain: 1.2 - 0.005 * depth,
                incoherent_gain: 1.5 + 0.01 * depth,
                volume_undo: 1.0 / 65536.0,
                surface_undo: 1.0 / (65536.0 * (1.2 - 0.005 * depth)),
                lateral_lines: 0.03 + 0.06 * depth,
                tgc: 1.0 + 0.1 * depth,
                compensation: 1.0 + 0.02 * depth,
                receive_reach: 0.5 + 0.3 * depth,
                black: -12.0 + 0.02 * depth,
                sigma_wavefront: 5.0 - 0.06 * depth,
                aperture: 0.1 - 0.0005 * depth,
                strip_lines: 0.02 + 0.05 * depth,
                // Narrow beams over 50 samples, as tables have them: not between two wide ones.
                strip_core: if k % 200 / 50 == 2 { -1.0 } else { 0.8 - 0.01 * depth },
                lobe: 10.0 + 0.2 * depth,
                transmit_half: (0.21 * depth).min(7.13),
                receive_half: 0.173 * depth,
                variances: 2.5 * sigmas[0] * sigmas[0] + (2.0 - 0.08 * depth).powi(2),
                defocus: 2.0 - 0.08 * depth,
                transmit_sine: 0.08,
                receive_sine: 0.09,
            }
        })
        .collect()
}

/// The table of the frame's scanlines.
pub fn scanlines(frame: &Frame) -> Input {
    let table = tables::scanlines(&geometry::probe(frame));
    Input::floats("scanlines", bytemuck::cast_slice(&table))
}

/// The number of samples of all scanlines.
pub fn samples(frame: &Frame) -> usize {
    frame.scanlines as usize * frame.samples as usize
}

/// The number of lines of a frame.
pub fn lines(frame: &Frame) -> usize {
    frame.scanlines as usize * frame.layers as usize
}
