//! The section for devices that move the probe, and for the network.

use std::path::Path;
use std::time::{Duration, Instant};

use egui::{DragValue, RichText, TextEdit, Ui};

use super::controls::grid;
use crate::exit::Exit;
use crate::igtl::{OPEN, TrackerState};
use crate::inputs::Inputs;
use crate::link::Report;
use crate::model::{Model, Source, age};
use crate::pads::Word;
use crate::panel::{Ask, Desk};
use crate::style::{self, button};

pub(super) fn show(ui: &mut Ui, desk: &mut Desk<'_>) {
    let Desk { model, common, seen } = desk;
    let (inputs, asks, now) = (&mut common.inputs, &mut common.asks, seen.now);
    let holder = model.devices.holder();
    grid(ui, "devices", |ui| {
        device(ui, "Keyboard", holder == Some(Source::Keyboard), |ui| {
            ui.label("arrows, A D W S Q E: see Keys (?)");
        });
        device(ui, "Game pad", holder == Some(Source::Pad), |ui| {
            pad(ui, &inputs.word);
        });
        device(ui, "Replay", holder == Some(Source::Replay), |ui| {
            ui.label(replay(model, now));
        });
        device(ui, "Tracker", holder == Some(Source::Tracker), |ui| {
            tracker(ui, inputs.report.as_ref());
        });
    });
    ui.add_space(4.0);
    network(ui, inputs);
    ui.add_space(4.0);
    way(ui, model, asks, now);
    file(ui, model, inputs, asks);
}

/// Draws a row: a device, marked where it has the probe, and its state.
fn device(ui: &mut Ui, name: &str, holds: bool, state: impl FnOnce(&mut Ui)) {
    let mark = match holds {
        true => RichText::new(format!("{name} *")).color(style::ACCENT),
        false => RichText::new(name),
    };
    let tip = "The device that moved last has the probe, marked *. A tracker that lies still does not \
               take it back; moved by more than 2 mm or 2 degrees it does.";
    ui.label(mark).on_hover_text(tip);
    ui.horizontal_wrapped(state);
    ui.end_row();
}

fn pad(ui: &mut Ui, word: &Word) {
    let tip = "Left stick: slide. Right stick: rotate and tilt, with L1 held rock and tilt. R2, L2: press, \
               lift. R1 held: a quarter of the speed. Cross of buttons: gain, depth. A: freeze, B: play, \
               X: record, Y: home.";
    match (&word.problem, word.names.as_slice()) {
        (Some(problem), _) => ui.label(RichText::new(problem).color(style::FAINT)),
        (None, []) => ui.label("none"),
        (None, names) => ui.label(names.join(", ")),
    }
    .on_hover_text(tip);
}

fn tracker(ui: &mut Ui, report: Option<&Report>) {
    let Some(report) = report else {
        ui.label("not listened for");
        return;
    };
    let since = |arrived: Instant| age(arrived.elapsed()).0;
    match &report.tracked {
        TrackerState::Never => ui.label("no pose has arrived"),
        TrackerState::Live(pose) => {
            ui.label(format!("{}, {} poses", pose.device.text(), pose.number))
        }
        TrackerState::Lost(pose) => {
            let text = format!("{} lost, {} ago", pose.device.text(), since(pose.arrived));
            ui.label(RichText::new(text).color(style::WARN))
        }
    };
}

/// Draws switch, port and clients of OpenIGTLink.
fn network(ui: &mut Ui, inputs: &mut Inputs) {
    let mut on = inputs.report.is_some();
    ui.horizontal(|ui| {
        let tip = "Trackers and 3D Slicer connect here: they move the probe and receive the image. \
                   Programs on this machine only, unless --igtl-bind says otherwise.";
        if ui.checkbox(&mut on, "OpenIGTLink, port").on_hover_text(tip).changed() {
            inputs.switch(on);
        }
        let is_off = inputs.report.is_none();
        let port = DragValue::new(&mut inputs.listen.port).range(0..=65535);
        let tip = "Port to listen at; 0 takes any that is free. Set it while it is off.";
        ui.add_enabled(is_off, port).on_hover_text(tip);
    });
    if let Some(why) = &inputs.refused {
        ui.label(RichText::new(why).color(style::WARN));
    }
    let Some(report) = &inputs.report else { return };
    let status = &report.status;
    let text = format!(
        "{}\nclients {}, poses in {}, images out {}",
        report.address, status.clients, status.poses, status.images_sent
    );
    ui.label(RichText::new(text).color(style::FAINT));
    if !report.address.ip().is_loopback() {
        ui.label(RichText::new(OPEN).color(style::WARN));
    }
    if let Some(silence) = &report.silence {
        ui.label(RichText::new(silence).color(style::WARN));
    }
    if let Some(last) = &status.last_error {
        let text = format!("{} faults, the last: {last}", status.errors);
        ui.label(RichText::new(text).color(style::FAINT));
    }
}

/// The state of the trajectory as a text.
fn replay(model: &Model, now: Instant) -> String {
    let trajectory = &model.trajectory;
    match (&trajectory.recorder, &trajectory.replay, &trajectory.stored) {
        (Some(recorder), _, _) => {
            let (seconds, rows) = (recorder.seconds(now), recorder.rows());
            format!("recording: {seconds:.1} s, {rows} poses")
        }
        (_, Some(replay), _) => {
            let at = replay.position(&model.clock, now);
            format!("{at:.1} of {:.1} s", replay.length())
        }
        (_, _, Some(stored)) => {
            let unsaved = if stored.unsaved.is_some() { ", not saved" } else { "" };
            format!("{:.1} s, {}{unsaved}", stored.seconds(), stored.name)
        }
        _ => "nothing recorded".to_owned(),
    }
}

/// Draws the controls for recording and replay.
fn way(ui: &mut Ui, model: &mut Model, asks: &mut Vec<Ask>, now: Instant) {
    ui.horizontal(|ui| {
        let is_recording = model.trajectory.recorder.is_some();
        let word = if is_recording { "Stop recording" } else { "Record" };
        if button(ui, word, "Record where the probe goes, whatever moves it (R)") {
            asks.push(Ask::Record);
        }
        if is_recording {
            // The seconds count on while nothing else is drawn.
            ui.ctx().request_repaint_after(Duration::from_millis(500));
        }
        let is_replaying = model.trajectory.replay.is_some();
        let word = if is_replaying { "Stop replay" } else { "Replay" };
        let tip = "Let the probe go along the trajectory; whatever else moves it takes it (Ctrl+R)";
        let button = egui::Button::new(word);
        let enabled = is_replaying || model.trajectory.stored.is_some() && !is_recording;
        if ui.add_enabled(enabled, button).on_hover_text(tip).clicked() {
            model.replay(now);
        }
        let tip = "Begin again at its end; for the next replay";
        ui.checkbox(&mut model.trajectory.looped, "loop").on_hover_text(tip);
    });
    let tip = "As fast as the scene's time passes, from the time at which the recording began; else at \
               the recorded pace. For the next replay";
    let choice = egui::Checkbox::new(&mut model.trajectory.with_scene, "with the scene's time");
    ui.add_enabled(model.animated, choice).on_hover_text(tip);
}

/// Draws the controls for the trajectory's file.
fn file(ui: &mut Ui, model: &mut Model, inputs: &mut Inputs, asks: &mut Vec<Ask>) {
    let mut loads = false;
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut inputs.path).desired_width(180.0);
        ui.add(field)
            .on_hover_text("Trajectory file (.csv): time_s, x_mm, y_mm, z_mm, qw, qx, qy, qz");
        let unsaved = model.unsaved_trajectory().is_some();
        let asked = Path::new(&inputs.path).exists() && !inputs.would_replace();
        let word = if asked && unsaved { "Replace it" } else { "Save" };
        let save = ui.add_enabled(unsaved, egui::Button::new(word));
        if save.on_hover_text("Write what was recorded").clicked() {
            inputs.save_or_ask(&mut model.trajectory);
        }
        loads = button(ui, "Load", "Read a trajectory");
    });
    if let Some(problem) = &inputs.problem {
        ui.label(RichText::new(problem).color(style::WARN));
    }
    if loads {
        asks.push(Ask::Leave(Exit::LoadTrajectory));
    }
}
