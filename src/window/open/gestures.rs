//! Input in steps that the interface understands: press, movement and release apart, and what is typed after a click.

use egui::{Context, Event, Key, RawInput};

/// Has press and release in one place be a click however long they lie apart: egui measures that by the times of its
/// passes, and on a slow machine the pass with the release may begin a second after that with the press.
pub(super) fn click_slowly(context: &Context) {
    context.options_mut(|options| options.input_options.max_click_duration = f64::INFINITY);
}

/// The input in passes, to be given to the interface one after the other: in none does the pointer move before or
/// after a button changes, and nothing is typed after a click or a key that may have moved the keyboard to another field,
/// or away from it. Where the window is drawn more slowly than a hand drags or types, all of that may lie between two
/// drawings. egui takes all events of one input to have happened at the pointer's last place and with the keyboard where
/// it was, would see no drag, and what is typed into a field would drive the scanner.
pub(super) fn passes(mut input: RawInput) -> Vec<RawInput> {
    let mut groups = vec![Vec::new()];
    for event in std::mem::take(&mut input.events) {
        let group = groups.last_mut().expect("there is one");
        let mixed = match event {
            Event::PointerMoved(_) => group.iter().any(is_button),
            Event::PointerButton { .. } => group.iter().any(is_motion),
            Event::Key { pressed: true, .. } | Event::Text(_) | Event::Ime(_) | Event::Paste(_) => {
                group.iter().any(|event| is_button(event) || leaves_field(event))
            }
            _ => false,
        };
        match mixed {
            true => groups.push(vec![event]),
            false => group.push(event),
        }
    }
    let pass = |events| RawInput { events, ..input.clone() };
    groups.into_iter().map(pass).collect()
}

fn is_motion(event: &Event) -> bool {
    matches!(event, Event::PointerMoved(_))
}

fn is_button(event: &Event) -> bool {
    matches!(event, Event::PointerButton { .. })
}

fn leaves_field(event: &Event) -> bool {
    matches!(event, Event::Key { key: Key::Enter | Key::Escape | Key::Tab, pressed: true, .. })
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Modifiers, PointerButton, Pos2, Rect, Sense, Vec2, pos2};

    fn moved(x: f32) -> Event {
        Event::PointerMoved(pos2(x, 50.0))
    }

    fn button(x: f32, pressed: bool) -> Event {
        Event::PointerButton {
            pos: pos2(x, 50.0),
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        }
    }

    fn key(key: Key) -> Event {
        let modifiers = Modifiers::NONE;
        Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
    }

    /// Distance by which a panel from x = 20 on was dragged, and number of clicks on it.
    fn drawn(context: &Context, inputs: Vec<RawInput>) -> (Vec2, usize) {
        let (mut by, mut clicks) = (Vec2::ZERO, 0);
        for input in inputs {
            let mut output = context.run_ui(input, |ui| {
                let rect = Rect::from_min_size(pos2(20.0, 0.0), Vec2::splat(400.0));
                let response = ui.interact(rect, ui.id().with("panel"), Sense::click_and_drag());
                by += response.drag_delta();
                clicks += usize::from(response.clicked());
            });
            output.textures_delta.clear();
        }
        (by, clicks)
    }

    fn input(events: Vec<Event>) -> RawInput {
        RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, Vec2::splat(500.0))),
            events,
            ..RawInput::default()
        }
    }

    #[test]
    fn a_drag_between_two_pictures_is_a_drag_all_of_its_way() {
        let drag = [vec![moved(10.0), moved(100.0), button(100.0, true)]];
        let way = [vec![moved(130.0), moved(190.0), button(190.0, false)]];
        let after = [vec![moved(300.0), moved(310.0)]];
        let events = || [&drag[..], &way[..], &after[..]].concat().concat();
        let context = Context::default();
        drawn(&context, vec![input(Vec::new()); 2]);
        assert_eq!(drawn(&context, vec![input(events())]).0, Vec2::ZERO, "as egui has it");
        let (by, clicks) = drawn(&context, passes(input(events())));
        assert_eq!((by, clicks), (Vec2::new(90.0, 0.0), 0));
    }

    #[test]
    fn a_click_between_two_pictures_is_one_where_it_was() {
        let context = Context::default();
        drawn(&context, vec![input(Vec::new()); 2]);
        let events = vec![moved(100.0), button(100.0, true), button(100.0, false), moved(5.0)];
        let (by, clicks) = drawn(&context, passes(input(events)));
        assert_eq!((by, clicks), (Vec2::ZERO, 1));
    }

    #[test]
    fn a_click_that_takes_two_slow_pictures_is_one() {
        let clicks = |context: &Context| {
            let events =
                [vec![moved(100.0)], vec![button(100.0, true)], vec![button(100.0, false)]];
            let at = |(i, events)| RawInput { time: Some(2.0 * f64::from(i)), ..input(events) };
            drawn(context, (0u32..).zip(events).map(at).collect()).1
        };
        assert_eq!(clicks(&Context::default()), 0, "as egui has it");
        let context = Context::default();
        click_slowly(&context);
        assert_eq!(clicks(&context), 1);
    }

    #[test]
    fn what_is_typed_between_two_pictures_goes_where_the_click_was_and_no_farther_than_enter() {
        let typed = |letter: &str| [key(Key::C), Event::Text(letter.to_owned())];
        let mut events = vec![moved(30.0), button(30.0, true), button(30.0, false)];
        events.extend(typed("c"));
        events.extend(typed("d"));
        events.extend([key(Key::Enter), key(Key::ArrowRight)]);
        // The text of a field, and the keys that come while it does not have the keyboard.
        let run = |inputs: Vec<RawInput>| {
            let (context, mut text, mut free) = (Context::default(), String::new(), 0);
            for input in [vec![input(Vec::new()); 2], inputs].concat() {
                let mut output = context.run_ui(input, |ui| {
                    if !ui.ctx().egui_wants_keyboard_input() {
                        let is_key = |event: &&Event| matches!(event, Event::Key { .. });
                        free += ui.input(|input| input.events.iter().filter(is_key).count());
                    }
                    let rect = Rect::from_min_size(pos2(20.0, 40.0), Vec2::new(200.0, 20.0));
                    ui.put(rect, egui::TextEdit::singleline(&mut text));
                });
                output.textures_delta.clear();
            }
            (text, free)
        };
        let (text, free) = run(vec![input(events.clone())]);
        assert!(text.is_empty() && free == 4, "as egui has it: {text} {free}");
        assert_eq!(run(passes(input(events))), ("cd".to_owned(), 1));
    }

    // `145 mm` and Enter became 14 mm.
    #[test]
    fn a_number_that_is_typed_with_enter_between_two_pictures_is_taken_whole() {
        let typed = |text: &str| -> Vec<Event> {
            text.chars().map(|letter| Event::Text(letter.to_string())).collect()
        };
        let click = vec![moved(30.0), button(30.0, true), button(30.0, false)];
        let enter = vec![key(Key::Enter)];
        let all = |events: &[Vec<Event>]| passes(input(events.concat()));
        for (what, inputs) in [
            ("at once", all(&[click.clone(), typed("145 mm"), enter.clone()])),
            (
                "in two",
                [all(&[click.clone(), typed("14")]), all(&[typed("5 mm"), enter.clone()])].concat(),
            ),
            ("after the click", [all(&[click]), all(&[typed("145 mm"), enter])].concat()),
        ] {
            let (context, mut value) = (Context::default(), 90.0_f64);
            for input in [vec![input(Vec::new()); 2], inputs, vec![input(Vec::new()); 2]].concat() {
                let mut output = context.run_ui(input, |ui| {
                    let rect = Rect::from_min_size(pos2(20.0, 40.0), Vec2::new(200.0, 20.0));
                    let drag = egui::DragValue::new(&mut value).suffix(" mm");
                    let read = |text: &str| crate::settings::units::LENGTH.finite(text).ok();
                    ui.put(rect, drag.custom_parser(read));
                    value = value.clamp(10.0, 300.0);
                });
                output.textures_delta.clear();
            }
            assert_eq!(value, 145.0, "{what}");
        }
    }

    #[test]
    fn events_of_one_kind_stay_together_and_in_order() {
        let events = vec![Event::Copy, moved(1.0), Event::Cut, moved(2.0)];
        let made = passes(input(events.clone()));
        assert_eq!(made.len(), 1);
        assert_eq!(made[0].events, events);
        assert_eq!(passes(input(Vec::new())).len(), 1);
        let order = vec![moved(1.0), Event::Copy, button(1.0, true), Event::Cut, moved(2.0)];
        let made = passes(input(order.clone()));
        let again: Vec<Event> = made.into_iter().flat_map(|pass| pass.events).collect();
        assert_eq!(again, order);
    }
}
