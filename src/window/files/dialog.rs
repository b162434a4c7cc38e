//! The dialog that asks for a scene file. While it is open its field has the keyboard.

use std::path::{Path, PathBuf};
use std::time::Instant;

use egui::text::{CCursor, CCursorRange};
use egui::text_edit::TextEditState;
use egui::{Button, Key, RichText, ScrollArea, TextEdit, Ui};

use super::{Files, Purpose};
use crate::error::message_of;
use crate::exit::Exit;
use crate::model::Model;
use crate::recent;
use crate::scene::{SceneError, file};
use crate::settings::Settings;
use crate::style::{self, button};

/// Most names listed of a folder.
const LISTED: usize = 200;
/// Width of the dialog, points: the smallest window has room for it.
const WIDTH: f32 = 420.0;
/// Height of the list, points: six rows, the last one whole.
const HEIGHT: f32 = 126.0;

/// A question for a scene file.
pub(crate) struct Dialog {
    purpose: Purpose,
    path: String,
    error: Option<String>,
    folder: PathBuf,
    /// Names of folders, which end in a slash, and scene files in `folder`.
    listed: Vec<String>,
    /// Scene files that were opened last.
    recent: Vec<PathBuf>,
    /// Whether the file at `path` is to be replaced has been asked.
    replaces: bool,
    /// True until it is drawn for the first time.
    fresh: bool,
}

impl Dialog {
    pub(super) fn new(purpose: Purpose, path: &Path) -> Self {
        Self {
            purpose,
            path: path.to_string_lossy().into_owned(),
            error: None,
            // Not yet looked into.
            folder: PathBuf::from("\0"),
            listed: Vec::new(),
            recent: recent::before(path),
            replaces: false,
            fresh: true,
        }
    }

    pub(super) fn refuse(&mut self, error: String) {
        self.error = Some(error);
    }

    /// Chooses a file or a folder.
    fn choose(&mut self, path: String) {
        self.path = path;
        self.edited();
    }

    /// What was said of another path is over.
    fn edited(&mut self) {
        (self.error, self.replaces) = (None, false);
    }

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
        // Half a name is no folder: nothing is listed.
        let entries = std::fs::read_dir(here(folder)).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let shown = !name.starts_with('.');
            // Links count as what they lead to.
            match entry.path().is_dir() {
                true => Some(format!("{name}/")).filter(|_| shown),
                false => Some(name).filter(|name| shown && name.ends_with(".toml")),
            }
        });
        self.listed = names.collect();
        self.listed.sort_by_key(|name| (!name.ends_with('/'), name.to_lowercase()));
        self.listed.truncate(LISTED);
    }

    /// The folder above, as a path that ends in a slash.
    fn above(&self) -> Option<String> {
        let full = std::path::absolute(here(&self.folder)).ok()?;
        let above = full.parent()?.display().to_string();
        Some(if above.ends_with('/') { above } else { above + "/" })
    }
}

/// A folder, of which no path at all is the present one.
fn here(folder: &Path) -> &Path {
    match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    }
}

/// Draws the dialog, if a file is asked for. Returns the scene that is to be opened.
pub(crate) fn show(
    ctx: &egui::Context,
    model: &mut Model,
    files: &mut Files,
    now: Instant,
) -> Option<Exit> {
    let mut dialog = files.dialog.take()?;
    let mut exit = None;
    dialog.look();
    let mut open = true;
    let title = match dialog.purpose {
        Purpose::Save => "Save as",
        Purpose::Load => "Open",
    };
    let escape = ctx.input(|input| input.key_pressed(Key::Escape));
    let shown = style::window(title, 48.0).open(&mut open).show(ctx, |ui| {
        ui.set_width(WIDTH);
        contents(ui, model, files, &mut exit, &mut dialog, now)
    });
    let is_done = shown.and_then(|s| s.inner).unwrap_or(false);
    if open && !is_done && !escape {
        files.dialog = Some(dialog);
    }
    exit
}

/// Draws the dialog's contents; returns whether it has done its work.
fn contents(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    exit: &mut Option<Exit>,
    dialog: &mut Dialog,
    now: Instant,
) -> bool {
    let field = TextEdit::singleline(&mut dialog.path).desired_width(f32::INFINITY);
    let field = ui.add(field).on_hover_text("Scene file (.toml)");
    if field.changed() {
        dialog.edited();
    }
    // What is typed first takes the place of the path that was filled in.
    if std::mem::take(&mut dialog.fresh) {
        let mut state = TextEditState::load(ui.ctx(), field.id).unwrap_or_default();
        let end = CCursor::new(dialog.path.chars().count());
        state.cursor.set_char_range(Some(CCursorRange::two(CCursor::default(), end)));
        state.store(ui.ctx(), field.id);
    }
    let confirmed = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    if dialog.purpose == Purpose::Load {
        lately(ui, dialog);
    }
    list(ui, dialog);
    if let Some(error) = &dialog.error {
        ui.label(RichText::new(error).color(style::WARN));
    }
    let outcome = match dialog.purpose {
        Purpose::Save => save(ui, model, files, dialog, confirmed),
        Purpose::Load => load(ui, model, files, exit, dialog, confirmed, now),
    };
    let is_done = match outcome {
        Some(Ok(())) => true,
        Some(Err(error)) => {
            dialog.error = Some(message_of(&error));
            false
        }
        None => false,
    };
    // The field has the keyboard unless another control has been chosen.
    if !is_done && ui.memory(|memory| memory.focused().is_none()) {
        field.request_focus();
    }
    is_done
}

/// Draws the menu of the scene files that were opened last.
fn lately(ui: &mut Ui, dialog: &mut Dialog) {
    if dialog.recent.is_empty() {
        return;
    }
    let mut chosen = None;
    ui.menu_button("Opened lately", |ui| {
        for file in &dialog.recent {
            let name = file.to_string_lossy();
            if ui.button(name.as_ref()).clicked() {
                chosen = Some(name.into_owned());
                ui.close();
            }
        }
    });
    if let Some(path) = chosen {
        dialog.choose(path);
    }
}

/// Draws the folders and scene files to choose from.
fn list(ui: &mut Ui, dialog: &mut Dialog) {
    let mut chosen = None;
    ScrollArea::vertical().max_height(HEIGHT).show(ui, |ui| {
        ui.set_width(ui.available_width());
        if let Some(above) = dialog.above()
            && ui.selectable_label(false, "../").on_hover_text(above.as_str()).clicked()
        {
            chosen = Some(above);
        }
        for name in &dialog.listed {
            let path = dialog.folder.join(name).to_string_lossy().into_owned();
            if ui.selectable_label(path == dialog.path, name).clicked() {
                chosen = Some(path);
            }
        }
    });
    if let Some(path) = chosen {
        dialog.choose(path);
    }
}

fn save(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    dialog: &mut Dialog,
    confirmed: bool,
) -> Option<Result<(), SceneError>> {
    let path = PathBuf::from(&dialog.path);
    ui.checkbox(&mut files.with_pose, "with the probe's pose");
    let text = "The whole scene is written; the meshes that it names stay where they are.";
    ui.label(RichText::new(text).color(style::FAINT));
    let mut save = || Some(model.save(Some(&path), files.with_pose));
    if dialog.replaces {
        let text = format!("{} exists. What it holds would be lost.", dialog.path);
        ui.label(RichText::new(text).color(style::WARN));
        let mut chosen = None;
        ui.horizontal(|ui| {
            // Not by Enter, which has just been pressed: by the pointer, or Tab and Space.
            if button(ui, "Replace it", "Write this scene into the file") {
                chosen = Some(true);
            }
            if button(ui, "Keep it", "Choose another name") {
                chosen = Some(false);
            }
        });
        return match chosen {
            Some(true) => save(),
            Some(false) => {
                dialog.replaces = false;
                None
            }
            None => None,
        };
    }
    if !(ui.button("Save").clicked() || confirmed) {
        return None;
    }
    let same = |a: &Path, b: &Path| a.canonicalize().ok() == b.canonicalize().ok();
    if path.exists() && !same(&path, &model.file.path) {
        dialog.replaces = true;
        return None;
    }
    Some(model.save(Some(&path), files.with_pose))
}

fn load(
    ui: &mut Ui,
    model: &mut Model,
    files: &mut Files,
    exit: &mut Option<Exit>,
    dialog: &Dialog,
    confirmed: bool,
    now: Instant,
) -> Option<Result<(), SceneError>> {
    let path = PathBuf::from(&dialog.path);
    let mut outcome = None;
    let button = |ui: &mut Ui, enabled, name, text| {
        let clicked = ui.add_enabled(enabled, Button::new(name)).clicked();
        ui.label(RichText::new(text).color(style::FAINT));
        clicked
    };
    let opening = files.opening.is_some();
    let text = match opening {
        true => "Opening. The image goes on until the scene is there.",
        false => "All of the file, from its beginning (Enter).",
    };
    if button(ui, !opening, "Open scene", text) || confirmed && !opening {
        // Before it is asked what becomes of unsaved work.
        match file::readable(&path) {
            Ok(()) => *exit = Some(Exit::Open(path.clone())),
            Err(error) => outcome = Some(Err(error)),
        }
    }
    ui.separator();
    let tables = Settings::tables();
    let tables = tables.join(", ");
    let text = format!(
        "{tables}, as far as the file has them. Anatomy and pose stay; Undo takes it back."
    );
    if button(ui, true, "Take settings", &text) {
        outcome = Some(model.load_settings(&path, now));
    }
    outcome
}
