//! The B-mode image on the screen, with what a scanner writes around it.

use egui::{Align2, Color32, FontId, Mesh, Pos2, Rect, Shape, Stroke, Ui, pos2, vec2};

use super::engine::Frame;
use super::model::Model;
use super::style;
use crate::probe::Kind;

/// Room around the image, points: left (grey bar), top (texts), right (ruler), bottom.
const MARGINS: [f32; 4] = [52.0, 58.0, 64.0, 16.0];

/// Where a picture is on the screen.
pub(super) struct Place {
    /// The whole image, points.
    pub(super) rect: Rect,
    /// Points per mm.
    scale: f32,
    left: f32,
    top: f32,
}

impl Place {
    /// As large as fits into `area`.
    fn new(area: Rect, frame: &Frame) -> Self {
        let [left, top, right, bottom] = MARGINS;
        let room = Rect::from_min_max(area.min + vec2(left, top), area.max - vec2(right, bottom));
        let [width, height, _] = frame.image.extent();
        let texels = vec2(width as f32, height as f32);
        let scale = (room.size() / texels).min_elem().max(0.01);
        let x = room.center().x - texels.x * scale / 2.0;
        Self {
            rect: Rect::from_min_size(pos2(x, room.top()), texels * scale),
            scale: scale / frame.sector.pitch as f32,
            left: frame.sector.left as f32,
            top: frame.sector.top as f32,
        }
    }

    /// A point of the image plane, mm lateral and mm deep.
    pub(super) fn at(&self, lateral: f64, depth: f64) -> Pos2 {
        let from_corner = vec2(lateral as f32 - self.left, depth as f32 - self.top);
        self.rect.min + from_corner * self.scale
    }

    /// The point of the image plane at a place on the screen: lateral and depth, mm.
    pub(super) fn mm(&self, point: Pos2) -> [f64; 2] {
        let from_corner = (point - self.rect.min) / self.scale;
        [from_corner.x + self.left, from_corner.y + self.top].map(f64::from)
    }
}

/// Draws everything around the picture, into what is left of the window.
pub(super) fn show(ui: &mut Ui, frame: Option<&Frame>, model: &Model) -> Option<Place> {
    let area = ui.max_rect();
    let painter = ui.painter_at(area);
    let Some(frame) = frame else {
        let font = FontId::proportional(16.0);
        let text = "Preparing the simulation";
        painter.text(
            area.center(),
            Align2::CENTER_CENTER,
            text,
            font,
            style::FAINT,
        );
        return None;
    };
    let place = Place::new(area, frame);
    texts(&painter, area, frame, model);
    ruler(&painter, &place, frame);
    grey_bar(&painter, area, &place, model);
    orientation(&painter, &place, frame);
    Some(place)
}

fn texts(painter: &egui::Painter, area: Rect, frame: &Frame, model: &Model) {
    let (probe, imaging) = (&frame.probe, &model.settings.imaging);
    let kind = match probe.kind {
        Kind::Convex { .. } => "convex",
        Kind::Linear { .. } => "linear",
        Kind::Phased { .. } => "phased",
    };
    let settings = format!(
        "{kind}  {:.1} MHz  {:.0} mm  gain {:+.0} dB  range {:.0} dB",
        probe.frequency, probe.depth, imaging.gain, imaging.dynamic_range
    );
    let at = area.left_top() + vec2(12.0, 8.0);
    let title = FontId::proportional(15.0);
    painter.text(at, Align2::LEFT_TOP, &model.title, title, style::TEXT);
    let small = FontId::proportional(12.0);
    let below = at + vec2(0.0, 20.0);
    painter.text(
        below,
        Align2::LEFT_TOP,
        settings,
        small.clone(),
        style::FAINT,
    );
    let at = area.right_top() + vec2(-12.0, 8.0);
    let (word, colour) = match model.frozen {
        true => ("FROZEN", style::WARN),
        false => ("LIVE", style::ACCENT),
    };
    painter.text(
        at,
        Align2::RIGHT_TOP,
        word,
        FontId::proportional(15.0),
        colour,
    );
    let mut line = format!("{:.1} frames/s", 1e3 / frame.wall_ms.max(1e-3));
    if model.animated {
        line = format!("{:.2} s   {line}", frame.seconds);
    }
    painter.text(
        at + vec2(0.0, 20.0),
        Align2::RIGHT_TOP,
        line,
        small,
        style::FAINT,
    );
}

/// Millimetres between labels: as few as leave 40 points between them.
fn label_step(points_per_mm: f32) -> f64 {
    let steps = [5.0, 10.0, 20.0, 50.0, 100.0];
    let found = steps
        .into_iter()
        .find(|step| *step as f32 * points_per_mm >= 40.0);
    found.unwrap_or(200.0)
}

fn ruler(painter: &egui::Painter, place: &Place, frame: &Frame) {
    let x = place.rect.right() + 12.0;
    let (depth, step) = (frame.probe.depth, label_step(place.scale));
    let font = FontId::proportional(11.0);
    let line = Stroke::new(1.0, style::FAINT);
    let at = |mm: f64| pos2(x, place.at(0.0, mm).y);
    painter.line_segment([at(0.0), at(depth)], line);
    let minor = if step > 10.0 { 10.0 } else { 5.0 };
    for i in 0..=(depth / minor) as u32 {
        let mm = f64::from(i) * minor;
        let is_labelled = mm % step == 0.0;
        let length = if is_labelled { 8.0 } else { 4.0 };
        painter.line_segment([at(mm), at(mm) + vec2(length, 0.0)], line);
        if is_labelled {
            let text = if i == 0 {
                "0 mm".into()
            } else {
                format!("{mm:.0}")
            };
            let to = at(mm) + vec2(12.0, 0.0);
            painter.text(to, Align2::LEFT_CENTER, text, font.clone(), style::FAINT);
        }
    }
    // The transmit focus: a mark on the ruler.
    let tip = at(frame.probe.focus.min(depth)) - vec2(2.0, 0.0);
    let corners = vec![tip, tip + vec2(-8.0, -5.0), tip + vec2(-8.0, 5.0)];
    painter.add(Shape::convex_polygon(corners, style::ACCENT, Stroke::NONE));
}

/// White on top, the floor of the dynamic range at the bottom, by the grey map.
fn grey_bar(painter: &egui::Painter, area: Rect, place: &Place, model: &Model) {
    let imaging = &model.settings.imaging;
    let height = (place.rect.height() * 0.4).clamp(60.0, 240.0);
    let bar = Rect::from_min_size(
        pos2(area.left() + 14.0, place.rect.top() + 16.0),
        vec2(12.0, height),
    );
    const STEPS: u32 = 48;
    let mut mesh = Mesh::default();
    for i in 0..=STEPS {
        let share = i as f32 / STEPS as f32;
        let level = f64::from(1.0 - share).powf(imaging.grey_gamma);
        let colour = Color32::from_gray((255.0 * level).round() as u8);
        let y = bar.top() + share * bar.height();
        mesh.colored_vertex(pos2(bar.left(), y), colour);
        mesh.colored_vertex(pos2(bar.right(), y), colour);
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
    let above = bar.center_top() - vec2(0.0, 3.0);
    painter.text(
        above,
        Align2::CENTER_BOTTOM,
        "0 dB",
        font.clone(),
        style::FAINT,
    );
    let below = bar.center_bottom() + vec2(0.0, 3.0);
    let floor = format!("-{:.0}", imaging.dynamic_range);
    painter.text(below, Align2::CENTER_TOP, floor, font, style::FAINT);
}

/// The probe's mark: at the side of its first scanline, which is the image's left.
fn orientation(painter: &egui::Painter, place: &Place, frame: &Frame) {
    let (start, _) = frame.probe.ray(0, 0);
    let mark = place.at(start.x, start.z) + vec2(-14.0, -2.0);
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
            assert!(
                step as f32 * scale >= 40.0 || step == 200.0,
                "{scale}: {step}"
            );
        }
        assert_eq!(
            (label_step(8.0), label_step(4.0), label_step(1.0)),
            (5.0, 10.0, 50.0)
        );
    }
}
