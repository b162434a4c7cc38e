//! Messages about saving: done, under way, or failed.

use std::time::{Duration, Instant};

use egui::{Align2, Area, Frame, Id, ProgressBar, RichText, Sense, TextEdit, Ui, vec2};

use super::style::{self, button};
use super::tools::Tools;

/// Time for which a message about a saved file is shown.
const SHOWN: Duration = Duration::from_secs(6);
/// Time for which a warning is shown: longer than anybody works.
const LASTING: Duration = Duration::from_secs(24 * 3600);
/// Time between drawings of the progress.
const STEP: Duration = Duration::from_millis(100);

/// The messages to be shown.
#[derive(Default)]
pub(super) struct Notices {
    saved: Vec<(String, Instant)>,
    /// The reason why the last capture was not saved, until it is dismissed.
    failed: Option<String>,
}

impl Notices {
    /// Adds a message that something was done.
    pub(super) fn tell(&mut self, text: String) {
        self.failed = None;
        self.saved.push((text, Instant::now() + SHOWN));
    }

    /// Adds a message that stays until it is clicked.
    pub(super) fn warn(&mut self, text: String) {
        self.saved.push((text, Instant::now() + LASTING));
    }

    /// Takes away what was said of the capture before another one.
    pub(super) fn begin(&mut self) {
        self.failed = None;
    }

    /// Takes away messages that are true no longer.
    pub(super) fn outdate(&mut self) {
        self.saved.clear();
    }

    /// Returns whether the last capture was not saved.
    pub(super) fn has_failed(&self) -> bool {
        self.failed.is_some()
    }

    /// Sets the message that something could not be saved.
    pub(super) fn failed(&mut self, text: String) {
        self.failed = Some(text);
    }
}

/// Draws all messages above the bar.
pub(super) fn show(ui: &Ui, tools: &mut Tools) {
    tools.collect();
    let now = Instant::now();
    tools.notices.saved.retain(|(_, until)| *until > now);
    let soonest = tools.notices.saved.iter().map(|(_, until)| *until - now).min();
    if let Some(left) = soonest {
        ui.ctx().request_repaint_after(left);
    }
    let is_running = tools.captures.running().next().is_some();
    if is_running {
        ui.ctx().request_repaint_after(STEP);
    }
    if soonest.is_none() && !is_running && tools.notices.failed.is_none() {
        return;
    }
    let area = ui.max_rect();
    Area::new(Id::new("notices"))
        .pivot(Align2::CENTER_BOTTOM)
        .fixed_pos(area.center_bottom() - vec2(0.0, 10.0))
        .constrain_to(area)
        .show(ui.ctx(), |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width(440.0);
                running(ui, tools);
                tools.notices.saved.retain(|(text, _)| {
                    let label = egui::Label::new(text).sense(Sense::click());
                    !ui.add(label).on_hover_text("Click to dismiss").clicked()
                });
                failed(ui, tools);
            });
        });
}

fn running(ui: &mut Ui, tools: &Tools) {
    for progress in tools.captures.running() {
        let [done, total] = progress.count();
        ui.horizontal(|ui| {
            let share = done as f32 / total.max(1) as f32;
            let text = format!("saving {done} / {total}");
            ui.add(ProgressBar::new(share).desired_width(220.0).text(text));
            if button(ui, "Cancel", "Keep nothing of this clip; the loop stays") {
                progress.cancel();
            }
        });
    }
}

fn failed(ui: &mut Ui, tools: &mut Tools) {
    let Some(text) = tools.notices.failed.clone() else {
        return;
    };
    ui.label(RichText::new(text).color(style::WARN));
    ui.horizontal(|ui| {
        ui.label("Folder");
        let mut folder = tools.folder.display().to_string();
        let field = TextEdit::singleline(&mut folder).desired_width(240.0);
        if ui.add(field).changed() {
            tools.folder = folder.into();
        }
        if button(ui, "Try again", "Save into this folder what is shown now") {
            tools.notices.failed = None;
            tools.want_again();
        }
        if ui.button("Close").clicked() {
            tools.notices.failed = None;
        }
    });
}
