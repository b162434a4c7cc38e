//! The histogram: how the greys of the image, or of a region that is marked on it, are distributed, and what that says of
//! its speckle.

use std::time::Instant;

use egui::{Align2, FontId, Grid, Key, Pos2, Rect, ScrollArea, Sense, Ui, vec2};
use glam::{DVec2, dvec2};

use super::model::calipers::{Caliper, CaliperKind};
use super::model::sheet::What;
use super::panel::{Desk, Dock, Panel, Row};
use super::picture::Frame;
use super::style;
use crate::settings::Imaging;

/// Its row in the list of panels. A key opens it: the bar has room for no more buttons.
pub(super) const ROW: Row = Row {
    name: "Histogram",
    tip: "Greys of the image and of the regions that are marked on it, and their speckle",
    key: Some((Key::F4, "F4")),
    dock: Dock::Below { height: 168.0, alone: false },
    has_button: false,
};

/// Number of greys.
const GREYS: usize = 256;
/// Width of the table, points.
const TABLE: f32 = 400.0;
/// Width of the graph's bars together, points: two for each grey, if there is room.
const WIDEST: f32 = 512.0;
/// Least pixels for which statistics are given.
const LEAST: u32 = 50;

/// The panel.
#[derive(Default)]
pub(super) struct Histogram {
    /// The image's pixels, and when it was finished; none where the device could not be read.
    read: Option<(Instant, Option<Vec<u8>>)>,
    /// The letter of the region whose histogram is drawn; none: the whole image.
    chosen: Option<char>,
}

/// Greys of a region.
#[derive(Clone, Debug, PartialEq)]
struct Region {
    /// Pixels of each grey.
    greys: [u32; GREYS],
}

/// Figures of the echoes behind the greys of a region.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Speckle {
    /// Mean grey.
    grey: f64,
    /// Mean level, dB below white.
    level: f64,
    /// Mean of the amplitudes over their standard deviation: 1.91 of fully developed speckle.
    snr: f64,
    /// Shape of Nakagami's distribution, by moments: 1 of fully developed speckle, less where scatterers are few.
    nakagami: f64,
    /// Shares of pixels that are black and white.
    clipped: [f64; 2],
}

impl Region {
    /// The greys of an image's pixels, RGBA, where `contains` says so of their middles, in pixels.
    fn of(rgba: &[u8], width: u32, contains: impl Fn(DVec2) -> bool) -> Self {
        let mut greys = [0; GREYS];
        let rows = rgba.chunks_exact(4 * width.max(1) as usize);
        for (y, row) in rows.enumerate() {
            for (x, pixel) in row.as_chunks::<4>().0.iter().enumerate() {
                // Transparent beside the sector.
                if pixel[3] > 0 && contains(dvec2(x as f64 + 0.5, y as f64 + 0.5)) {
                    greys[usize::from(pixel[0])] += 1;
                }
            }
        }
        Self { greys }
    }

    fn pixels(&self) -> u32 {
        self.greys.iter().sum()
    }

    /// Figures of its echoes, by the grey map of the settings; none of too few pixels.
    fn speckle(&self, imaging: &Imaging) -> Option<Speckle> {
        let pixels = self.pixels();
        if pixels < LEAST {
            return None;
        }
        let mean = |value: &dyn Fn(f64) -> f64| {
            let sum: f64 =
                (0..).zip(&self.greys).map(|(i, &n)| f64::from(n) * value(f64::from(i))).sum();
            sum / f64::from(pixels)
        };
        let level =
            |grey: f64| (imaging.level(grey / (GREYS - 1) as f64) - 1.0) * imaging.dynamic_range;
        let power = |grey: f64| 10f64.powf(level(grey) / 10.0);
        let (amplitude, square) = (mean(&|grey| power(grey).sqrt()), mean(&power));
        let spread = |one: f64, two: f64| (two - one * one).max(0.0);
        let share = |grey: usize| f64::from(self.greys[grey]) / f64::from(pixels);
        Some(Speckle {
            grey: mean(&|grey| grey),
            level: mean(&level),
            snr: amplitude / spread(amplitude, square).sqrt(),
            nakagami: square * square / spread(square, mean(&|grey| power(grey).powi(2))),
            clipped: [share(0), share(GREYS - 1)],
        })
    }
}

/// Returns whether a point, mm, lies within the region that a measurement goes around; none of those that go around none.
fn encloses(caliper: &Caliper, point: DVec2) -> Option<bool> {
    let p = &caliper.points;
    match caliper.kind {
        CaliperKind::Distance | CaliperKind::Angle => None,
        CaliperKind::Ellipse => {
            let middle = (p[0] + p[1]) / 2.0;
            let along = |axis: DVec2| (point - middle).dot(axis) / axis.length_squared();
            Some(along(p[0] - middle).powi(2) + along(p[2] - middle).powi(2) <= 1.0)
        }
        CaliperKind::Trace => {
            let sides = p.iter().zip(p.iter().cycle().skip(1));
            let crossed = sides.filter(|(a, b)| {
                (a.y > point.y) != (b.y > point.y)
                    && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
            });
            Some(crossed.count() % 2 == 1)
        }
    }
}

impl Panel for Histogram {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let Some(frame) = desk.seen.frame else { return };
        if self.read.as_ref().is_none_or(|(of, _)| *of != frame.finished) {
            self.read = Some((frame.finished, frame.image.read_back().ok()));
        }
        let Some((_, Some(rgba))) = &self.read else { return };
        let [width, ..] = frame.image.extent();
        let place =
            |at: DVec2| dvec2(frame.sector.left, frame.sector.top) + at * frame.sector.pitch;
        let mut regions = vec![(None, Region::of(rgba, width, |_| true))];
        for mark in desk.model.sheet.marks() {
            let What::Caliper(caliper) = &mark.what else { continue };
            if encloses(caliper, DVec2::ZERO).is_some() {
                let contains = |at| encloses(caliper, place(at)).unwrap_or_default();
                regions.push((Some(mark.letter), Region::of(rgba, width, contains)));
            }
        }
        if regions.iter().all(|(letter, _)| *letter != self.chosen) {
            self.chosen = None;
        }
        ui.add_space(6.0);
        ScrollArea::horizontal().show(ui, |ui| {
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| {
                    ui.set_width(TABLE);
                    ScrollArea::vertical().show(ui, |ui| self.table(ui, &regions, frame));
                });
                ui.separator();
                let drawn = regions.iter().find(|(letter, _)| *letter == self.chosen);
                let (_, drawn) = drawn.expect("it was looked for");
                graph(ui, drawn);
            });
        });
    }

    fn leave(&mut self) {
        *self = Self::default();
    }

    fn lose(&mut self) {
        self.read = None;
    }
}

impl Histogram {
    fn table(&mut self, ui: &mut Ui, regions: &[(Option<char>, Region)], frame: &Frame) {
        Grid::new("regions").num_columns(7).spacing([10.0, 2.0]).show(ui, |ui| {
            for (head, tip) in [
                ("", "Ellipses (O) and outlines (J) on the image"),
                ("pixels", ""),
                ("grey", "Mean grey, 0 to 255"),
                ("dB", "Mean level below white, by the grey map"),
                ("SNR", "Mean over standard deviation of the amplitude; speckle of many scatterers has 1.91"),
                ("m", "Nakagami's shape; speckle of many scatterers has 1, of few less"),
                ("clipped", "Shares of pixels that are black and white: they falsify SNR and m"),
            ] {
                ui.small(head).on_hover_text(tip);
            }
            ui.end_row();
            for (letter, region) in regions {
                let name = letter.map_or("image".to_owned(), String::from);
                ui.selectable_value(&mut self.chosen, *letter, name);
                ui.monospace(region.pixels().to_string());
                match region.speckle(&frame.settings.imaging) {
                    Some(found) => {
                        ui.monospace(format!("{:.0}", found.grey));
                        ui.monospace(format!("{:.1}", found.level));
                        ui.monospace(format!("{:.2}", found.snr));
                        ui.monospace(format!("{:.2}", found.nakagami));
                        let [black, white] = found.clipped.map(|share| 100.0 * share);
                        ui.monospace(format!("{black:.0} % {white:.0} %"));
                    }
                    None => drop(ui.small("too few")),
                }
                ui.end_row();
            }
        });
        if regions.len() == 1 {
            ui.small("Freeze and draw an ellipse (O) or an outline (J) for a region of its own.");
        }
    }
}

/// Draws a bar for each grey; black and white, which may hold most pixels, are cut at the height of the others.
fn graph(ui: &mut Ui, region: &Region) {
    let size = vec2(ui.available_width().clamp(GREYS as f32, WIDEST), ui.available_height() - 6.0);
    let (area, response) = ui.allocate_exact_size(size, Sense::hover());
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 2.0, style::BACK);
    let most = region.greys[1..GREYS - 1].iter().copied().max().unwrap_or(0).max(1);
    let width = area.width() / GREYS as f32;
    for (grey, &pixels) in region.greys.iter().enumerate() {
        let high = area.height() * (pixels as f32 / most as f32).min(1.0);
        let left = area.left() + grey as f32 * width;
        let bar = [Pos2::new(left, area.bottom() - high), Pos2::new(left + width, area.bottom())];
        painter.rect_filled(Rect::from_min_max(bar[0], bar[1]), 0.0, style::ACCENT);
    }
    let pointed = response.hover_pos().map(|at| ((at.x - area.left()) / width) as usize);
    if let Some(grey) = pointed.filter(|grey| *grey < GREYS) {
        let text = format!("grey {grey}: {} pixels", region.greys[grey]);
        let at = area.left_top() + vec2(4.0, 2.0);
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(11.0), style::TEXT);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::settings::{Exam, GreyMap};

    /// Pixels of these greys in one row.
    fn row(greys: impl Iterator<Item = u8>) -> Vec<u8> {
        greys.flat_map(|grey| [grey, grey, grey, 255]).collect()
    }

    #[test]
    fn rayleigh_amplitudes_have_their_ratio_and_shape_through_every_grey_map() {
        for map in [GreyMap::Linear, GreyMap::SCurve] {
            let imaging = Imaging { grey_map: map, dynamic_range: 80.0, ..Imaging::default() };
            // Quantiles of an exponential intensity, 30 dB below white on the average.
            let grey = |i: u32| {
                let intensity = -(1.0 - (f64::from(i) + 0.5) / 50_000.0).ln();
                let level = 1.0 + (10.0 * intensity.log10() - 30.0) / 80.0;
                (imaging.grey(level) * 255.0).round() as u8
            };
            let rgba = row((0..50_000).map(grey));
            let found = Region::of(&rgba, 50_000, |_| true).speckle(&imaging).expect("enough");
            // A grey is up to a dB wide.
            assert!((found.snr - (PI / (4.0 - PI)).sqrt()).abs() < 0.02, "{map} {found:?}");
            assert!((found.nakagami - 1.0).abs() < 0.02, "{map} {found:?}");
            let euler = 10.0 / std::f64::consts::LN_10 * 0.577_216;
            assert!((found.level + 30.0 + euler).abs() < 0.1, "{map} {found:?}");
        }
        let imaging = Exam::Abdomen.imaging();
        let few = Region::of(&row([3; 20].into_iter()), 20, |_| true);
        assert_eq!((few.pixels(), few.speckle(&imaging)), (20, None));
        let half = row((0..100).map(|i| if i < 50 { 0 } else { 255 }));
        let found = Region::of(&half, 100, |_| true).speckle(&imaging).expect("enough");
        assert_eq!((found.clipped, found.grey), ([0.5; 2], 127.5));
    }

    #[test]
    fn regions_are_what_is_drawn_around_and_transparent_pixels_are_none() {
        let ellipse = Caliper::new(
            CaliperKind::Ellipse,
            vec![dvec2(10.0, 20.0), dvec2(30.0, 20.0), dvec2(20.0, 25.0)],
        );
        let trace = Caliper::new(
            CaliperKind::Trace,
            vec![dvec2(0.0, 0.0), dvec2(40.0, 0.0), dvec2(40.0, 30.0), dvec2(20.0, 10.0)],
        );
        let mut rgba = row((0..60 * 50).map(|_| 7));
        let count = |rgba: &[u8], caliper: &Caliper| {
            Region::of(rgba, 60, |at| encloses(caliper, at) == Some(true)).greys[7]
        };
        assert!((f64::from(count(&rgba, &ellipse)) - 50.0 * PI).abs() < 5.0);
        assert!((f64::from(count(&rgba, &trace)) - 500.0).abs() < 20.0);
        let line = Caliper::new(CaliperKind::Distance, vec![DVec2::ZERO, DVec2::ONE]);
        assert_eq!(encloses(&line, DVec2::ZERO), None);
        rgba.iter_mut().skip(3).step_by(4).for_each(|alpha| *alpha = 0);
        assert_eq!(count(&rgba, &ellipse), 0);
    }
}
