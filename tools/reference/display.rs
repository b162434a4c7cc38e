//! Twin of `display`: scan conversion and grey map.

use super::geometry::probe;
use insonify::probe::ProbeKind;
use insonify::sim::layout::{FLAG_LINE, Frame};

/// Column and row in the scanlines of each pixel, row by row; none outside the sector.
pub fn places(frame: &Frame) -> Vec<Option<[f64; 2]>> {
    if frame.flags & FLAG_LINE != 0 {
        let row = |j: u32| (f64::from(j) + 0.5) * f64::from(frame.pixel_pitch / frame.sample_pitch);
        let column = f64::from(frame.image_left);
        return (0..frame.image_height).map(|j| Some([column, row(j)])).collect();
    }
    let (pitch, left, top) =
        (f64::from(frame.pixel_pitch), f64::from(frame.image_left), f64::from(frame.image_top));
    let mut out = Vec::new();
    for j in 0..frame.image_height {
        for i in 0..frame.image_width {
            let x = left + (f64::from(i) + 0.5) * pitch;
            let z = top + (f64::from(j) + 0.5) * pitch;
            out.push(sector(frame, x, z));
        }
    }
    out
}

/// Level in 0..=1 of each pixel, row by row; none outside the sector. NaN counts as 0.
pub fn levels(frame: &Frame, log_image: &[f32]) -> Vec<Option<f64>> {
    let level = |[column, row]: [f64; 2]| {
        let v = sample(frame, log_image, column, row);
        if v.is_nan() { 0.0 } else { v }
    };
    let places = places(frame).into_iter();
    places.map(|place| place.map(level)).collect()
}

/// Column and row in the log image of (x, z) mm in probe space; none outside the sector.
pub fn sector(frame: &Frame, x: f64, z: f64) -> Option<[f64; 2]> {
    let fan = |radius: f64, field_of_view: f64| {
        let angle = x.atan2(z + radius);
        (x.hypot(z + radius) - radius, angle / field_of_view)
    };
    let (depth, across) = match probe(frame).kind {
        ProbeKind::Convex { radius, field_of_view } => fan(radius, field_of_view),
        ProbeKind::Phased { field_of_view } => fan(0.0, field_of_view),
        ProbeKind::Linear { width } => (z, x / width),
    };
    let inside = across.abs() <= 0.5 && (0.0..f64::from(frame.depth)).contains(&depth);
    let column = (across + 0.5) * f64::from(frame.scanlines) - 0.5;
    inside.then_some([column, depth / f64::from(frame.sample_pitch)])
}

/// Bilinear interpolation of values per sample of the scanlines, clamped at the edges.
pub fn sample(frame: &Frame, log_image: &[f32], column: f64, row: f64) -> f64 {
    let clamped = |v: f64, n: u32| v.clamp(0.0, f64::from(n) - 1.0);
    let (column, row) = (clamped(column, frame.scanlines), clamped(row, frame.samples));
    let mut sum = 0.0;
    for (l, wl) in [(column.floor(), 1.0 - column.fract()), (column.ceil(), column.fract())] {
        for (k, wk) in [(row.floor(), 1.0 - row.fract()), (row.ceil(), row.fract())] {
            let level = log_image[l as usize * frame.samples as usize + k as usize];
            sum += wl * wk * f64::from(level);
        }
    }
    sum
}

/// Opaque greys 0xffgggggg through the map of 256 entries; 0 outside the sector.
pub fn display(frame: &Frame, log_image: &[f32], grey: &[u32]) -> Vec<u32> {
    let pixel = |level: Option<f64>| match level {
        Some(v) => 0xff00_0000 | (grey[(v * 255.0 + 0.5).floor() as usize] * 0x0001_0101),
        None => 0,
    };
    levels(frame, log_image).into_iter().map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: u32) -> Frame {
        Frame {
            kind,
            scanlines: 128,
            samples: 400,
            depth: 40.0,
            sample_pitch: 0.1,
            radius: if kind == 0 { 12.0 } else { 0.0 },
            field_of_view: 1.2,
            width: 30.0,
            pixel_pitch: 0.1,
            image_left: -32.0,
            image_top: -3.0,
            image_width: 640,
            image_height: 440,
            ..Frame::default()
        }
    }

    // Area from the pixel count: 0.5 % is a band of a tenth of a pixel along the whole outline.
    #[test]
    fn the_sector_has_the_closed_form_area() {
        for kind in 0..3 {
            let frame = frame(kind);
            let (r, d) = (f64::from(frame.radius), f64::from(frame.depth));
            let expected = match kind {
                1 => 30.0 * 40.0,
                _ => 0.6 * ((r + d).powi(2) - r * r),
            };
            let inside = levels(&frame, &vec![1.0; 128 * 400]).iter().flatten().count();
            let area = inside as f64 * 0.01;
            assert!((area / expected - 1.0).abs() < 0.005, "{kind}: {area} {expected}");
        }
    }

    /// Worst error against a smooth function of depth (mm) and position across (-0.5..0.5), with
    /// the image sampled at `shift` lines off.
    fn smooth_error(kind: u32, shift: f64) -> f64 {
        let frame = frame(kind);
        let f =
            |depth: f64, across: f64| 0.5 + 0.2 * (depth / 5.0).sin() + 0.2 * (6.0 * across).cos();
        let image: Vec<f32> = (0..128 * 400)
            .map(|i| {
                let (l, k) = (f64::from(i / 400), f64::from(i % 400));
                f(k * 0.1, (l + 0.5 + shift) / 128.0 - 0.5) as f32
            })
            .collect();
        let levels = levels(&frame, &image);
        let mut worst: f64 = 0.0;
        for (i, level) in levels.iter().enumerate() {
            let x = -32.0 + 0.1 * (f64::from(i as u32 % 640) + 0.5);
            let z = -3.0 + 0.1 * (f64::from(i as u32 / 640) + 0.5);
            let (depth, across) = match kind {
                1 => (z, x / 30.0),
                _ => {
                    let r = f64::from(frame.radius);
                    (x.hypot(z + r) - r, x.atan2(z + r) / 1.2)
                }
            };
            // Half a line at the sides and the last sample are clamped, not interpolated.
            if let Some(v) = level.filter(|_| across.abs() < 0.49 && depth < 39.8) {
                worst = worst.max((v - f(depth, across)).abs());
            }
        }
        worst
    }

    // Bilinear error is curvature times pitch^2 / 8, here below 2e-4; 1e-3 leaves f32's rounding of
    // angles and would not hide half a line, which is caught.
    #[test]
    fn a_smooth_image_is_reproduced_and_half_a_line_is_noticed() {
        for kind in 0..3 {
            assert!(smooth_error(kind, 0.0) < 1e-3, "{kind}");
            assert!(smooth_error(kind, 0.5) > 1e-3, "{kind}");
        }
    }

    #[test]
    fn greys_are_opaque_nan_is_black_and_outside_is_transparent() {
        let mut frame = frame(1);
        (frame.image_width, frame.image_height) = (3, 1);
        (frame.image_left, frame.image_top, frame.pixel_pitch) = (-30.0, 1.0, 20.0);
        let grey: Vec<u32> = (0..256).map(|v| 255 - v).collect();
        let pixels = |level| display(&frame, &vec![level; 128 * 400], &grey);
        assert_eq!(pixels(1.0), [0, 0xff00_0000, 0]);
        assert_eq!(pixels(f32::NAN), [0, 0xffff_ffff, 0]);
    }
}
