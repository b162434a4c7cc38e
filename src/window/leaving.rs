//! Ways out of a session, and the question before something unsaved is lost.

use std::path::Path;
use std::time::Instant;

use egui::{Key, Modifiers, RichText, Ui};

use super::exit::{Exit, Leaving, Stage};
use super::model::Model;
use super::state::State;
use super::style::{self, button};
use super::unsaved::Unsaved;
use crate::scene::shipped;

/// Width of the question, points.
const WIDTH: f32 = 400.0;

/// What is unsaved, and where saving puts it.
fn lines(unsaved: &Unsaved, model: &Model, state: &State) -> Vec<String> {
    let scene = name(&model.file.path);
    let settings = unsaved.settings.then(|| match shipped::is_shipped(&model.file.path) {
        true => format!("Settings: into a file of your own, as {scene} ships"),
        false => format!("Settings: into {scene}"),
    });
    let recorded = unsaved.trajectory.then(|| {
        let seconds = match (&model.trajectory.recorder, model.unsaved_trajectory()) {
            (Some(recorder), _) => recorder.seconds(Instant::now()),
            (None, stored) => stored.map_or(0.0, |stored| stored.seconds()),
        };
        let file = state.common.inputs.free();
        format!("The recorded trajectory, {seconds:.1} s: as {}", file.display())
    });
    let marks = (unsaved.marks > 0).then(|| {
        let folder = state.common.tools.folder.display();
        format!("Measurements and texts, {}: with the image, in {folder}", unsaved.marks)
    });
    settings.into_iter().chain(recorded).chain(marks).collect()
}

fn name(path: &Path) -> String {
    super::inputs::name(path)
}

/// Goes a way out, or asks first where it would lose something.
pub(super) fn leave(exit: Exit, model: &mut Model, state: &mut State, now: Instant) {
    if state.leaving.is_some() {
        return;
    }
    match Unsaved::of(&exit, model, &state.common.tools, state.common.files.with_pose).is_empty() {
        true => go(exit, model, state, now),
        false => state.leaving = Some(Leaving { exit, stage: Stage::Begins, problem: None }),
    }
}

/// Begins a recording, or ends it. One that is not saved is asked about before the next begins.
pub(super) fn record(model: &mut Model, state: &mut State, now: Instant) {
    if model.trajectory.recorder.is_none() {
        return leave(Exit::Record, model, state, now);
    }
    model.record(now);
    if let Some(stored) = model.unsaved_trajectory() {
        let text = "Ctrl+R replays it, Probe input in the console saves it";
        state.common.tools.notices.tell(format!("Recorded {:.1} s. {text}.", stored.seconds()));
    }
}

fn go(exit: Exit, model: &mut Model, state: &mut State, now: Instant) {
    match exit {
        Exit::Quit => state.quit = true,
        Exit::Open(path) => state.common.files.wanted = Some(path),
        Exit::Record => model.record(now),
        Exit::LoadTrajectory => state.common.inputs.load(model, now),
    }
}

/// Draws the question, or goes on where it has been answered.
pub(super) fn show(ctx: &egui::Context, model: &mut Model, state: &mut State, now: Instant) {
    let Some(mut leaving) = state.leaving.take() else {
        return;
    };
    match leaving.stage {
        Stage::Begins | Stage::Asks => return ask(ctx, leaving, model, state, now),
        Stage::Draws => {
            state.common.tools.want_still();
            leaving.stage = Stage::Writes;
            state.leaving = Some(leaving);
        }
        Stage::Writes if state.common.tools.is_saving() => state.leaving = Some(leaving),
        Stage::Writes => {
            state.common.tools.collect();
            // The reason is said over the bar, with another folder to choose.
            if !state.common.tools.notices.has_failed() {
                go(leaving.exit, model, state, now);
            }
        }
    }
    ctx.request_repaint();
}

/// An answer to the question.
enum Answer {
    Save,
    Discard,
    Cancel,
}

fn ask(
    ctx: &egui::Context,
    mut leaving: Leaving,
    model: &mut Model,
    state: &mut State,
    now: Instant,
) {
    let unsaved =
        Unsaved::of(&leaving.exit, model, &state.common.tools, state.common.files.with_pose);
    let lines = lines(&unsaved, model, state);
    let fresh = leaving.stage == Stage::Begins;
    leaving.stage = Stage::Asks;
    let shown = style::window("Not saved", 64.0).show(ctx, |ui| {
        ui.set_width(WIDTH);
        for line in &lines {
            ui.label(line);
        }
        if let Some(problem) = &leaving.problem {
            ui.label(RichText::new(problem).color(style::WARN));
        }
        ui.add_space(4.0);
        answers(ui, fresh)
    });
    match shown.and_then(|shown| shown.inner).flatten() {
        Some(Answer::Cancel) => {}
        Some(Answer::Discard) => go(leaving.exit, model, state, now),
        Some(Answer::Save) => {
            match save(&unsaved, model, state, now) {
                Ok(false) => return,
                Ok(true) if unsaved.marks > 0 => leaving.stage = Stage::Draws,
                Ok(true) => return go(leaving.exit, model, state, now),
                Err(problem) => leaving.problem = Some(problem),
            }
            state.leaving = Some(leaving);
            ctx.request_repaint();
        }
        None => state.leaving = Some(leaving),
    }
}

fn answers(ui: &mut Ui, fresh: bool) -> Option<Answer> {
    let mut answer = None;
    ui.horizontal(|ui| {
        let save = ui.button("Save").on_hover_text("Enter");
        if fresh {
            save.request_focus();
        }
        if save.clicked() {
            answer = Some(Answer::Save);
        }
        let discard = |ui: &Ui| ui.input_mut(|input| input.consume_key(Modifiers::COMMAND, Key::D));
        if button(ui, "Discard", "It is lost (Ctrl+D)") || discard(ui) {
            answer = Some(Answer::Discard);
        }
        let escape = ui.input(|input| input.key_pressed(Key::Escape));
        if button(ui, "Cancel", "Go on as before (Esc)") || escape {
            answer = Some(Answer::Cancel);
        }
    });
    answer
}

/// Saves settings and trajectory; false where another dialog asks for the scene's file.
fn save(
    unsaved: &Unsaved,
    model: &mut Model,
    state: &mut State,
    now: Instant,
) -> Result<bool, String> {
    if unsaved.trajectory {
        if model.trajectory.recorder.is_some() {
            model.record(now);
        }
        state.common.inputs.path = state.common.inputs.free().display().to_string();
        state.common.inputs.save(&mut model.trajectory);
        if let Some(problem) = &state.common.inputs.problem {
            return Err(problem.clone());
        }
    }
    if unsaved.settings {
        state.common.files.save(model);
    }
    Ok(!state.common.files.is_asking())
}
