//! The keyboard: keys and their actions.

use std::time::Instant;

use egui::{Event, Key, Modifiers};

use super::dual;
use super::files::Purpose;
use super::leaving::{self, Way};
use super::mmode;
use super::model::calipers::Kind;
use super::model::sheet::Tool;
use super::model::{Axis, Model, Press, STEP, Source};
use super::pads::{self, Word};
use super::state::State;
use crate::settings::{Group, Imaging, Probe};

/// The action of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Action {
    Move(Axis, f64),
    Gain(f64),
    Depth(f64),
    Freeze,
    Frame(isize),
    Loop,
    Take(Tool),
    Delete,
    Still,
    Clip,
    Play,
    Home,
    Record,
    Replay,
    Undo,
    Redo,
    Save,
    Load,
    Console,
    View3d,
    Planes,
    Worksheet,
    Hold,
    Timing,
    Flip(usize),
    Whole,
    Beside,
    Mmode,
    Real,
    Layer,
    Help,
    Close,
    Quit,
}

/// A key, whether it is held with Ctrl, and its action.
type Binding = (Key, bool, Action);

/// The keys that move the probe back and forth along or about an axis.
const fn moves(back: Key, forth: Key, axis: Axis) -> [Binding; 2] {
    [(back, false, Action::Move(axis, -1.0)), (forth, false, Action::Move(axis, 1.0))]
}

/// Every key with its row in the list of keys; rows without a text belong to the one before.
const BINDINGS: &[(&str, &[Binding], &str)] = &[
    (
        "Left Right",
        &moves(Key::ArrowLeft, Key::ArrowRight, Axis::Lateral),
        "slide along the image (2 mm)",
    ),
    (
        "Up Down",
        &moves(Key::ArrowDown, Key::ArrowUp, Axis::Elevation),
        "slide across the image (2 mm)",
    ),
    ("Page Up Page Down", &moves(Key::PageUp, Key::PageDown, Axis::Depth), "lift and press (2 mm)"),
    ("A D", &moves(Key::A, Key::D, Axis::Rock), "rock in the image plane (2 deg)"),
    ("W S", &moves(Key::S, Key::W, Axis::Tilt), "tilt (fan) the image plane (2 deg)"),
    ("Q E", &moves(Key::Q, Key::E, Axis::Rotate), "rotate about the depth axis (2 deg)"),
    ("H", &[(Key::H, false, Action::Hold)], "hold the probe to the skin: it slides along it"),
    ("Home", &[(Key::Home, false, Action::Home)], "probe back to the scene file's pose"),
    (
        "R Ctrl+R",
        &[(Key::R, false, Action::Record), (Key::R, true, Action::Replay)],
        "record where the probe goes; replay it",
    ),
    ("Space", &[(Key::Space, false, Action::Freeze)], "freeze and go live"),
    (
        ", .",
        &[(Key::Comma, false, Action::Frame(-1)), (Key::Period, false, Action::Frame(1))],
        "frozen: one image back and on",
    ),
    ("Enter", &[(Key::Enter, false, Action::Loop)], "frozen: play and stop the loop"),
    (
        "L O K J N",
        &[
            (Key::L, false, Action::Take(Tool::Measure(Kind::Distance))),
            (Key::O, false, Action::Take(Tool::Measure(Kind::Ellipse))),
            (Key::K, false, Action::Take(Tool::Measure(Kind::Angle))),
            (Key::J, false, Action::Take(Tool::Measure(Kind::Trace))),
            (Key::N, false, Action::Take(Tool::Note)),
        ],
        "measure a distance, an ellipse, an angle, an outline; place a text",
    ),
    (
        "Del",
        &[(Key::Delete, false, Action::Delete), (Key::Backspace, false, Action::Delete)],
        "remove what is selected; arrows move its point by a pixel",
    ),
    (
        "F2 F3",
        &[(Key::F2, false, Action::Still), (Key::F3, false, Action::Clip)],
        "save the image, save the loop",
    ),
    ("P", &[(Key::P, false, Action::Play)], "play and pause the animation"),
    (
        "+ -",
        &[
            (Key::Plus, false, Action::Gain(1.0)),
            (Key::Equals, false, Action::Gain(1.0)),
            (Key::Minus, false, Action::Gain(-1.0)),
        ],
        "gain (1 dB)",
    ),
    (
        "[ ]",
        &[
            (Key::OpenBracket, false, Action::Depth(-10.0)),
            (Key::CloseBracket, false, Action::Depth(10.0)),
        ],
        "depth (10 mm)",
    ),
    (
        "F U Z",
        &[
            (Key::F, false, Action::Flip(0)),
            (Key::U, false, Action::Flip(1)),
            (Key::Z, false, Action::Whole),
        ],
        "image: left and right, up and down exchanged; the whole of it (the wheel enlarges)",
    ),
    (
        "Y",
        &[(Key::Y, false, Action::Beside)],
        "hold this image beside the live one; again: the other side (with Shift: one image)",
    ),
    (
        "Ctrl+Z Ctrl+Y",
        &[(Key::Z, true, Action::Undo), (Key::Y, true, Action::Redo)],
        "undo and redo settings, ways of the probe, marks, recordings",
    ),
    (
        "Ctrl+S Ctrl+O",
        &[(Key::S, true, Action::Save), (Key::O, true, Action::Load)],
        "save settings (with Shift: as), open a scene or take its settings",
    ),
    (
        "C V X G T M B I",
        &[
            (Key::C, false, Action::Console),
            (Key::V, false, Action::View3d),
            (Key::X, false, Action::Worksheet),
            (Key::G, false, Action::Planes),
            (Key::T, false, Action::Timing),
            (Key::M, false, Action::Mmode),
            (Key::B, false, Action::Real),
            (Key::I, false, Action::Layer),
        ],
        "console, 3D view, worksheet, planes of the volume, timings, M-mode, which pixels are real, tissues in colours",
    ),
    (
        "? Esc",
        &[
            (Key::Questionmark, false, Action::Help),
            (Key::F1, false, Action::Help),
            (Key::Escape, false, Action::Close),
        ],
        "this list; close it",
    ),
    // The interface handles these itself.
    ("Ctrl+Plus Ctrl+Minus Ctrl+0", &[], "texts and controls larger, smaller, as usual"),
    ("Ctrl+Q", &[(Key::Q, true, Action::Quit)], "quit"),
];

/// Keys and their actions, for the list on the screen.
pub(super) fn list() -> impl Iterator<Item = (&'static str, &'static str)> {
    BINDINGS.iter().map(|(keys, _, text)| (*keys, *text))
}

/// Carries out the pressed keys, unless a field is being typed into or a dialog is open.
pub(super) fn apply(ctx: &egui::Context, model: &mut Model, state: &mut State, now: Instant) {
    if ctx.egui_wants_keyboard_input() || state.has_dialog() {
        return;
    }
    let pressed = ctx.input(|input| {
        let presses = input.events.iter().filter_map(|event| match event {
            Event::Key { key, pressed: true, modifiers, .. } => Some((*key, *modifiers)),
            _ => None,
        });
        presses.collect::<Vec<_>>()
    });
    for (key, modifiers) in pressed {
        if let Some(action) = action(key, modifiers) {
            carry_out(action, modifiers, model, state, now);
        }
    }
}

/// The tool that a key takes. The code that follows the pointer calls it: a click before the key belongs to the
/// tool before, though both may arrive at once.
pub(super) fn tool(key: Key, modifiers: Modifiers) -> Option<Tool> {
    match action(key, modifiers) {
        Some(Action::Take(tool)) => Some(tool),
        _ => None,
    }
}

fn action(key: Key, modifiers: Modifiers) -> Option<Action> {
    let bindings = BINDINGS.iter().flat_map(|(_, bindings, _)| *bindings);
    let mut found = bindings.filter(|b| b.0 == key && b.1 == modifiers.command);
    found.next().map(|b| b.2)
}

/// Carries out the state of the game pads: the probe moves on, and buttons act as keys do.
pub(super) fn apply_pads(word: &Word, model: &mut Model, state: &mut State, now: Instant) {
    for (axis, amount) in pads::steps(word.travel) {
        model.move_by(Source::Pad, axis, amount, now);
    }
    for press in &word.presses {
        let action = match *press {
            Press::Freeze => Action::Freeze,
            Press::Play => Action::Play,
            Press::Record => Action::Record,
            Press::Gain(by) => Action::Gain(by),
            Press::Depth(by) => Action::Depth(by),
            Press::Home => {
                model.place_probe(Source::Pad, model.home, now);
                continue;
            }
        };
        carry_out(action, Modifiers::NONE, model, state, now);
    }
}

fn carry_out(
    action: Action,
    modifiers: Modifiers,
    model: &mut Model,
    state: &mut State,
    now: Instant,
) {
    let before = model.settings.clone();
    match action {
        Action::Move(axis, steps)
            if state.tools.nudge(
                &mut model.sheet,
                axis,
                // On the screen: turned over, the image's axes point the other way.
                if state.framing.flipped[usize::from(axis != Axis::Lateral)] {
                    -steps
                } else {
                    steps
                },
                modifiers.shift,
            ) => {}
        Action::Move(axis, steps) => {
            let step = if axis.shifts() { STEP[0] } else { STEP[1] };
            let fine = if modifiers.shift { 0.25 } else { 1.0 };
            model.move_probe(axis, steps * step * fine, now);
        }
        Action::Gain(by) => {
            let gain = &mut model.settings.imaging.gain;
            *gain = Imaging::clamped("gain", *gain + by);
        }
        Action::Depth(by) => {
            let depth = &mut model.settings.probe.depth;
            // Ten millimetres above nothing are a lower limit of their own.
            *depth = Probe::clamped("depth", (*depth + by).max(10.0));
        }
        Action::Freeze => model.freeze(!model.frozen, now),
        Action::Frame(by) if model.frozen => state.tools.cine.step(by),
        Action::Loop if model.frozen => {
            let cine = &mut state.tools.cine;
            cine.play(!cine.is_playing(), now);
        }
        Action::Frame(_) | Action::Loop => {}
        // Taken in order with the pointer's events: see `tool`.
        Action::Take(_) => {}
        Action::Delete => drop(model.sheet.delete()),
        Action::Still => state.tools.want_still(),
        Action::Clip => state.tools.want_clip(),
        Action::Play if model.animated => {
            model.clock.play(!model.clock.is_playing(), now);
            model.touch(now);
        }
        Action::Play => {}
        Action::Home => model.place_probe(Source::Keyboard, model.home, now),
        Action::Record => leaving::record(model, state, now),
        Action::Replay => model.replay(now),
        Action::Undo => return model.undo(now),
        Action::Redo => return model.redo(now),
        Action::Save if modifiers.shift => state.files.ask(Purpose::Save, model),
        Action::Save => state.files.save(model),
        Action::Load => state.files.ask(Purpose::Load, model),
        Action::Console => state.console = !state.console,
        Action::View3d => state.view3d.open = !state.view3d.open,
        Action::Planes => state.planes.open = !state.planes.open,
        Action::Worksheet => state.exam.open = !state.exam.open,
        Action::Hold => {
            let stays = model.hold.as_ref().is_some_and(|hold| hold.stays);
            model.stay_on_skin(!stays, now);
        }
        Action::Timing => state.timing = !state.timing,
        Action::Flip(axis) => state.framing.flip(axis),
        Action::Whole => state.framing.whole(),
        Action::Beside if modifiers.shift => state.dual.end(),
        Action::Beside => dual::hold(model, state, now),
        Action::Mmode => mmode::toggle(model, now),
        Action::Real => {
            model.real.shown = !model.real.shown;
            model.touch(now);
        }
        Action::Layer => {
            model.layer.shown = !model.layer.shown;
            model.touch(now);
        }
        Action::Help => state.help = !state.help,
        Action::Close if state.help => state.help = false,
        Action::Close => drop(model.sheet.cancel()),
        Action::Quit => leaving::leave(Way::Quit, model, state, now),
    }
    model.note(&before, now);
}

#[cfg(test)]
mod tests {
    use egui::{Key, Modifiers};

    use super::{Action, BINDINGS, action};
    use crate::model::Axis;

    #[test]
    fn no_key_does_two_things_and_every_movement_has_two() {
        let all: Vec<_> = BINDINGS.iter().flat_map(|(_, b, _)| *b).collect();
        for (i, a) in all.iter().enumerate() {
            assert!(!all[..i].iter().any(|b| (a.0, a.1) == (b.0, b.1)), "{a:?}");
        }
        for axis in Axis::ALL {
            let steps: f64 = (all.iter())
                .filter_map(|b| match b.2 {
                    Action::Move(a, steps) if a == axis => Some(steps),
                    _ => None,
                })
                .sum();
            let count = all.iter().filter(|b| matches!(b.2, Action::Move(a, _) if a == axis));
            assert_eq!((count.count(), steps), (2, 0.0), "{axis:?}");
        }
    }

    #[test]
    fn control_tells_quitting_from_rotating() {
        assert_eq!(action(Key::Q, Modifiers::COMMAND), Some(Action::Quit));
        let rotate = Some(Action::Move(Axis::Rotate, -1.0));
        assert_eq!(action(Key::Q, Modifiers::NONE), rotate);
        assert_eq!(action(Key::Q, Modifiers::SHIFT), rotate, "a finer step");
        assert_eq!(action(Key::Y, Modifiers::NONE), Some(Action::Beside));
        assert_eq!(action(Key::Y, Modifiers::COMMAND), Some(Action::Redo));
    }
}
