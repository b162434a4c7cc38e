//! What moves the probe, and the network that it is moved from.

use std::time::Instant;

use egui::{DragValue, RichText, Ui};

use super::controls::grid;
use crate::igtl::{OPEN, Tracked};
use crate::view::inputs::Inputs;
use crate::view::link::Report;
use crate::view::model::{Model, Source, age};
use crate::view::style;

pub(super) fn show(ui: &mut Ui, model: &Model, inputs: &mut Inputs) {
    let holder = model.devices.holder();
    grid(ui, "devices", |ui| {
        device(ui, "Keyboard", holder == Some(Source::Keyboard), |ui| {
            ui.label("arrows, A D W S Q E: see Keys (?)");
        });
        device(ui, "Tracker", holder == Some(Source::Tracker), |ui| {
            tracker(ui, inputs.report.as_ref());
        });
    });
    ui.add_space(4.0);
    network(ui, inputs);
}

/// A line: a device, marked where it has the probe, and how it is.
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

fn tracker(ui: &mut Ui, report: Option<&Report>) {
    let Some(report) = report else {
        ui.label("not listened for");
        return;
    };
    let since = |arrived: Instant| age(arrived.elapsed()).0;
    match &report.tracked {
        Tracked::Never => ui.label("no pose has arrived"),
        Tracked::Live(pose) => ui.label(format!("{}, {} poses", pose.device.text(), pose.number)),
        Tracked::Lost(pose) => {
            let text = format!("{} lost, {} ago", pose.device.text(), since(pose.arrived));
            ui.label(RichText::new(text).color(style::WARN))
        }
    };
}

/// Switch, port and clients of OpenIGTLink.
fn network(ui: &mut Ui, inputs: &mut Inputs) {
    let mut on = inputs.report.is_some();
    ui.horizontal(|ui| {
        let tip = "Trackers and 3D Slicer connect here: they move the probe and receive the image. \
                   Programs on this machine only, unless --igtl-bind says otherwise.";
        if ui
            .checkbox(&mut on, "OpenIGTLink, port")
            .on_hover_text(tip)
            .changed()
        {
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
    if let Some(last) = &status.last_error {
        let text = format!("{} faults, the last: {last}", status.errors);
        ui.label(RichText::new(text).color(style::FAINT));
    }
}
