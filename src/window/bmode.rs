//! The B-mode image on the screen, with what a scanner writes around it.

use egui::text::{LayoutJob, TextWrapping};
use egui::{Align2, Color32, FontId, Mesh, Pos2, Rect, Shape, Stroke, Ui, pos2, vec2};

use super::framing::Framing;
use super::model::Model;
use super::picture::Frame;
use super::place::{NARROW, Place};
use super::{colour, real, strip, style};
use crate::probe::{Probe, ProbeKind};

/// Least height of the grey bar; with less room there is none, points.
const LEAST_BAR: f32 = 30.0;
/// Distance of the colour bar from the grey bar above it, points: two lines of text.
const BETWEEN: f32 = 34.0;
/// Height of a line of text below a bar, points.
const UNIT: f32 = 12.0;
/// Room for the word at the upper right, with both edges, points.
const STATE: f32 = 104.0;
/// Distance of the ruler from the image, points.
const RULER: f32 = 12.0;

/// Draws everything around a picture in `area`; `held`: it is held beside the one that goes on.
pub(super) fn show(
    ui: &Ui,
    area: Rect,
    frame: &Frame,
    held: bool,
    model: &Model,
    framing: &Framing,
) -> Option<Place> {
    let painter = ui.painter_at(area);
    let place = Place::new(area, frame, framing, ui.pixels_per_point());
    if !place.seen().is_positive() {
        // A window too small for any of it.
        return None;
    }
    texts(&painter, area, frame, held, model, framing);
    ruler(&painter, &place, frame);
    let bars = bars(area, &place, colour::is_shown(frame, model));
    if let Some(bar) = bars.first() {
        grey_bar(&painter, *bar, frame);
    }
    if let (Some(bar), Some(coloured)) = (bars.get(1), &frame.coloured) {
        colour::bar(&painter, *bar, frame, coloured);
    }
    orientation(&painter, &place, frame);
    real::legend(&painter, area, frame, model);
    real::tissues(&painter, area, frame, model);
    Some(place)
}

fn texts(
    painter: &egui::Painter,
    area: Rect,
    frame: &Frame,
    held: bool,
    model: &Model,
    framing: &Framing,
) {
    let (probe, imaging) = (&frame.probe, &frame.settings.imaging);
    let kind = match probe.kind {
        ProbeKind::Convex { .. } => "convex",
        ProbeKind::Linear { .. } => "linear",
        ProbeKind::Phased { .. } => "phased",
    };
    let mut settings = format!(
        "{kind}  {:.1} MHz  {:.0} mm  gain {:+.0} dB  range {:.0} dB",
        probe.frequency, probe.depth, imaging.gain, imaging.dynamic_range
    );
    if framing.zoom() > 1.0 {
        settings += &format!("  {:.1}x", framing.zoom());
    }
    let at = area.left_top() + vec2(12.0, 8.0);
    let title = FontId::proportional(15.0);
    let mut job = LayoutJob::simple_singleline(model.title.clone(), title, style::TEXT);
    job.wrap = TextWrapping::truncate_at_width(area.width() - STATE);
    painter.galley(at, painter.layout_job(job), style::TEXT);
    let small = FontId::proportional(12.0);
    let below = at + vec2(0.0, 20.0);
    let left = painter.text(below, Align2::LEFT_TOP, settings, small.clone(), style::FAINT);
    let at = area.right_top() + vec2(-12.0, 8.0);
    let (word, colour) = match (held, model.frozen) {
        (true, _) => ("HELD", style::WARN),
        (false, true) => ("FROZEN", style::WARN),
        (false, false) => ("LIVE", style::ACCENT),
    };
    painter.text(at, Align2::RIGHT_TOP, word, FontId::proportional(15.0), colour);
    let mut line = frame.grade.to_string();
    if let (Some(ms), false) = (frame.grade.pace_ms, model.frozen || held) {
        line = format!("{line}   {:.1} frames/s", 1e3 / ms.max(1e-3));
    }
    if let Some(said) = colour::said(frame, model) {
        line = format!("{said}   {line}");
    }
    if model.animated {
        let timed = format!("{:.2} s   {line}", frame.seconds);
        let shown = painter.layout_no_wrap(timed.clone(), small.clone(), style::FAINT);
        // The console has the time, too.
        if left.right() + 10.0 + shown.size().x < at.x {
            line = timed;
        }
    }
    // In a narrow window the probe's settings need this room.
    if area.width() < NARROW {
        return;
    }
    painter.text(at + vec2(0.0, 20.0), Align2::RIGHT_TOP, line, small.clone(), style::FAINT);
    if let Some((line, is_good)) = contact(frame, model) {
        let colour = if is_good { style::FAINT } else { style::WARN };
        // Above the ruler's first label.
        let font = FontId::proportional(11.0);
        painter.text(at + vec2(0.0, 34.0), Align2::RIGHT_TOP, line, font, colour);
    }
}

/// Share of the face in contact below which an examiner would add gel or pressure.
const GOOD_CONTACT: f64 = 0.9;

/// The text about contact with the skin, and whether contact is good.
fn contact(frame: &Frame, model: &Model) -> Option<(String, bool)> {
    let touch = frame.contact?;
    let held = match model.hold.as_ref().is_some_and(|hold| hold.stays) {
        true => "held   ",
        false => "",
    };
    // Rounded down: 100 % is shown only for a whole contact.
    let share = (100.0 * touch.share).floor();
    let text = format!("{held}contact {share:.0} %   pressed {:.1} mm", touch.depth);
    Some((text, touch.share >= GOOD_CONTACT))
}

/// Millimetres between labels: as few as leave 40 points between them.
fn label_step(points_per_mm: f32) -> f64 {
    let steps = [5.0, 10.0, 20.0, 50.0, 100.0];
    let found = steps.into_iter().find(|step| *step as f32 * points_per_mm >= 40.0);
    found.unwrap_or(200.0)
}

fn ruler(painter: &egui::Painter, place: &Place, frame: &Frame) {
    let seen = place.seen();
    let x = seen.right() + RULER;
    let shown = |mm: f64| (seen.top()..=seen.bottom()).contains(&place.at(0.0, mm).y);
    let (depth, step) = (frame.probe.depth, label_step(place.scale[1] as f32));
    let font = FontId::proportional(11.0);
    let line = Stroke::new(1.0, style::FAINT);
    let at = |mm: f64| pos2(x, place.at(0.0, mm).y);
    let within = |at: Pos2| pos2(at.x, at.y.clamp(seen.top(), seen.bottom()));
    painter.line_segment([within(at(0.0)), within(at(depth))], line);
    let minor = if step > 10.0 { 10.0 } else { 5.0 };
    for i in 0..=(depth / minor) as u32 {
        let mm = f64::from(i) * minor;
        // The face lies half a pixel below the image's edge.
        if !shown(mm) && i > 0 {
            continue;
        }
        let is_labelled = mm % step == 0.0;
        let length = if is_labelled { 8.0 } else { 4.0 };
        painter.line_segment([at(mm), at(mm) + vec2(length, 0.0)], line);
        if is_labelled {
            let text = if i == 0 { "0 mm".into() } else { format!("{mm:.0}") };
            let to = at(mm) + vec2(12.0, 0.0);
            painter.text(to, Align2::LEFT_CENTER, text, font.clone(), style::FAINT);
        }
    }
    // The transmit focus: a mark on the ruler; below the image its depth in words.
    let focus = frame.probe.focus;
    if focus > depth {
        let text = format!("focus {focus:.0}");
        let below = within(at(depth)) + vec2(-2.0, 8.0);
        painter.text(below, Align2::CENTER_TOP, text, font, style::ACCENT);
    } else if shown(focus) {
        let middle = focus_mark(place, &frame.probe);
        let corners = [vec2(4.0, 0.0), vec2(-4.0, -5.0), vec2(-4.0, 5.0)].map(|to| middle + to);
        painter.add(Shape::convex_polygon(corners.to_vec(), style::ACCENT, Stroke::NONE));
    }
}

/// Middle of the mark of a probe's transmit focus on the ruler; a focus below the image has it at the lower end.
pub(super) fn focus_mark(place: &Place, probe: &Probe) -> Pos2 {
    let seen = place.seen();
    let y = place.at(0.0, probe.focus.min(probe.depth)).y;
    pos2(seen.right() + RULER - 6.0, seen.y_range().clamp(y))
}

/// Places of the grey bar and, with `colours`, of the colour bar below it; none where they have no room.
fn bars(area: Rect, place: &Place, colours: bool) -> Vec<Rect> {
    let top = place.seen().top() + 16.0;
    // Above the tools with the number at its lower end.
    let room = strip::top(area) - 18.0 - top;
    let height = (place.seen().height() * 0.4).clamp(60.0, 240.0);
    let count = 1 + u8::from(colours);
    // The unit of velocities stands below their bar.
    let room = if colours { room - BETWEEN - UNIT } else { room };
    let height = height.min(room / f32::from(count));
    let at = |number: u8| top + f32::from(number) * (height + BETWEEN);
    let bar =
        |number| Rect::from_min_size(pos2(area.left() + 14.0, at(number)), vec2(12.0, height));
    if height < LEAST_BAR { Vec::new() } else { (0..count).map(bar).collect() }
}

/// Draws a bar whose sides have the colours of a share of the way from its top to its bottom, with a text above and one below.
pub(super) fn bar(
    painter: &egui::Painter,
    bar: Rect,
    sides: impl Fn(f32) -> [Color32; 2],
    [above, below]: [String; 2],
) {
    const STEPS: u32 = 64;
    let mut mesh = Mesh::default();
    for i in 0..=STEPS {
        let share = i as f32 / STEPS as f32;
        let [left, right] = sides(share);
        let y = bar.top() + share * bar.height();
        mesh.colored_vertex(pos2(bar.left(), y), left);
        mesh.colored_vertex(pos2(bar.right(), y), right);
        if i > 0 {
            let k = 2 * i;
            mesh.add_triangle(k - 2, k - 1, k);
            mesh.add_triangle(k - 1, k, k + 1);
        }
    }
    painter.add(mesh);
    painter.rect_stroke(
        bar,
        0.0,
        Stroke::new(1.0, Color32::from_gray(70)),
        egui::StrokeKind::Outside,
    );
    let font = FontId::proportional(10.0);
    let at = bar.center_top() - vec2(0.0, 3.0);
    painter.text(at, Align2::CENTER_BOTTOM, above, font.clone(), style::FAINT);
    let at = bar.center_bottom() + vec2(0.0, 3.0);
    painter.text(at, Align2::CENTER_TOP, below, font, style::FAINT);
}

/// Draws the grey bar by the grey map: white on top, the lower end of the dynamic range at the bottom.
fn grey_bar(painter: &egui::Painter, place: Rect, frame: &Frame) {
    let imaging = &frame.settings.imaging;
    let grey = |share: f32| {
        let grey = imaging.grey(f64::from(1.0 - share));
        [Color32::from_gray((255.0 * grey).round() as u8); 2]
    };
    bar(painter, place, grey, ["0 dB".to_owned(), format!("-{:.0}", imaging.dynamic_range)]);
}

/// Draws the probe's mark, at the side of its first scanline, which is the image's left.
fn orientation(painter: &egui::Painter, place: &Place, frame: &Frame) {
    let (start, _) = frame.probe.ray(0, 0);
    let outwards = if place.flipped[0] { 14.0 } else { -14.0 };
    let seen = place.seen().expand2(vec2(14.0, 2.0));
    // Beside an enlarged image it is at the side where the first scanline lies.
    let mark = seen.clamp(place.at(start.x, start.z) + vec2(outwards, -2.0));
    painter.circle_filled(mark, 5.0, style::ACCENT);
    painter.circle_stroke(mark, 5.0, Stroke::new(1.0, Color32::BLACK));
}

#[cfg(test)]
mod tests {
    use super::label_step;

    #[test]
    fn labels_never_touch() {
        for scale in [0.1_f32, 0.5, 1.0, 2.0, 3.9, 4.0, 9.0] {
            let step = label_step(scale);
            assert!(step as f32 * scale >= 40.0 || step == 200.0, "{scale}: {step}");
        }
        assert_eq!((label_step(8.0), label_step(4.0), label_step(1.0)), (5.0, 10.0, 50.0));
    }
}
