//! M-mode: grey levels along a line of the image, against time.
//!
//! Along a scanline they are traced for the strip, up to a thousand times per second of the scene. Along any other line
//! they are taken from the images, as scanners do it in anatomical M-mode; likewise where an acquired volume is shown.

use std::collections::VecDeque;
use std::time::Instant;

use glam::{DVec2, dvec2};

use crate::picture::{Pixels, Sector};
use crate::probe::Probe;

/// Grey levels of a column, from the beginning of its line to the end.
pub const ROWS: usize = 512;

/// Columns of the strip per second of the scene, at most.
pub const RATE: f64 = 1000.0;

/// Number of columns kept: at the largest rate, 16 seconds.
const KEPT: usize = 1 << 14;

/// The line of the image that a strip shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// A scanline of the probe, from the face to the image's depth.
    Scanline(u32),
    /// From one point of the image plane to another, mm: lateral place and depth.
    Free([DVec2; 2]),
}

impl Default for Aim {
    fn default() -> Self {
        Self::Scanline(0)
    }
}

impl Aim {
    /// Both ends in the image plane of a probe, mm: lateral place and depth. Of a scanline that the probe does not
    /// have, those of its last one.
    pub fn ends(&self, probe: &Probe) -> [DVec2; 2] {
        match *self {
            Self::Free(ends) => ends,
            Self::Scanline(line) => {
                let line = line.min(probe.scanlines - 1);
                let (start, direction) = probe.ray(line, probe.elevation_layers / 2);
                [start, start + direction * probe.depth].map(|at| dvec2(at.x, at.z))
            }
        }
    }
}

/// The grey levels along a line at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Time of the scene, s.
    pub seconds: f64,
    /// Moment at which this was shown.
    pub at: Instant,
    /// [`ROWS`] levels.
    pub levels: Vec<u8>,
}

/// A column of a strip at its time.
struct Kept {
    seconds: f64,
    levels: Vec<u8>,
}

/// The M-mode strip of one line.
#[derive(Default)]
pub struct Strip {
    aim: Aim,
    probe: Option<Probe>,
    columns: VecDeque<Kept>,
    revision: u64,
}

impl Strip {
    /// An empty strip of a line.
    pub fn new(aim: Aim) -> Self {
        Self { aim, ..Self::default() }
    }

    /// Its line.
    pub fn line(&self) -> Aim {
        self.aim
    }

    /// Takes another line; clears the strip of the one before.
    pub fn aim(&mut self, aim: Aim) {
        if aim != self.aim {
            self.aim = aim;
            self.columns.clear();
            self.revision += 1;
        }
    }

    /// Number that grows with every change.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Adds the levels along the line at `seconds`. Another probe, or a time before the last, clears the strip; the
    /// same moment again replaces its column.
    pub fn add(&mut self, seconds: f64, probe: &Probe, levels: Vec<u8>) {
        self.revision += 1;
        if self.probe.as_ref() != Some(probe) {
            self.columns.clear();
            self.probe = Some(probe.clone());
            if let Aim::Scanline(line) = &mut self.aim {
                *line = (*line).min(probe.scanlines - 1);
            }
        }
        match self.columns.back() {
            Some(last) if last.seconds > seconds => self.columns.clear(),
            Some(last) if last.seconds == seconds => {
                self.columns.pop_back();
            }
            _ => {}
        }
        if self.columns.len() == KEPT {
            self.columns.pop_front();
        }
        self.columns.push_back(Kept { seconds, levels });
    }

    /// Adds the levels of an image along the line.
    pub fn add_image(&mut self, seconds: f64, probe: &Probe, sector: Sector, pixels: &Pixels) {
        let [from, to] = self.aim.ends(probe);
        let levels = (0..ROWS).map(|row| {
            let at = from.lerp(to, (row as f64 + 0.5) / ROWS as f64);
            let x = (at.x - sector.left) / sector.pitch;
            let y = (at.y - sector.top) / sector.pitch;
            pixels.level(x, y)
        });
        self.add(seconds, probe, levels.collect());
    }

    /// Time of the newest column, s.
    pub fn newest(&self) -> Option<f64> {
        self.columns.back().map(|c| c.seconds)
    }

    /// Time from the oldest column to the newest, s.
    pub fn span(&self) -> f64 {
        let oldest = self.columns.front().map_or(0.0, |c| c.seconds);
        self.newest().map_or(0.0, |newest| newest - oldest)
    }

    /// Number of columns in the `window` seconds before `end`.
    pub fn columns_in(&self, end: f64, window: f64) -> usize {
        let within = |c: &&Kept| c.seconds > end - window;
        self.columns.iter().rev().take_while(within).count()
    }

    /// Length of its line, mm: for a scanline the image's depth; none before the first image.
    pub fn length(&self) -> Option<f64> {
        self.probe.as_ref().map(|probe| {
            let [from, to] = self.aim.ends(probe);
            from.distance(to)
        })
    }

    /// Grey levels of the `window` seconds before `end`, row by row, `width` by [`ROWS`]. Each column
    /// lasts until the next; black before the first and after the newest.
    pub fn raster(&self, end: f64, window: f64, width: usize) -> Vec<u8> {
        let mut out = vec![0; width * ROWS];
        let mut next = self.columns.partition_point(|c| c.seconds <= end - window);
        for x in 0..width {
            let moment = end - window * (1.0 - (x as f64 + 1.0) / width as f64);
            while self.columns.get(next).is_some_and(|c| c.seconds <= moment) {
                next += 1;
            }
            let shown = next.checked_sub(1).map(|at| &self.columns[at]);
            for (row, level) in shown.iter().flat_map(|c| c.levels.iter().enumerate()) {
                out[row * width + x] = *level;
            }
        }
        out
    }
}

/// The scanline of `probe` that passes nearest to a point of the image plane, mm.
pub fn nearest_line(probe: &Probe, lateral: f64, depth: f64) -> u32 {
    let point = glam::DVec3::new(lateral, 0.0, depth);
    let layer = probe.elevation_layers / 2;
    let away = |l: u32| {
        let (start, direction) = probe.ray(l, layer);
        let from = (point - start).with_y(0.0);
        (from - direction * from.dot(direction).max(0.0)).length_squared()
    };
    (0..probe.scanlines)
        .min_by(|a, b| away(*a).total_cmp(&away(*b)))
        .expect("a probe has scanlines")
}

#[cfg(test)]
mod tests {
    use glam::dvec2;

    use super::{Aim, ROWS, Strip, nearest_line};
    use crate::picture::{Pixels, Sector};
    use crate::probe::{Probe, ProbeKind};

    const SECTOR: Sector = Sector { left: -20.0, top: 0.0, pitch: 0.5 };

    fn probe() -> Probe {
        Probe {
            kind: ProbeKind::Linear { width: 40.0 },
            scanlines: 40,
            depth: 50.0,
            ..Probe::PRESETS[0].1()
        }
    }

    /// 80 by 100 pixels, black except for the row at a depth of `mm`.
    fn bright_at(mm: f64) -> Pixels {
        let row = (mm / 0.5) as usize;
        let mut rgba = vec![0; 80 * 100 * 4];
        rgba[row * 320..(row + 1) * 320].fill(255);
        Pixels { size: [80, 100], rgba }
    }

    /// Depth of the brightest row of a strip at a moment, mm.
    fn depth_at(raster: &[u8], x: usize, width: usize) -> f64 {
        let brightest = (0..ROWS).max_by_key(|row| raster[row * width + x]).unwrap();
        (brightest as f64 + 0.5) / ROWS as f64 * 50.0
    }

    #[test]
    fn a_reflector_that_moves_draws_its_way() {
        let mut strip = Strip::new(Aim::Scanline(20));
        let way = |t: f64| 25.0 + 10.0 * (std::f64::consts::TAU * t).sin();
        for i in 0..=200 {
            let t = f64::from(i) * 0.01;
            strip.add_image(t, &probe(), SECTOR, &bright_at(way(t)));
        }
        let raster = strip.raster(2.0, 2.0, 400);
        for x in (10..400).step_by(10) {
            // A column lasts until the next: up to a hundredth of a second, 0.63 mm; a pixel has 0.5,
            // a row 0.2 mm.
            let t = (x as f64 + 1.0) / 200.0;
            let off = (depth_at(&raster, x, 400) - way(t)).abs();
            assert!(off < 0.63 + 0.5, "{t}: {off}");
        }
        // A strip twice as slow is noticed.
        let wrong = strip.raster(2.0, 1.0, 400);
        assert!(
            (0..400)
                .any(|x| (depth_at(&wrong, x, 400) - way((x as f64 + 1.0) / 200.0)).abs() > 5.0)
        );
    }

    #[test]
    fn a_free_line_is_taken_from_the_image() {
        let mut strip = Strip::new(Aim::Free([dvec2(-10.0, 10.0), dvec2(10.0, 40.0)]));
        strip.add_image(1.0, &probe(), SECTOR, &bright_at(25.0));
        assert!((strip.length().unwrap() - 1300f64.sqrt()).abs() < 1e-9);
        let raster = strip.raster(1.0, 1.0, 1);
        let brightest = (0..ROWS).max_by_key(|row| raster[*row]).unwrap();
        // Half way, to the half of a pixel, 1/60 of the way.
        let off = (brightest as f64 + 0.5) / ROWS as f64 - 0.5;
        assert!(off.abs() < 1.0 / 60.0 + 1.0 / ROWS as f64, "{off}");
    }

    #[test]
    fn the_strip_shows_only_recorded_columns() {
        let mut strip = Strip::new(Aim::Scanline(3));
        assert!(strip.raster(1.0, 1.0, 10).iter().all(|&l| l == 0));
        strip.add_image(0.55, &probe(), SECTOR, &bright_at(25.0));
        let raster = strip.raster(1.0, 1.0, 10);
        let seen: Vec<bool> =
            (0..10).map(|x| (0..ROWS).any(|row| raster[row * 10 + x] > 0)).collect();
        assert_eq!(seen, [false, false, false, false, false, true, true, true, true, true]);
        // Back in time, another scanline, another probe: a new strip.
        strip.add_image(0.1, &probe(), SECTOR, &bright_at(25.0));
        assert_eq!((strip.columns.len(), strip.newest()), (1, Some(0.1)));
        strip.add_image(0.1, &probe(), SECTOR, &bright_at(30.0));
        assert_eq!(strip.columns.len(), 1, "the same moment");
        strip.add_image(0.15, &probe(), SECTOR, &bright_at(30.0));
        assert_eq!([0.04, 0.1].map(|s| strip.columns_in(0.15, s)), [1, 2]);
        strip.aim(Aim::Scanline(4));
        assert_eq!(strip.newest(), None);
        strip.add_image(0.2, &probe(), SECTOR, &bright_at(25.0));
        strip.add_image(0.3, &Probe { depth: 60.0, ..probe() }, SECTOR, &bright_at(25.0));
        assert_eq!((strip.columns.len(), strip.length()), (1, Some(60.0)));
        let few = Probe { scanlines: 2, ..probe() };
        strip.add_image(0.4, &few, SECTOR, &bright_at(25.0));
        assert_eq!(strip.line(), Aim::Scanline(1));
    }

    #[test]
    fn memory_is_bounded() {
        let mut strip = Strip::new(Aim::Scanline(0));
        for i in 0..super::KEPT + 10 {
            strip.add_image(i as f64, &probe(), SECTOR, &bright_at(25.0));
        }
        assert_eq!(strip.columns.len(), super::KEPT);
    }

    #[test]
    fn the_line_below_a_point_is_found() {
        let linear = probe();
        assert_eq!(nearest_line(&linear, -19.6, 10.0), 0);
        assert_eq!(nearest_line(&linear, 0.4, 10.0), 20);
        assert_eq!(nearest_line(&linear, 400.0, 10.0), 39);
        for (_, make) in Probe::PRESETS {
            let probe = make();
            for line in [0, probe.scanlines / 3, probe.scanlines - 1] {
                let (start, direction) = probe.ray(line, probe.elevation_layers / 2);
                let at = start + direction * 0.6 * probe.depth;
                assert_eq!(nearest_line(&probe, at.x, at.z), line);
            }
        }
    }
}
