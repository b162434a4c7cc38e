//! The list of tissues over the 3D view.

use egui::{
    Color32, CornerRadius, Rect, RichText, ScrollArea, Sense, Stroke, StrokeKind, Ui, vec2,
};

use crate::model::{Show, Shown};
use crate::style;

/// Width of the list, points.
const WIDTH: f32 = 176.0;

/// Draws the list at the left edge of `area`.
pub(super) fn show(ui: &mut Ui, area: Rect, shown: &mut [Shown]) {
    let corner = area.left_top() + vec2(10.0, 38.0);
    let room = vec2(WIDTH, (area.height() - 70.0).max(60.0));
    let builder = egui::UiBuilder::new().max_rect(Rect::from_min_size(corner, room));
    ui.scope_builder(builder, |ui| {
        egui::Frame::NONE
            .fill(Color32::from_rgba_unmultiplied(20, 23, 27, 215))
            .corner_radius(4.0)
            .inner_margin(6.0)
            .show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 2.0;
                ui.horizontal(|ui| {
                    for (word, show, tip) in [
                        ("All", None, "Show every tissue as it was"),
                        ("None", Some(Show::Hidden), "Hide every tissue"),
                        ("Glass", Some(Show::SeeThrough), "Show every tissue as glass"),
                    ] {
                        if ui.small_button(word).on_hover_text(tip).clicked() {
                            for tissue in shown.iter_mut() {
                                set(tissue, show);
                            }
                        }
                    }
                });
                ScrollArea::vertical().show(ui, |ui| {
                    for tissue in shown.iter_mut() {
                        row(ui, tissue);
                    }
                });
            });
    });
}

/// Sets a tissue's visibility; with none, the one before it was hidden.
fn set(tissue: &mut Shown, show: Option<Show>) {
    match show {
        Some(Show::Hidden) if tissue.show == Show::Hidden => {}
        None if tissue.show != Show::Hidden => {}
        Some(Show::Hidden) | None => tissue.toggle(),
        Some(show) => tissue.show = show,
    }
}

fn row(ui: &mut Ui, tissue: &mut Shown) {
    ui.horizontal(|ui| {
        let tip = "Show or hide";
        let (swatch, clicked) = ui.allocate_exact_size(vec2(16.0, 16.0), Sense::click());
        paint(ui, swatch.shrink(1.5), tissue);
        let is_hidden = tissue.show == Show::Hidden;
        let colour = if is_hidden { style::FAINT } else { style::TEXT };
        let words = tissue.name.replace('_', " ");
        let name = egui::Label::new(RichText::new(words).color(colour)).truncate();
        let size = vec2(WIDTH - 74.0, 16.0);
        let label = ui.add_sized(size, name.sense(Sense::click()));
        if clicked.on_hover_text(tip).clicked() || label.on_hover_text(tip).clicked() {
            tissue.toggle();
        }
        let mut glass = tissue.show == Show::SeeThrough;
        let button = ui.toggle_value(&mut glass, RichText::new("glass").small());
        if button.on_hover_text("Let see what is within").clicked() {
            tissue.toggle_glass();
        }
    });
}

/// Draws a tissue's sign. Full: solid; half: glass; empty: hidden.
fn paint(ui: &Ui, rect: Rect, tissue: &Shown) {
    let [r, g, b] = tissue.colour;
    let colour = Color32::from_rgb(r, g, b);
    let corners = CornerRadius::same(3);
    let painter = ui.painter();
    match tissue.show {
        Show::Solid => painter.rect_filled(rect, corners, colour),
        Show::SeeThrough => painter.rect_filled(rect, corners, colour.gamma_multiply(0.4)),
        Show::Hidden => painter.rect_filled(rect, corners, Color32::TRANSPARENT),
    };
    let line = Stroke::new(1.0, colour);
    painter.rect_stroke(rect, corners, line, StrokeKind::Inside);
}
