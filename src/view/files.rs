//! Scene files in the window: settings saved and loaded, another scene opened.

use std::path::{Path, PathBuf};
use std::time::Instant;

use egui::{Button, Key, RichText, ScrollArea, TextEdit, Ui};

use super::model::Model;
use super::style::{self, button};
use crate::scene::SceneError;

/// Most scene files listed of a folder.
const LISTED: usize = 60;

/// Width of the dialog, points: the smallest window has room for it.
const WIDTH: f32 = 420.0;

/// The window's state of scene files.
#[derive(Default)]
pub(super) struct Files {
    /// Saving also writes the probe's pose.
    pub(super) with_pose: bool,
    /// The scene file to be opened.
    pub(super) wanted: Option<PathBuf>,
    /// A scene is being opened.
    pub(super) opening: bool,
    dialog: Option<Dialog>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    Save,
    Load,
}

struct Dialog {
    purpose: Purpose,
    path: String,
    error: Option<String>,
    folder: PathBuf,
    /// Names of the scene files in `folder`.
    listed: Vec<String>,
    /// The field has not yet been given the keyboard.
    fresh: bool,
}

impl Dialog {
    /// Reads the list again where the path leads into another folder.
    fn look(&mut self) {
        let path = Path::new(&self.path);
        let folder = match self.path.ends_with('/') {
            true => path,
            false => path.parent().unwrap_or(path),
        };
        if folder == self.folder {
            return;
        }
        self.folder = folder.to_owned();
        let here = match folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => folder,
        };
        // Half a name is no folder: nothing is listed.
        let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
        let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
        self.listed = names.filter(|name| name.ends_with(".toml")).collect();
        self.listed.sort();
        self.listed.truncate(LISTED);
    }
}

impl Files {
    /// Asks the user for a file.
    pub(super) fn ask(&mut self, purpose: Purpose, model: &Model) {
        self.dialog = Some(Dialog {
            purpose,
            path: model.file.path.to_string_lossy().into_owned(),
            error: None,
            // Not yet looked into.
            folder: PathBuf::from("\0"),
            listed: Vec::new(),
            fresh: true,
        });
    }

    /// Saves into the session's file; asks for another one where that fails.
    pub(super) fn save(&mut self, model: &mut Model) {
        if let Err(error) = model.save(None, self.with_pose) {
            self.ask(Purpose::Save, model);
            let shown = self.refuse(said(&error));
            shown.expect("just asked");
        }
    }

    /// Shows the error of a file in the dialog; returns it where no dialog is open.
    pub(super) fn refuse(&mut self, error: String) -> Result<(), String> {
        match &mut self.dialog {
            Some(dialog) => {
                dialog.error = Some(error);
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

/// The text of an error: place, cause and remedy.
pub(super) fn said(error: &SceneError) -> String {
    let remedy = error.remedy.as_deref().map(|r| format!("\n{r}"));
    format!("{error}{}", remedy.unwrap_or_default())
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
        if button(ui, "Load", "Take settings from another scene file, or open it (Ctrl+O)") {
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

/// Draws the dialog, if a file is asked for.
pub(super) fn dialog(ctx: &egui::Context, model: &mut Model, files: &mut Files, now: Instant) {
    let Some(mut dialog) = files.dialog.take() else {
        return;
    };
    dialog.look();
    let mut open = true;
    let title = match dialog.purpose {
        Purpose::Save => "Save as",
        Purpose::Load => "Load",
    };
    let escape = ctx.input(|input| input.key_pressed(Key::Escape));
    let shown = style::window(title, 48.0).open(&mut open).show(ctx, |ui| {
        ui.set_width(WIDTH);
        contents(ui, model, files, &mut dialog, now)
    });
    let is_done = shown.and_then(|s| s.inner).unwrap_or(false);
    if open && !is_done && !escape {
        files.dialog = Some(dialog);
    }
}

/// Draws the dialog's contents; returns whether it has done its work.
fn contents(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    dialog: &mut Dialog,
    now: Instant,
) -> bool {
    let field = TextEdit::singleline(&mut dialog.path).desired_width(f32::INFINITY);
    let field = ui.add(field).on_hover_text("Scene file (.toml)");
    if std::mem::take(&mut dialog.fresh) {
        field.request_focus();
    }
    let confirmed = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    ScrollArea::vertical().max_height(120.0).show(ui, |ui| {
        let mut chosen = None;
        for name in &dialog.listed {
            let path = dialog.folder.join(name).to_string_lossy().into_owned();
            if ui.selectable_label(path == dialog.path, name).clicked() {
                chosen = Some(path);
            }
        }
        if let Some(path) = chosen {
            dialog.path = path;
            dialog.error = None;
        }
    });
    if let Some(error) = &dialog.error {
        ui.label(RichText::new(error).color(style::WARN));
    }
    let path = PathBuf::from(&dialog.path);
    let outcome = match dialog.purpose {
        Purpose::Save => save(ui, model, files, &path, confirmed),
        Purpose::Load => load(ui, model, files, &path, confirmed, now),
    };
    match outcome {
        Some(Ok(())) => true,
        Some(Err(error)) => {
            dialog.error = Some(said(&error));
            false
        }
        None => false,
    }
}

fn save(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    path: &Path,
    confirmed: bool,
) -> Option<Result<(), SceneError>> {
    ui.checkbox(&mut files.with_pose, "with the probe's pose");
    let text = "The whole scene is written; the meshes that it names stay where they are.";
    ui.label(RichText::new(text).color(style::FAINT));
    let replaces = path.exists() && path != model.file.path;
    let word = if replaces { "Replace" } else { "Save" };
    (ui.button(word).clicked() || confirmed).then(|| model.save(Some(path), files.with_pose))
}

fn load(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    path: &Path,
    confirmed: bool,
    now: Instant,
) -> Option<Result<(), SceneError>> {
    let mut outcome = None;
    let button = |ui: &mut Ui, enabled, name, text| {
        let clicked = ui.add_enabled(enabled, Button::new(name)).clicked();
        ui.label(RichText::new(text).color(style::FAINT));
        clicked
    };
    let text = "[probe], [simulation] and [imaging], as far as the file has them. Anatomy and pose \
        stay; Undo takes it back.";
    if button(ui, true, "Take settings", text) || confirmed {
        outcome = Some(model.load_settings(path, now));
    }
    ui.separator();
    let text = match files.opening {
        true => "Opening. The image goes on until the scene is there.",
        false => "All of the file, from its beginning. What is not saved of this scene is gone.",
    };
    if button(ui, !files.opening, "Open scene", text) {
        files.wanted = Some(path.to_owned());
    }
    outcome
}
