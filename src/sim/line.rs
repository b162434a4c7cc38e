//! Some scanlines without the others: one at a time, what M-mode shows, many times a second; or those of packets.
//!
//! They take part of the face's scanlines: themselves and those beside them that `beam` smooths over them. All else is as in
//! an image, so that their samples are to the bit those of the image's lines.

use std::ops::Range;

use super::lane::{Shot, pixels};
use super::layout::{self, LATERAL_REACH, Row, SCATTER_BIN};
use super::tables::Tables;
use super::{Outputs, SimError, Simulator};
use crate::output::picture::grey;
use crate::scene::Scene;

/// Neighbouring scanlines that are made without the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LineRange {
    /// Number on the face of the first one.
    first: u32,
    /// How many they are.
    count: u32,
    /// Samples of which they are made, up to the last one in which something echoes there.
    samples: u32,
    /// Of these the first that is heard and the end, of the scanlines without those beside them; none: all of them.
    heard: Option<[u32; 2]>,
    /// Grey levels from the face to the image's depth, of a scanline that is shown alone; none: nothing is shown.
    rows: Option<u32>,
    /// Scanlines beside them, on each side, that are made: those that they are smoothed with, and those that the apertures of
    /// these reach over.
    reach: u32,
    /// Scanlines beside them, on each side, that they are smoothed with.
    smoothed: u32,
}

impl LineRange {
    /// These samples of these scanlines, which nothing shows.
    pub(super) fn of(scene: &Scene, tables: &Tables, lines: Range<u32>, heard: Range<u32>) -> Self {
        // A scatterer echoes up to two bins beside its own.
        let samples = heard.end.next_multiple_of(SCATTER_BIN) + 2 * SCATTER_BIN;
        let whole = Self::whole(scene, tables, lines, heard.clone());
        Self { samples, heard: Some([heard.start, heard.end]), ..whole }
    }

    /// These scanlines, smoothed for what is heard in these samples.
    fn whole(scene: &Scene, tables: &Tables, lines: Range<u32>, heard: Range<u32>) -> Self {
        let [first, end] = [heard.start, heard.end].map(|k| (k as usize).min(tables.rows.len()));
        let smoothed = smoothed(&tables.rows[first..end]);
        let reach = smoothed + aperture_reach(scene, &tables.rows[..end]);
        let count = lines.end - lines.start;
        Self {
            first: lines.start,
            count,
            samples: heard.end,
            heard: None,
            rows: None,
            reach,
            smoothed,
        }
    }

    /// The constants of a frame of these scanlines alone.
    pub(super) fn narrow(&self, frame: &mut layout::Frame) {
        let lines = frame.scanlines;
        // The scanlines that lie up to so many beside them.
        let beside = |reach: u32| {
            let first = self.first.saturating_sub(reach);
            (first, (self.first + self.count + reach).min(lines) - first)
        };
        let (first, count) = beside(self.reach);
        let (echo_first, echo_lines) = beside(self.smoothed);
        frame.first_line = first;
        frame.scanlines = count;
        frame.lines_beside = lines - count;
        (frame.echo_first, frame.echo_lines) = (echo_first - first, echo_lines);
        frame.samples = self.samples.min(frame.samples);
        frame.end_sample = frame.samples;
        frame.beam_lines = count;
        if let Some([start, end]) = self.heard {
            frame.first_sample = start;
            frame.end_sample = end.min(frame.samples);
            (frame.beam_first, frame.beam_lines) = (self.first - first, self.count);
        }
        if let Some(rows) = self.rows {
            frame.flags |= layout::FLAG_LINE;
            frame.image_width = 1;
            frame.image_height = rows;
            frame.image_left = (self.first - first) as f32;
            frame.pixel_pitch = frame.depth / rows as f32;
        }
    }
}

/// Scanlines on each side that what the aperture lets through depends on, at most: those that it reaches over, at any depth in
/// front of a target.
fn aperture_reach(scene: &Scene, rows: &[Row]) -> u32 {
    if !scene.simulation.loses_by_aperture() {
        return 0;
    }
    let probe = &scene.probe;
    let pitch = probe.line_pitch(0.0);
    let reached = rows.iter().enumerate().skip(1).map(|(k, row)| {
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

/// Scanlines on each side over which `beam` smooths these samples, at most.
fn smoothed(rows: &[Row]) -> u32 {
    let lines = rows.iter().flat_map(|row| [row.lateral_lines, row.strip_lines]);
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
        let samples = scene.probe.samples;
        let line = LineRange::whole(scene, &self.tables, number..number + 1, 0..samples);
        let line = LineRange { rows: Some(rows), ..line };
        self.make(scene, &[Shot::of(scene, index)], Some(line), &Outputs::default())?;
        let rgba = self.read_again(pixels(false))?;
        Ok(grey(&rgba).collect())
    }
}
