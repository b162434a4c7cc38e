//! Scene files in the window: settings saved and loaded, another scene opened.

mod dialog;

use std::path::{Path, PathBuf};

use egui::{RichText, Ui};

use super::error::message_of;
use super::model::Model;
use super::style::{self, button};
use crate::output::naming;
use crate::scene::shipped;
use dialog::Dialog;
pub(super) use dialog::show as dialog;

/// The window's state of scene files.
#[derive(Default)]
pub(super) struct Files {
    /// Saving also writes the probe's pose.
    pub(super) with_pose: bool,
    /// The scene file to be opened.
    pub(super) wanted: Option<PathBuf>,
    /// Name of the scene that is being opened.
    pub(super) opening: Option<String>,
    dialog: Option<Dialog>,
}

/// The purpose for which a file is asked for.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    Save,
    Load,
}

impl Files {
    /// Asks the user for a file.
    pub(super) fn ask(&mut self, purpose: Purpose, model: &Model) {
        // A scene that ships is not written over: a name of its own, in the folder of the session.
        let path = &model.file.path;
        let shipped = purpose == Purpose::Save && shipped::is_shipped(path);
        let own = shipped.then(|| free(path));
        self.dialog = Some(Dialog::new(purpose, own.as_deref().unwrap_or(path)));
    }

    /// Returns whether the user is being asked for a file.
    pub(super) fn is_asking(&self) -> bool {
        self.dialog.is_some()
    }

    /// Saves into the session's file; asks for another one where that fails.
    pub(super) fn save(&mut self, model: &mut Model) {
        if shipped::is_shipped(&model.file.path) {
            return self.ask(Purpose::Save, model);
        }
        if let Err(error) = model.save(None, self.with_pose) {
            self.ask(Purpose::Save, model);
            let shown = self.refuse(message_of(&error));
            shown.expect("just asked");
        }
    }

    /// Shows the error of a file in the dialog; returns it where no dialog is open.
    pub(super) fn refuse(&mut self, error: String) -> Result<(), String> {
        match &mut self.dialog {
            Some(dialog) => {
                dialog.refuse(error);
                Ok(())
            }
            None => Err(error),
        }
    }

    /// Closes the dialog.
    pub(super) fn close(&mut self) {
        self.dialog = None;
    }
}

/// A name like that of a scene which no file in the present folder has.
fn free(scene: &Path) -> PathBuf {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    naming::free(&stem, "toml", |name| Path::new(name).exists()).into()
}

/// Draws buttons and the name of the file, for the console.
pub(super) fn row(ui: &mut Ui, model: &mut Model, files: &mut Files) {
    ui.horizontal(|ui| {
        let tip = format!(
            "Write what differs into {}; its comments stay (Ctrl+S)",
            model.file.path.display()
        );
        if button(ui, "Save", tip) {
            files.save(model);
        }
        let tip = "Write the scene with these settings into another file (Ctrl+Shift+S)";
        if button(ui, "Save as", tip) {
            files.ask(Purpose::Save, model);
        }
        if button(ui, "Open", "Open another scene file, or take its settings (Ctrl+O)") {
            files.ask(Purpose::Load, model);
        }
        ui.checkbox(&mut files.with_pose, "with the pose")
            .on_hover_text("Saving writes where the probe is, too: Home will lead there");
    });
    let name = model.file.path.file_name().unwrap_or_default();
    let mut text = name.to_string_lossy().into_owned();
    if model.is_modified(files.with_pose) {
        text.push_str(", changed");
    }
    ui.add(egui::Label::new(RichText::new(text).size(11.0).color(style::FAINT)).truncate());
}
