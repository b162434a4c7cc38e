//! One scanline at a time: what M-mode shows, many times a second.
//!
//! A line takes part of the face's scanlines: itself and those beside it that `beam` smooths over it. All else is as in
//! an image, so that its samples are to the bit those of the image's line.

use super::lane::{Shot, pixels};
use super::layout::{self, LATERAL_REACH};
use super::tables::Tables;
use super::{Outputs, SimError, Simulator};
use crate::output::picture::grey;
use crate::scene::Scene;

/// A scanline that is made alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OneLine {
    /// Number on the face.
    number: u32,
    /// Grey levels from the face to the image's depth.
    rows: u32,
    /// Scanlines beside it, on each side, that are made: those that it is smoothed with, and those that the apertures of
    /// these reach over.
    reach: u32,
    /// Scanlines beside it, on each side, that it is smoothed with.
    smoothed: u32,
}

impl OneLine {
    /// The constants of a frame of this line alone.
    pub(super) fn narrow(&self, frame: &mut layout::Frame) {
        let lines = frame.scanlines;
        let first = self.number.saturating_sub(self.reach);
        frame.first_line = first;
        frame.scanlines = (self.number + self.reach + 1).min(lines) - first;
        frame.lines_beside = lines - frame.scanlines;
        frame.flags |= layout::FLAG_LINE;
        frame.echo_first = self.number.saturating_sub(self.smoothed) - first;
        frame.echo_lines = (self.number + self.smoothed + 1).min(lines) - first - frame.echo_first;
        frame.image_width = 1;
        frame.image_height = self.rows;
        frame.image_left = (self.number - first) as f32;
        frame.pixel_pitch = frame.depth / self.rows as f32;
    }
}

/// Scanlines on each side that what the aperture lets through depends on, at most: those that it reaches over, at any depth in
/// front of a target.
fn aperture_reach(scene: &Scene, tables: &Tables) -> u32 {
    if !scene.simulation.loses_by_aperture() {
        return 0;
    }
    let probe = &scene.probe;
    let pitch = probe.line_pitch(0.0);
    let reached = tables.rows.iter().enumerate().skip(1).map(|(k, row)| {
        let depth = k as f64 * probe.sample_pitch();
        let widest = f64::from(row.transmit_half.max(row.receive_half));
        // Rays that converge on the target are farthest from the scanline at the face; there the lines of a phased array meet.
        // Those that converge on the transmit focus are so at the face or at the target.
        let deviations = widest / (f64::from(row.receive_sine) * depth);
        let defocus = f64::from(row.defocus);
        let sent = deviations * (defocus + f64::from(row.transmit_sine) * depth).abs();
        let behind = deviations * defocus.abs() / probe.line_pitch(depth);
        (widest.max(sent) / pitch).max(behind)
    });
    // A line between two that have levels takes theirs.
    let levelled = layout::LEVEL_STEP - 1;
    reached.fold(0.0, f64::max).ceil().min(f64::from(probe.scanlines)) as u32 + levelled
}

/// Scanlines on each side over which `beam` smooths, at most, with these tables.
fn smoothed(tables: &Tables) -> u32 {
    let lines = tables.rows.iter().flat_map(|row| [row.lateral_lines, row.strip_lines]);
    let widest = lines.fold(0.0, f32::max);
    ((3.0 * widest).ceil() as u32).min(LATERAL_REACH as u32)
}

impl Simulator {
    /// The grey levels of one scanline of an image of `scene` as it is now: as many as `rows`, evenly from the face to
    /// the image's depth, without an acquired volume. `index` is the number of the frame and selects the noise. Costs
    /// the share of an image that the lines have over which the beam is smoothed.
    ///
    /// # Errors
    /// Those of [`Self::frame`].
    ///
    /// # Panics
    /// If the probe has no such scanline, without rows, or with more than the image has pixels.
    pub fn line(
        &mut self,
        scene: &Scene,
        index: u32,
        number: u32,
        rows: u32,
    ) -> Result<Vec<u8>, SimError> {
        assert!(number < scene.probe.scanlines, "no scanline {number}");
        let most = self.passes.lanes[0].buffers.room().pixels();
        assert!(rows > 0 && u64::from(rows) <= most, "{rows} rows of a line");
        // Also the tables of settings that this frame is the first to have.
        self.adopt(scene)?;
        let smoothed = smoothed(&self.tables);
        let reach = smoothed + aperture_reach(scene, &self.tables);
        let line = OneLine { number, rows, reach, smoothed };
        self.make(scene, &[Shot::of(scene, index)], Some(line), &Outputs::default())?;
        let rgba = self.read_again(pixels(false))?;
        Ok(grey(&rgba).collect())
    }
}
