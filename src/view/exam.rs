//! The worksheet of the examination, and its report.

use dicom_core::chrono::Local;
use egui::{Grid, RichText, ScrollArea, TextEdit, Ui};

use super::model::Model;
use super::model::sheet::What;
use super::state::State;
use super::style::{self, button};
use crate::exam::{Report, Worksheet};
use crate::settings::Words as _;

/// Width of the worksheet, points.
pub(super) const WIDTH: f32 = 300.0;

/// What the head of a report says of the examination; typed.
const FIELDS: [&str; 5] = ["Patient", "Number", "Born", "Examiner", "Question"];

/// The state of the worksheet: it is not saved with the scene.
#[derive(Default)]
pub(super) struct Examination {
    /// True while the worksheet is open.
    pub(super) open: bool,
    fields: [String; FIELDS.len()],
    findings: String,
}

/// The worksheet of the present measurements.
fn worksheet(model: &Model) -> Worksheet {
    let measured = model.sheet.marks().iter().filter_map(|mark| match &mark.what {
        What::Caliper(caliper) => Some(caliper.measured()),
        What::Note(_) => None,
    });
    Worksheet::of(model.settings.imaging.exam, &measured.collect::<Vec<_>>())
}

/// Draws the worksheet into a side panel.
pub(super) fn show(ui: &mut Ui, model: &Model, state: &mut State) {
    let sheet = worksheet(model);
    ui.add_space(6.0);
    ui.horizontal(|ui| {
        let tip = "One HTML file beside the stills; the browser prints it or makes a PDF of it";
        let ready = !state.tools.is_saving();
        if ui.add_enabled_ui(ready, |ui| button(ui, "Save report", tip)).inner {
            let report = report(model, &state.exam, sheet.clone());
            state.tools.report(&model.title, report);
        }
        ui.label(RichText::new(format!("Worksheet: {}", model.settings.imaging.exam)).strong());
    });
    ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| {
        values(ui, &sheet);
        ui.separator();
        let exam = &mut state.exam;
        Grid::new("exam").num_columns(2).show(ui, |ui| {
            for (name, text) in FIELDS.iter().zip(&mut exam.fields) {
                ui.label(*name);
                ui.add(TextEdit::singleline(text).desired_width(200.0).char_limit(200));
                ui.end_row();
            }
        });
        ui.label("Findings");
        let field = TextEdit::multiline(&mut exam.findings).desired_rows(3).char_limit(20_000);
        ui.add(field.desired_width(WIDTH - 20.0));
        let stills = state.tools.stills().count();
        ui.small(format!("{stills} saved stills go into the report (F2 saves one)."));
    });
}

fn values(ui: &mut Ui, sheet: &Worksheet) {
    if sheet.lines.is_empty() {
        ui.small("Measure, and choose the name of the measurement in the list beside the image.");
    }
    Grid::new("measured").num_columns(3).spacing([10.0, 3.0]).show(ui, |ui| {
        for line in &sheet.lines {
            ui.label(line.item.name).on_hover_text(line.item.meaning);
            ui.label(format!("{:.1} {}", line.mean(), line.item.quantity.unit()));
            let all: Vec<String> = line.values.iter().map(|value| format!("{value:.1}")).collect();
            if all.len() > 1 {
                ui.label(RichText::new(all.join(", ")).small().color(style::FAINT));
            }
            ui.end_row();
        }
        for one in &sheet.derived {
            let name = RichText::new(one.name).color(style::ACCENT);
            ui.label(name).on_hover_text(one.source);
            ui.label(RichText::new(&one.text).color(style::ACCENT));
            ui.end_row();
        }
    });
}

fn report(model: &Model, exam: &Examination, worksheet: Worksheet) -> Report {
    let typed = FIELDS.iter().zip(&exam.fields).map(|(name, text)| (*name, text.clone()));
    let made = Local::now().format("%Y-%m-%d %H:%M").to_string();
    let known = [("Date", made), ("Scene", model.title.clone())];
    Report {
        exam: model.settings.imaging.exam.word().to_owned(),
        fields: typed.chain(known).collect(),
        worksheet,
        pictures: Vec::new(),
        findings: exam.findings.clone(),
    }
}
