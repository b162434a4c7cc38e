//! The section for named poses of the probe.

use std::time::Instant;

use egui::{Key, RichText, TextEdit, Ui, Vec2};

use crate::model::Model;
use crate::style::{self, button};

/// Names that are being typed; not saved.
#[derive(Default)]
pub(crate) struct Naming {
    /// The next pose.
    next: String,
    /// Index of the pose that gets another name, and that name.
    renamed: Option<(usize, String)>,
}

pub(super) fn show(ui: &mut Ui, model: &mut Model, naming: &mut Naming, now: Instant) {
    for index in 0..model.poses().len() {
        let mut gone = false;
        ui.horizontal(|ui| match &mut naming.renamed {
            Some((renamed, name)) if *renamed == index => {
                let field = ui.add(TextEdit::singleline(name).desired_width(190.0));
                let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                let done = button(ui, "Rename", "Enter") || entered;
                if done && !model.rename_pose(index, name, now) {
                    field.request_focus();
                } else if done || ui.input(|input| input.key_pressed(Key::Escape)) {
                    naming.renamed = None;
                } else if ui.memory(|memory| memory.focused().is_none()) {
                    field.request_focus();
                }
            }
            _ => gone = !row(ui, model, index, naming, now),
        });
        if gone {
            model.remove_pose(index, now);
            naming.renamed = None;
            // Those behind it have moved up.
            break;
        }
    }
    ui.horizontal(|ui| {
        let hint = model.next_pose_name();
        let field = TextEdit::singleline(&mut naming.next).hint_text(&hint).desired_width(190.0);
        let field = ui.add(field).on_hover_text("Name of the probe's present pose");
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        let tip = "Remember where the probe is now; Save writes it into the scene file";
        if button(ui, "Add", tip) || entered {
            let name = if naming.next.trim().is_empty() { hint } else { naming.next.clone() };
            // A name that is taken stays in the field.
            if model.add_pose(&name, now) {
                naming.next.clear();
            }
        }
    });
    let typed = naming.renamed.iter().map(|(index, name)| (Some(*index), name));
    for (own, name) in typed.chain([(None, &naming.next)]) {
        let mut others = model.poses().iter().enumerate().filter(|(i, _)| Some(*i) != own);
        if others.any(|(_, known)| known.pose.name == name.trim()) {
            let text = format!("There is a pose `{}`: choose another name.", name.trim());
            ui.label(RichText::new(text).color(style::WARN));
        }
    }
}

/// Draws a pose; returns false where it is to be removed.
fn row(ui: &mut Ui, model: &mut Model, index: usize, naming: &mut Naming, now: Instant) -> bool {
    let known = &model.poses()[index].pose;
    let is_here = known.world_from_probe.abs_diff_eq(model.pose, 1e-3);
    let name = known.name.clone();
    let chosen = egui::Button::selectable(is_here, name.as_str()).truncate();
    let there = ui.add_sized(Vec2::new(160.0, 18.0), chosen);
    if there.on_hover_text("Put the probe there").clicked() {
        model.go_to_pose(index, now);
    }
    if button(ui, "Rename", "Give it another name") {
        naming.renamed = Some((index, name));
    }
    !button(ui, "x", "Remove it; Undo brings it back")
}
