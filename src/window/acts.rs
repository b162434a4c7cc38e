//! What keys and the buttons of game pads do.

use std::time::Instant;

use egui::{Event, Key, Modifiers};

use super::exit::Exit;
use super::files::Purpose;
use super::keys::{Action, action};
use super::leaving;
use super::model::{Axis, Model, Press, STEP, Source};
use super::pads::{self, Word};
use super::state::State;
use super::{dual, help};
use crate::settings::{Group, Imaging, Probe};
use crate::sim::ColourMode;

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
    let typed = |key: Key, modifiers: Modifiers| {
        state.common.fills && !modifiers.command && (key == Key::Space || key.name().len() == 1)
    };
    let pressed: Vec<_> = pressed.into_iter().filter(|&(key, held)| !typed(key, held)).collect();
    for (key, modifiers) in pressed {
        if let Some(action) = action(key, modifiers) {
            carry_out(action, modifiers, model, state, now);
        }
    }
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
                model.go_home(Source::Pad, now);
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
            if state.common.tools.nudge(
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
        Action::Frame(by) if model.frozen => state.common.tools.cine.step(by),
        Action::Loop if model.frozen => {
            let cine = &mut state.common.tools.cine;
            cine.play(!cine.is_playing(), now);
        }
        Action::Frame(_) | Action::Loop => {}
        // Taken in order with the pointer's events: see `tool`.
        Action::Take(_) => {}
        Action::Delete => drop(model.sheet.delete()),
        Action::Still => state.common.tools.want_still(),
        Action::Clip => state.common.tools.want_clip(),
        Action::Play if model.animated => {
            model.clock.play(!model.clock.is_playing(), now);
            model.touch(now);
        }
        Action::Play => {}
        Action::Home => model.go_home(Source::Keyboard, now),
        Action::Record => leaving::record(model, state, now),
        Action::Replay => model.replay(now),
        Action::Undo => return model.undo(now),
        Action::Redo => return model.redo(now),
        Action::Save if modifiers.shift => state.common.files.ask(Purpose::Save, model),
        Action::Save => state.common.files.save(model),
        Action::Load => state.common.files.ask(Purpose::Load, model),
        Action::Hold => {
            let stays = model.hold.as_ref().is_some_and(|hold| hold.stays);
            model.stay_on_skin(!stays, now);
        }
        Action::Flip(axis) => state.framing.flip(axis),
        Action::Whole => state.framing.whole(),
        Action::Beside if modifiers.shift => state.dual.end(),
        Action::Beside => dual::hold(model, &mut state.dual, &state.common.tools, now),
        Action::Real => {
            model.real.shown = !model.real.shown;
            model.touch(now);
        }
        Action::Layer => {
            model.layer.shown = !model.layer.shown;
            model.touch(now);
        }
        Action::Colour => {
            model.colour = match model.colour {
                None => Some(ColourMode::Color),
                Some(ColourMode::Color) => Some(ColourMode::Power),
                Some(ColourMode::Power) => Some(ColourMode::Tissue),
                Some(ColourMode::Tissue) => None,
            };
            model.touch(now);
        }
        Action::Panel(at) => {
            let open = &mut state.common.open;
            state.panels.all()[at].toggle(model, open, now);
        }
        Action::Close if state.common.open.has(&help::ROW) => {
            state.common.open.set(&help::ROW, false);
        }
        Action::Close => drop(model.sheet.cancel()),
        Action::Quit => leaving::leave(Exit::Quit, model, state, now),
    }
    model.note(&before, now);
}
