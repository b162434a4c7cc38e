//! The worksheet of the examination, and its report.

use dicom_core::chrono::Local;
use egui::{Context, Event, Grid, InputState, Key, Pos2, RichText, ScrollArea, TextEdit, Ui};

use super::model::Model;
use super::model::sheet::What;
use super::panel::{Desk, Dock, Panel, Row};
use super::style::{self, button};
use crate::output::dicom::{Patient, Study};
use crate::settings::{Exam, Words as _};
use insonify_lab::exam::{Line, Measured, Report, Worksheet};

/// Width of the worksheet, points.
const WIDTH: f32 = 300.0;

/// Its row in the list of panels. Its button is beside the examination's name.
pub(super) const ROW: Row = Row {
    name: "Worksheet",
    tip: "Named measurements, what follows from them, and the report",
    key: Some((Key::X, "X")),
    dock: Dock::Left(WIDTH),
    has_button: false,
};

/// What reports and DICOM files say of the examination, with the form in which DICOM has it; typed.
const FIELDS: [(&str, &str); 5] = [
    ("Patient", "family^given"),
    ("Number", ""),
    ("Born", "1990-04-12"),
    ("Examiner", "family^given"),
    ("Question", ""),
];

/// The state of the worksheet: it is not saved with the scene.
#[derive(Default)]
pub(super) struct Examination {
    fields: [String; FIELDS.len()],
    findings: String,
    /// The study of the patient that was last typed.
    study: Option<Study>,
}

impl Examination {
    /// The study that DICOM files belong to: a new one where another patient is typed.
    pub(super) fn study(&mut self, exam: Exam) -> Study {
        let typed = self.fields.each_ref().map(|text| text.trim().to_owned());
        let [name, number, born, examiner, question] = typed;
        let patient = Patient { name, number, born };
        let same = self.study.take().filter(|study| study.patient == patient);
        let mut study = same.unwrap_or_else(|| Study::begin(patient));
        study.examiner = examiner;
        study.question = question;
        study.exam = exam.word().to_owned();
        self.study = Some(study.clone());
        study
    }
}

/// The worksheet of all measurements, on the image and off it; its sources are places in [`Marks::iter`].
///
/// [`Marks::iter`]: super::model::sheet::Marks::iter
pub(super) fn worksheet(model: &Model) -> Worksheet {
    let measured = model.sheet.all().iter().map(|mark| match &mark.what {
        What::Caliper(caliper) => caliper.measured(),
        What::Note(_) => Measured::default(),
    });
    Worksheet::of(model.settings.imaging.exam, &measured.collect::<Vec<_>>())
}

/// Where a button of the pointer has been pressed since the last drawing; egui forgets it where it has been let go, too.
fn pressed_at(input: &InputState) -> Option<Pos2> {
    input.events.iter().rev().find_map(|event| match event {
        Event::PointerButton { pos, pressed: true, .. } => Some(*pos),
        _ => None,
    })
}

impl Panel for Examination {
    fn row(&self) -> &'static Row {
        &ROW
    }

    fn follow(&mut self, ctx: &Context, desk: &mut Desk<'_>) {
        // Set again below, where the click is into the open form. Enter and Esc end what is typed into it.
        let ends = ctx.input(|input| {
            let keys = [Key::Enter, Key::Escape];
            input.pointer.any_pressed() || keys.iter().any(|key| input.key_pressed(*key))
        });
        if ends || !self.is_open(desk.model, &desk.common.open) {
            desk.common.fills = false;
        }
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let Desk { model, common, .. } = desk;
        if let Some(at) = ui.input(pressed_at) {
            common.fills |= ui.max_rect().contains(at);
        }
        let tools = &mut common.tools;
        let sheet = worksheet(model);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let tip = "One HTML file beside the stills; the browser prints it or makes a PDF of it";
            let ready = !tools.is_saving();
            if ui.add_enabled_ui(ready, |ui| button(ui, "Save report", tip)).inner {
                let report = report(model, self, sheet.clone());
                tools.report(model, report);
            }
            let tip =
                "Remove all named measurements, on the image and off it; Undo brings them back";
            let filled = !sheet.lines.is_empty();
            if ui.add_enabled_ui(filled, |ui| button(ui, "Clear", tip)).inner {
                model.sheet.strike_all();
            }
        });
        ui.horizontal(|ui| {
            ui.label(RichText::new(format!("Worksheet: {}", model.settings.imaging.exam)).strong());
        });
        ScrollArea::vertical().auto_shrink([false; 2]).show(ui, |ui| {
            if let Some(place) = values(ui, &sheet) {
                model.sheet.strike(place);
            }
            ui.separator();
            Grid::new("exam").num_columns(2).show(ui, |ui| {
                for ((name, form), text) in FIELDS.iter().zip(&mut self.fields) {
                    ui.label(*name);
                    let field = TextEdit::singleline(text).hint_text(*form);
                    ui.add(field.desired_width(200.0).char_limit(200));
                    ui.end_row();
                }
            });
            ui.label("Findings");
            let field = TextEdit::multiline(&mut self.findings).desired_rows(3).char_limit(20_000);
            ui.add(field.desired_width(WIDTH - 20.0));
            let stills = tools.stills().count();
            ui.small(format!("{stills} saved stills go into the report (F2 saves one)."));
        });
    }
}

/// Draws measured and derived values; returns the place of the measurement that the user removes.
fn values(ui: &mut Ui, sheet: &Worksheet) -> Option<usize> {
    if sheet.lines.is_empty() {
        ui.small("Measure, and choose the name of the measurement in the list beside the image.");
    }
    let mut struck = None;
    Grid::new("measured").num_columns(3).spacing([10.0, 3.0]).show(ui, |ui| {
        for line in &sheet.lines {
            struck = measured(ui, line).or(struck);
        }
        for one in &sheet.derived {
            let name = RichText::new(one.name).color(style::ACCENT);
            ui.label(name).on_hover_text(one.source);
            ui.label(RichText::new(&one.text).color(style::ACCENT));
            ui.end_row();
        }
    });
    struck
}

/// Draws one line: a value with its button, or the mean and below it each value with its button.
fn measured(ui: &mut Ui, line: &Line) -> Option<usize> {
    let unit = line.quantity.unit();
    ui.label(&line.name).on_hover_text(line.meaning);
    let several = line.values.len() > 1;
    if several {
        ui.label(format!("{:.1} {unit}", line.mean()));
        ui.label(RichText::new(format!("mean of {}", line.values.len())).small());
        ui.end_row();
    }
    let mut struck = None;
    for (value, place) in line.values.iter().zip(&line.sources) {
        let text = RichText::new(format!("{value:.1} {unit}"));
        match several {
            true => {
                ui.label("");
                ui.label(text.small().color(style::FAINT));
            }
            false => drop(ui.label(text)),
        }
        let tip = "Remove this measurement, from the image too; Undo brings it back";
        if ui.small_button("x").on_hover_text(tip).clicked() {
            struck = Some(*place);
        }
        ui.end_row();
    }
    struck
}

fn report(model: &Model, exam: &Examination, worksheet: Worksheet) -> Report {
    let typed = FIELDS.iter().zip(&exam.fields).map(|((name, _), text)| (*name, text.clone()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Modifiers, PointerButton, RawInput, pos2};

    /// On a slow machine press and release lie between two drawings, and what is typed next would be keys.
    #[test]
    fn a_click_that_has_ended_is_known_by_where_it_began() {
        let button = |x: f32, pressed: bool| Event::PointerButton {
            pos: pos2(x, 50.0),
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        for (events, expected) in [
            (vec![button(30.0, true)], Some(pos2(30.0, 50.0))),
            (vec![button(30.0, true), button(30.0, false)], Some(pos2(30.0, 50.0))),
            (vec![button(30.0, false)], None),
            (vec![], None),
        ] {
            let context = Context::default();
            let mut found = None;
            let input = RawInput { events: events.clone(), ..RawInput::default() };
            let mut output = context.run_ui(input, |ui| found = ui.input(pressed_at));
            output.textures_delta.clear();
            assert_eq!(found, expected, "{events:?}");
        }
    }
}
