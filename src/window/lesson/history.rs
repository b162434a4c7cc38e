//! The page of a learner's history: attempts with their scores, newest first, and the way of one in the 3D view.

use std::path::PathBuf;

use dicom_core::chrono::{DateTime, Local};
use egui::{Button, RichText, ScrollArea, TextStyle, Ui, vec2};

use super::show_score;
use crate::output;
use crate::style::{self, button};
use crate::teach::history::{self, Entry};

/// Width of the page, points.
pub(super) const WIDTH: f32 = 500.0;
/// Size of the table's letters, points.
const SIZE: f32 = 11.0;
/// Share of the window's height that the attempts may take; the rest of them is scrolled to.
const SHARE: f32 = 0.3;

/// The folder of the learners' histories.
pub(super) fn folder() -> Option<PathBuf> {
    dirs::data_local_dir().map(|data| data.join("insonify").join("learners"))
}

/// What is said where [`folder`] is none.
fn nowhere() -> String {
    output::not_kept("no history is kept", None, output::NO_FOLDER, "XDG_DATA_HOME")
}

/// Notes an attempt in the learner's history.
pub(super) fn note(folder: Option<PathBuf>, entry: &Entry) -> Result<(), String> {
    let folder = folder.ok_or_else(nowhere)?;
    history::add(&folder, entry).map_err(|e| format!("{e}; {}", e.remedy))
}

/// The page, while it is open.
pub(super) struct Page {
    learner: String,
    /// All attempts, oldest first; or why they cannot be read.
    attempts: Result<Vec<Entry>, String>,
    /// True where other tasks are listed, too.
    all: bool,
    /// The chosen attempt: its place among all.
    chosen: usize,
}

impl Page {
    /// Reads the learner's history.
    pub(super) fn of(learner: &str) -> Self {
        let read =
            |at: PathBuf| history::read(&at, learner).map_err(|e| format!("{e}; {}", e.remedy));
        let attempts = folder().ok_or_else(nowhere).and_then(read);
        Self { learner: learner.to_owned(), attempts, all: false, chosen: usize::MAX }
    }

    /// The chosen attempt.
    pub(super) fn chosen(&self) -> Option<&Entry> {
        self.attempts.as_ref().ok()?.get(self.chosen)
    }
}

/// Draws the page for a task of a scene, by the names of both; returns false where it is to be closed.
pub(super) fn show(ui: &mut Ui, page: &mut Page, scene: &str, task: &str) -> bool {
    let mut stays = true;
    ui.horizontal(|ui| {
        stays = !button(ui, "Back", "To the tasks");
        ui.label(RichText::new(&page.learner).strong());
        ui.radio_value(&mut page.all, false, task).on_hover_text("Attempts at this task");
        ui.radio_value(&mut page.all, true, "all tasks").on_hover_text("Of all scenes");
    });
    let attempts = match &page.attempts {
        Ok(attempts) => attempts,
        Err(problem) => {
            ui.label(RichText::new(problem).color(style::WARN));
            return stays;
        }
    };
    let is_of = |entry: &Entry| entry.scene == scene && entry.score.task == task;
    let places = (0..attempts.len()).rev();
    let listed: Vec<usize> = places.filter(|&at| page.all || is_of(&attempts[at])).collect();
    let Some(&newest) = listed.first() else {
        ui.label("No attempts so far.");
        return stays;
    };
    if !listed.contains(&page.chosen) {
        page.chosen = newest;
    }
    ui.label(mono(&line(HEADS.map(str::to_owned))).color(style::FAINT));
    if !page.all {
        let own = || attempts.iter().filter(|entry| is_of(entry));
        for (name, found) in [("first", own().next()), ("best", history::best(own()))] {
            if let Some(entry) = found {
                ui.label(mono(&line(row(name.to_owned(), entry))).color(style::ACCENT));
            }
        }
        ui.separator();
    }
    let lines = if page.all { 2.0 } else { 1.0 };
    let height = lines * ui.text_style_height(&TextStyle::Monospace) + 4.0;
    let most = SHARE * ui.ctx().content_rect().height();
    let list = ScrollArea::vertical().max_height(most).auto_shrink([false, true]);
    list.show_rows(ui, height, listed.len(), |ui, range| {
        // Below the heads.
        ui.spacing_mut().button_padding.x = 0.0;
        for (number, &at) in range.clone().zip(&listed[range]) {
            let entry = &attempts[at];
            let mut text = line(row((listed.len() - number).to_string(), entry));
            if page.all {
                text += &format!("\n      {}: {}", entry.scene, entry.score.task);
            }
            let one = Button::selectable(at == page.chosen, mono(&text));
            let one = one.min_size(vec2(0.0, height));
            if ui.add(one).on_hover_text("Shows its way in the 3D view").clicked() {
                page.chosen = at;
            }
        }
    });
    ui.separator();
    let entry = &attempts[page.chosen];
    show_score(ui, &entry.score);
    if entry.scene != scene {
        ui.label(format!("Its way is in another scene, {}.", entry.scene));
    } else if entry.way.is_empty() {
        ui.label("Of this attempt no way is kept.");
    }
    stays
}

/// Heads of the table.
const HEADS: [&str; 7] = ["", "when", "reached", "time", "path", "peaks", "at the end"];

/// The cells of an attempt.
fn row(name: String, entry: &Entry) -> [String; 7] {
    let score = &entry.score;
    let when =
        i64::try_from(entry.unix_seconds).ok().and_then(|at| DateTime::from_timestamp(at, 0));
    let when = when.map_or_else(String::new, |at| {
        at.with_timezone(&Local).format("%Y-%m-%d %H:%M").to_string()
    });
    let reached = match (score.reached, score.guided) {
        (true, false) => "yes",
        (true, true) => "yes, guided",
        (false, false) => "no",
        (false, true) => "no, guided",
    };
    let moved = score.movement;
    // A result that was handed in without a way has no numbers of it.
    let of_way = |text: String| if moved.seconds > 0.0 { text } else { String::new() };
    let end = match (score.distance_mm, score.plane_angle_deg, score.error_percent) {
        (Some(distance), Some(angle), _) => format!("{distance:.1} mm {angle:.1}\u{b0}"),
        (_, _, Some(error)) => format!("{error:+.1} %"),
        _ => String::new(),
    };
    [
        name,
        when,
        reached.to_owned(),
        of_way(format!("{:.1} s", moved.seconds)),
        of_way(format!("{:.0} mm", moved.path_mm)),
        of_way(moved.peaks.to_string()),
        end,
    ]
}

/// A line of the table.
fn line([name, when, reached, time, path, peaks, end]: [String; 7]) -> String {
    format!("{name:>5} {when:<16} {reached:<11} {time:>8} {path:>8} {peaks:>5}  {end}")
}

fn mono(text: &str) -> RichText {
    RichText::new(text).monospace().size(SIZE)
}
