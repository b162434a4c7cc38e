//! Pictures of the scenes that ship, of which one can be opened.

use std::path::PathBuf;

use egui::{
    Align2, Context, Id, Image, Key, RichText, Sense, TextureHandle, TextureOptions, Ui, vec2,
};

use super::exit::Exit;
use super::panel::{Ask, Desk, Dock, Panel, Row};
use super::{recent, style};
use crate::scene::shipped::{self, SCENES, Shipped};

/// Room for one picture, points.
const PICTURE: egui::Vec2 = vec2(190.0, 130.0);
/// Pictures in a row, where the window is wide enough.
const COLUMNS: usize = 4;
/// Room between two pictures, points.
const BETWEEN: f32 = 10.0;

/// First steps, in three lines.
pub const FIRST_STEPS: [&str; 3] = [
    "Drag the probe in the 3D view, over the skin where there is one, or slide it by the arrow keys; Shift leans it, Ctrl and the wheel turn it.",
    "Space freezes the image, L measures a distance in it, F2 saves it with its settings.",
    "The console has gain, depth and all other settings; ? lists the keys.",
];

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Scenes",
    tip: "Pictures of the scenes that ship, to open one",
    key: None,
    dock: Dock::Over,
    has_button: true,
};

/// The gallery. A click opens a scene, and asks first where something is not saved.
#[derive(Default)]
pub(super) struct Gallery {
    /// The reason why the last choice cannot be opened.
    problem: Option<String>,
    /// Files that were opened last, as of when it was opened.
    recent: Option<Vec<PathBuf>>,
}

impl Panel for Gallery {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn follow(&mut self, _ctx: &Context, desk: &mut Desk<'_>) {
        if !desk.common.open.has(&ROW) {
            self.recent = None;
        }
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let recent = self.recent.get_or_insert_with(recent::list);
        let mut open = !ui.input(|input| input.key_pressed(Key::Escape));
        let window = egui::Window::new(ROW.name)
            .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
            .resizable(false)
            .collapsible(false)
            .open(&mut open);
        let chosen = window.show(ui.ctx(), |ui| {
            let shipped = pictures(ui).map(|scene| shipped::unpacked(scene.name));
            let chosen = shipped.or(lately(ui, recent).map(Ok));
            ui.separator();
            for line in FIRST_STEPS {
                ui.label(line);
            }
            if let Some(problem) = &self.problem {
                ui.label(RichText::new(problem).color(style::WARN));
            }
            chosen
        });
        desk.common.open.set(&ROW, open);
        let Some(file) = chosen.and_then(|shown| shown.inner).flatten() else {
            return;
        };
        match file {
            Ok(path) => {
                *self = Self::default();
                desk.common.open.set(&ROW, false);
                desk.common.asks.push(Ask::Leave(Exit::Open(path)));
            }
            Err(error) => self.problem = Some(error.to_string()),
        }
    }
}

/// Draws the names of the files that were opened last; returns the one that was clicked.
fn lately(ui: &mut Ui, recent: &[PathBuf]) -> Option<PathBuf> {
    if recent.is_empty() {
        return None;
    }
    ui.separator();
    let shown = ui.horizontal_wrapped(|ui| {
        ui.label("Opened lately:");
        let mut chosen = None;
        for file in recent {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            if style::button(ui, &name, file.display().to_string()) {
                chosen = Some(file.clone());
            }
        }
        chosen
    });
    shown.inner
}

/// Draws all pictures with their names; returns the one that was clicked.
fn pictures(ui: &mut Ui) -> Option<&'static Shipped> {
    let mut chosen = None;
    let fitting = ui.ctx().content_rect().width() / (PICTURE.x + BETWEEN) - 0.5;
    let columns = (fitting as usize).clamp(1, COLUMNS);
    egui::Grid::new("gallery").num_columns(columns).spacing([BETWEEN, 8.0]).show(ui, |ui| {
        for (index, scene) in SCENES.iter().enumerate() {
            ui.vertical(|ui| {
                ui.set_width(PICTURE.x);
                let picture = Image::new(&texture(ui.ctx(), scene))
                    .max_size(PICTURE)
                    .corner_radius(4.0)
                    .sense(Sense::click());
                let area = vec2(PICTURE.x, PICTURE.y);
                let shown = ui
                    .allocate_ui(area, |ui| ui.centered_and_justified(|ui| ui.add(picture)).inner);
                let picture = shown.inner.on_hover_text(scene.title);
                let name = ui.selectable_label(false, scene.title);
                if picture.clicked() || name.clicked() {
                    chosen = Some(scene);
                }
            });
            if index % columns == columns - 1 {
                ui.end_row();
            }
        }
    });
    chosen
}

/// The picture on the device. The context keeps it: another device has another context.
fn texture(ctx: &Context, scene: &Shipped) -> TextureHandle {
    let id = Id::new(("gallery", scene.name));
    if let Some(texture) = ctx.data(|data| data.get_temp::<TextureHandle>(id)) {
        return texture;
    }
    let picture = image::load_from_memory(scene.picture).expect("it ships").to_rgba8();
    let size = [picture.width() as usize, picture.height() as usize];
    let picture = egui::ColorImage::from_rgba_unmultiplied(size, &picture);
    let texture = ctx.load_texture(scene.name, picture, TextureOptions::LINEAR);
    ctx.data_mut(|data| data.insert_temp(id, texture.clone()));
    texture
}
