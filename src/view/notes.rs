//! Texts on the image: the drawing, and the field in which one is typed.

use egui::{Area, Color32, Context, Id, Order, Painter, Pos2, Stroke, TextEdit, Ui, vec2};

use super::bmode::Place;
use super::calipers::{label, to_screen};
use super::model::sheet::{Note, Sheet, What};

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

/// The field of the note that is being written.
pub(super) fn editor(ui: &Ui, sheet: &mut Sheet, place: &Place) {
    let Some(index) = sheet.editing() else { return };
    if let What::Note(note) = &sheet.marks()[index].what {
        let (text, at) = (note.text.clone(), to_screen(place, note.at));
        field(ui.ctx(), sheet, index, text, at);
    }
}

/// The field in which a note is typed; Enter or a click elsewhere keeps it.
fn field(context: &Context, sheet: &mut Sheet, index: usize, mut text: String, at: Pos2) {
    Area::new(Id::new(("note", index)))
        .order(Order::Foreground)
        .fixed_pos(at - vec2(4.0, 11.0))
        .show(context, |ui| {
            let field =
                TextEdit::singleline(&mut text).desired_width(150.0).hint_text("text, Enter");
            let response = ui.add(field);
            // The last letters may have come together with Enter.
            sheet.set_text(index, text);
            match response.lost_focus() {
                true => sheet.stop_editing(),
                false => response.request_focus(),
            }
        });
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
                field(ui.ctx(), &mut sheet, index, text, pos2(50.0, 50.0));
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
