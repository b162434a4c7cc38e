//! Texts on the image: the drawing, and the field in which one is typed.

use egui::{Area, Color32, Context, Frame, Id, Order, Painter, Pos2, Stroke, TextEdit, Ui, vec2};

use super::calipers::{label, to_screen};
use super::model::sheet::{Note, Sheet, What};
use super::place::Place;
use crate::settings::Exam;
use insonify_lab::exam::annotations;

/// Draws an arrow from a text to the point it names.
pub(super) fn arrow(painter: &Painter, from: Pos2, tip: Pos2, colour: Color32) {
    let way = (tip - from).normalized();
    let side = way.rot90();
    let line = Stroke::new(1.4, colour);
    painter.line_segment([from, tip], line);
    for side in [side, -side] {
        painter.line_segment([tip, tip - 9.0 * way + 4.0 * side], line);
    }
}

/// Draws a text, and the arrow to the point it names.
pub(super) fn write(painter: &Painter, place: &Place, note: &Note, colour: Color32) {
    let at = to_screen(place, note.at);
    if let Some(tip) = note.arrow {
        arrow(painter, at, to_screen(place, tip), colour);
    }
    label(painter, at, &note.text, colour);
}

/// The field of the note that is being written, with the texts usual in the examination.
pub(super) fn editor(ui: &Ui, sheet: &mut Sheet, place: &Place, exam: Exam) {
    let Some(index) = sheet.editing() else { return };
    if let What::Note(note) = &sheet.marks()[index].what {
        let (text, at) = (note.text.clone(), to_screen(place, note.at));
        field(ui.ctx(), sheet, index, text, exam, at);
    }
}

/// The field in which a note is typed or chosen; Enter or a click elsewhere keeps it.
fn field(
    context: &Context,
    sheet: &mut Sheet,
    index: usize,
    mut text: String,
    exam: Exam,
    at: Pos2,
) {
    let id = Id::new(("note", index));
    // The list takes the focus from the field before the click on it has ended.
    let listed = context.memory(|memory| memory.area_rect(id));
    let area = Area::new(id).order(Order::Foreground).fixed_pos(at - vec2(4.0, 11.0));
    area.constrain(true).show(context, |ui| {
        let field = TextEdit::singleline(&mut text).desired_width(150.0).hint_text("text, Enter");
        let response = ui.add(field);
        // The last letters may have come together with Enter.
        sheet.set_text(index, text);
        let chosen = choose(ui, annotations(exam));
        let pressed = ui.input(|input| {
            let at = input.pointer.interact_pos().filter(|_| input.pointer.any_pressed());
            at.is_some_and(|at| listed.is_some_and(|area| area.contains(at)))
        });
        if let Some(chosen) = chosen {
            sheet.set_text(index, chosen.to_owned());
            sheet.stop_editing();
        } else if response.lost_focus() && !pressed {
            sheet.stop_editing();
        } else if !ui.input(|input| input.pointer.any_down()) {
            response.request_focus();
        }
    });
}

/// Draws texts side by side, as many as there are; returns the one that is clicked.
fn choose(ui: &mut Ui, texts: &[&'static str]) -> Option<&'static str> {
    let mut chosen = None;
    Frame::popup(ui.style()).inner_margin(3).show(ui, |ui| {
        ui.set_max_width(220.0);
        ui.spacing_mut().item_spacing = vec2(3.0, 3.0);
        ui.horizontal_wrapped(|ui| {
            for text in texts {
                if ui.small_button(*text).clicked() {
                    chosen = Some(*text);
                }
            }
        });
    });
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, Key, Modifiers, RawInput, pos2};
    use glam::{DAffine3, dvec2};

    use super::super::model::sheet::{Moment, Tool};

    fn key(key: Key, pressed: bool) -> Event {
        Event::Key { key, physical_key: None, pressed, repeat: false, modifiers: Modifiers::NONE }
    }

    #[test]
    fn letters_that_come_together_with_enter_are_kept() {
        let mut sheet = Sheet::default();
        let now = Moment { pose: DAffine3::IDENTITY, seconds: 0.0 };
        sheet.take(Some(Tool::Note));
        sheet.press(dvec2(5.0, 10.0), 1.0, now);
        sheet.release(dvec2(5.0, 10.0), 1.0);
        let context = Context::default();
        let mut draw = |events| {
            let input = RawInput { events, ..RawInput::default() };
            let mut output = context.run_ui(input, |ui| {
                let Some(index) = sheet.editing() else { return };
                let What::Note(note) = &sheet.marks()[index].what else {
                    panic!("a note is edited");
                };
                let text = note.text.clone();
                field(ui.ctx(), &mut sheet, index, text, Exam::Cardiac, pos2(50.0, 50.0));
            });
            output.textures_delta.clear();
        };
        draw(Vec::new());
        draw(Vec::new());
        draw(["c", "y"].map(|letter| Event::Text(letter.into())).to_vec());
        let last = ["s", "t"].map(|letter| Event::Text(letter.into()));
        draw([&last[..], &[key(Key::Enter, true), key(Key::Enter, false)]].concat());
        draw(Vec::new());
        let What::Note(note) = &sheet.marks()[0].what else {
            panic!("a note stays");
        };
        assert_eq!((note.text.as_str(), sheet.editing()), ("cyst", None));
    }
}
