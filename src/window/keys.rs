//! The keyboard: keys and their actions.

use egui::{Key, Modifiers};

use super::calipers::KEYS;
use super::model::Axis;
use super::model::sheet::Tool;
use super::panels;

/// The action of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Action {
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
    Hold,
    Flip(usize),
    Whole,
    Beside,
    Real,
    Layer,
    Colour,
    /// Opens or closes a panel, by its place in the list.
    Panel(usize),
    Close,
    Quit,
}

/// A key, whether it is held with Ctrl, and its action.
type Binding = (Key, bool, Action);

/// The keys that move the probe back and forth along or about an axis.
const fn moves(back: Key, forth: Key, axis: Axis) -> [Binding; 2] {
    [(back, false, Action::Move(axis, -1.0)), (forth, false, Action::Move(axis, 1.0))]
}

/// The keys that take tools.
const fn tools() -> [Binding; KEYS.len()] {
    let mut bindings = [(Key::L, false, Action::Close); KEYS.len()];
    let mut at = 0;
    while at < KEYS.len() {
        bindings[at] = (KEYS[at].0, false, Action::Take(KEYS[at].1));
        at += 1;
    }
    bindings
}

/// The place of the list of keys among the panels.
const HELP: usize = {
    let mut at = 0;
    while !matches!(panels::ROWS[at].key, Some((Key::Questionmark, _))) {
        at += 1;
    }
    at
};

/// Every key but those of panels, with its row in the list of keys; a row without names of keys is not in the list.
const BINDINGS: &[(&str, &[Binding], &str)] = &[
    (
        "Left Right",
        &moves(Key::ArrowLeft, Key::ArrowRight, Axis::Lateral),
        "slide along the image (2 mm)",
    ),
    (
        "Up Down",
        // Away from whoever sees the image in front of him, as the guide says it.
        &moves(Key::ArrowUp, Key::ArrowDown, Axis::Elevation),
        "slide into the image, away from you, and out of it (2 mm)",
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
    ("L O K J N", &tools(), "measure a distance, an ellipse, an angle, an outline; place a text"),
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
        "B I",
        &[(Key::B, false, Action::Real), (Key::I, false, Action::Layer)],
        "which pixels are real; tissues in colours",
    ),
    (
        "F5",
        &[(Key::F5, false, Action::Colour)],
        "colours: velocity and power of what flows, velocity of tissue, off",
    ),
    // In the list they stand with the panels.
    ("", &[(Key::F1, false, Action::Panel(HELP)), (Key::Escape, false, Action::Close)], ""),
    // The interface handles these itself.
    ("Ctrl+Plus Ctrl+Minus Ctrl+0", &[], "texts and controls larger, smaller, as usual"),
    ("Ctrl+Q", &[(Key::Q, true, Action::Quit)], "quit"),
];

/// Keys and their actions, for the list on the screen.
pub(super) fn list() -> impl Iterator<Item = (String, String)> {
    let panels = panels::ROWS.into_iter().filter_map(|row| Some((row.key?.1, row.name)));
    let (keys, names): (Vec<_>, Vec<_>) = panels.unzip();
    let panels =
        (keys.join(" "), format!("open and close: {} (Esc closes this list)", names.join(", ")));
    let own = BINDINGS.iter().filter(|(keys, ..)| !keys.is_empty());
    own.map(|(keys, _, text)| ((*keys).to_owned(), (*text).to_owned())).chain([panels])
}

/// What a key does.
pub(super) fn action(key: Key, modifiers: Modifiers) -> Option<Action> {
    all().find(|b| b.0 == key && b.1 == modifiers.command).map(|b| b.2)
}

fn all() -> impl Iterator<Item = Binding> {
    let panels = panels::ROWS.iter().enumerate();
    let panels = panels.filter_map(|(at, row)| Some((row.key?.0, false, Action::Panel(at))));
    BINDINGS.iter().flat_map(|(_, bindings, _)| *bindings).copied().chain(panels)
}

#[cfg(test)]
mod tests {
    use egui::{Key, Modifiers};

    use super::{Action, HELP, action, all, panels};
    use crate::model::Axis;

    #[test]
    fn no_key_does_two_things_and_every_movement_has_two() {
        let all: Vec<_> = all().collect();
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

    #[test]
    fn panels_have_keys_and_names_of_their_own() {
        let at = |name| panels::ROWS.iter().position(|row| row.name == name).map(Action::Panel);
        assert_eq!(action(Key::T, Modifiers::NONE), at("Timings"));
        assert_eq!(at("Keys"), Some(Action::Panel(HELP)));
        let mut names: Vec<_> = panels::ROWS.iter().map(|row| row.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), panels::ROWS.len());
    }
}
