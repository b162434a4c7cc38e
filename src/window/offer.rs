//! The offer to take up what an earlier session of the scene has left unsaved.

use egui::{Key, Ui};

use super::keeper::Orphan;
use super::model::age;
use super::state::State;
use super::style::{self, button};

/// Width of the offer, points.
const WIDTH: f32 = 400.0;

/// An answer to the offer.
enum Answer {
    TakeUp,
    Discard,
    Later,
}

/// Draws the offer, if there is one.
pub(super) fn show(ctx: &egui::Context, state: &mut State) {
    let Some(orphan) = state.offer.take() else {
        return;
    };
    let shown = style::window("Unsaved work", 64.0).show(ctx, |ui| {
        ui.set_width(WIDTH);
        contents(ui, &orphan)
    });
    match shown.and_then(|shown| shown.inner).flatten() {
        Some(Answer::TakeUp) => state.taken_up = Some(orphan),
        Some(Answer::Discard) => orphan.discard(),
        // It is offered again at the next start.
        Some(Answer::Later) => {}
        None => state.offer = Some(orphan),
    }
}

fn contents(ui: &mut Ui, orphan: &Orphan) -> Option<Answer> {
    let (since, _) = age(orphan.age());
    ui.label(format!("A session with this scene ended {since} ago and had not saved:"));
    for what in orphan.what() {
        ui.label(what);
    }
    ui.add_space(4.0);
    let mut answer = None;
    ui.horizontal(|ui| {
        let take = ui.button("Take it up").on_hover_text("Enter; Undo takes it back");
        if ui.memory(|memory| memory.focused().is_none()) {
            take.request_focus();
        }
        if take.clicked() {
            answer = Some(Answer::TakeUp);
        }
        if button(ui, "Discard", "It is lost") {
            answer = Some(Answer::Discard);
        }
        let escape = ui.input(|input| input.key_pressed(Key::Escape));
        if button(ui, "Later", "Ask at the next start (Esc)") || escape {
            answer = Some(Answer::Later);
        }
    });
    answer
}
