//! Colours and sizes: dark, as the room for scanning.

use egui::{Align2, Color32, ComboBox, CornerRadius, Response, Ui, Visuals, WidgetText, Window};

/// Background of graphs.
pub(super) const BACK: Color32 = Color32::from_rgb(14, 16, 18);
/// Panels.
const PANEL: Color32 = Color32::from_rgb(27, 30, 34);
/// Marks and bars.
pub(super) const ACCENT: Color32 = Color32::from_rgb(92, 176, 196);
/// Text on the image.
pub(super) const TEXT: Color32 = Color32::from_rgb(208, 212, 216);
/// Less important text.
pub(super) const FAINT: Color32 = Color32::from_rgb(140, 146, 152);
/// Warnings and errors.
pub(super) const WARN: Color32 = Color32::from_rgb(232, 170, 84);
/// A recording under way.
pub(super) const RED: Color32 = Color32::from_rgb(236, 70, 64);

/// Sets up the interface's look.
pub(super) fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    let mut visuals = Visuals::dark();
    visuals.panel_fill = PANEL;
    visuals.window_fill = PANEL;
    visuals.extreme_bg_color = BACK;
    visuals.override_text_color = Some(TEXT);
    visuals.selection.bg_fill = Color32::from_rgb(36, 92, 108);
    visuals.slider_trailing_fill = true;
    visuals.menu_corner_radius = CornerRadius::same(4);
    ctx.set_visuals_of(egui::Theme::Dark, visuals);
    ctx.all_styles_mut(|style| {
        // Each step of a fade would redraw a window in which nothing has changed.
        style.animation_time = 0.0;
        style.spacing.slider_width = 110.0;
        style.spacing.combo_width = 110.0;
    });
}

/// A button with an explanation; returns whether it was clicked.
pub(super) fn button(ui: &mut Ui, word: &str, tip: impl Into<WidgetText>) -> bool {
    ui.button(word).on_hover_text(tip).clicked()
}

/// A list to choose a value from.
pub(super) fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    id: &str,
    width: f32,
    value: &mut T,
    all: &[T],
    name: impl Fn(T) -> String,
) -> Response {
    let list = ComboBox::from_id_salt(id).width(width).selected_text(name(*value));
    let shown = list.show_ui(ui, |ui| {
        for &one in all {
            ui.selectable_value(value, one, name(one));
        }
    });
    shown.response
}

/// A window in the middle over the image, `top` points below its edge.
pub(super) fn window(title: &str, top: f32) -> Window<'_> {
    Window::new(title).anchor(Align2::CENTER_TOP, [0.0, top]).resizable(false).collapsible(false)
}
