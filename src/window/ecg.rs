//! The electrocardiogram at the lower edge of an image of the heart.

use egui::{Align2, Color32, FontId, Pos2, Shape, Stroke, Ui, pos2};

use super::picture::Frame;
use super::place::Place;
use crate::scene::animation::Clock;
use insonify_lab::exam::ecg::ecg;

/// Time that the trace shows, s: as scanners, some beats.
const SHOWN: f64 = 3.0;
/// Height of the R wave, and distance of the baseline from the lower edge, points.
const HEIGHT: f32 = 26.0;
const BASE: f32 = 20.0;
/// Height of an image below which the trace would hide it, points.
const LEAST: f32 = 120.0;
/// The trace is green on scanners.
const COLOUR: Color32 = Color32::from_rgb(90, 220, 120);

/// Draws the trace up to the newest image, and marks the time of the one that is shown. None without a beat.
pub(super) fn show(
    ui: &Ui,
    place: &Place,
    frame: &Frame,
    newest: Option<f64>,
    beat: Option<Clock>,
) {
    let Some(beat) = beat.filter(|_| place.room.height() > LEAST) else { return };
    let [begin, end] = span(frame.seconds, newest.unwrap_or(frame.seconds));
    let room = place.room;
    let x = |seconds: f64| room.left() + room.width() * ((seconds - begin) / SHOWN) as f32;
    let y = |height: f64| ui.max_rect().bottom() - BASE - HEIGHT * height as f32;
    let painter = ui.painter_at(ui.max_rect());
    // One point of the trace for each of the screen: R is some points wide.
    let count = room.width().max(2.0) as u32;
    let at = |i: u32| {
        let seconds = begin + (end - begin) * f64::from(i) / f64::from(count);
        pos2(x(seconds), y(height(&beat, seconds)))
    };
    let trace: Vec<Pos2> = (0..=count).map(at).collect();
    painter.add(Shape::line(trace, Stroke::new(1.2, COLOUR)));
    let here = x(frame.seconds);
    let line = Stroke::new(1.5, COLOUR.gamma_multiply(0.8));
    painter.vline(here, y(1.1)..=y(-0.35), line);
    painter.circle_filled(pos2(here, y(height(&beat, frame.seconds))), 3.0, COLOUR);
    let rate = format!("{:.0} /min", 60.0 / beat.period);
    let font = FontId::proportional(11.0);
    painter.text(pos2(room.right() + 6.0, y(0.0)), Align2::LEFT_CENTER, rate, font, COLOUR);
}

/// Begin and end of what is shown, s, of a loop that ends with `newest`: it ends there, unless the image is older than
/// what then has room.
fn span(shown: f64, newest: f64) -> [f64; 2] {
    let end = if newest - shown > SHOWN || newest < shown { shown } else { newest };
    [end - SHOWN, end]
}

/// Height of the trace at a time of the scene: R is where the cycle begins.
fn height(beat: &Clock, seconds: f64) -> f64 {
    // Where the model is updated in steps the heart's current goes on.
    ecg(Clock { rate: None, ..*beat }.position(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn r_is_where_the_cycle_begins_and_the_shown_image_is_on_the_trace() {
        let beat = Clock { period: 0.85, phase: 0.25, rate: Some(8.0), ..Clock::default() };
        let begins = 0.75 * 0.85;
        for cycle in 0..4 {
            let r = begins + 0.85 * f64::from(cycle);
            assert!(height(&beat, r) > 0.9, "cycle {cycle}");
            assert!(height(&beat, r + 0.425) < 0.2, "cycle {cycle}");
        }
        assert_eq!(span(7.0, 7.0), [4.0, 7.0], "live");
        assert_eq!(span(5.0, 7.0), [4.0, 7.0], "frozen, two seconds back");
        assert_eq!(span(2.0, 7.0), [-1.0, 2.0], "farther back");
        assert_eq!(span(9.0, 1.0), [6.0, 9.0], "time was set back");
    }
}
