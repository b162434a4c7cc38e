//! The lesson: tasks of the scene, a guide on the way, the score at the end, and the history of the learner.

mod history;
mod marking;
mod measured;

use std::time::Instant;

use egui::{Align2, Color32, Context, RichText, Shape, Stroke, TextEdit, Ui, vec2};
use glam::{DAffine3, DVec3};

use self::history::{Page, folder};
use self::marking::{Marking, Order, marked};
use self::measured::Measured;
use super::look::Pictured;
use super::model::trajectory::Recorder;
use super::model::{Model, Source};
use super::panel::{Desk, Dock, Panel, Row};
use super::style::{self, button};
use super::view3d;
use super::wake::Wake;
use crate::scene::task::{Goal, Task};
use crate::teach::history::Entry;
use crate::teach::{Score, guide};

/// Width of the panel, points.
const WIDTH: f32 = 300.0;
/// Colour of the target, and of the way that was gone.
const GHOST: Color32 = Color32::from_rgb(120, 210, 120);

/// Its row in the list of panels.
pub(super) const ROW: Row = Row {
    name: "Lesson",
    tip: "Tasks of this scene, with a guide and a score",
    key: None,
    dock: Dock::Over,
    has_button: true,
};

/// The panel's state; not saved.
#[derive(Default)]
pub(super) struct Lesson {
    /// True while the panel is open.
    open: bool,
    /// The chosen task.
    chosen: usize,
    /// True in examiner's mode: no guide.
    examiner: bool,
    /// True where the guide is wanted.
    guide: bool,
    /// Hints that have been asked for.
    hints: usize,
    /// The attempt under way.
    run: Option<Run>,
    /// The attempt that is being scored.
    marking: Option<Marking>,
    /// The last attempt.
    result: Option<Entry>,
    /// The learner's history, while it is shown.
    page: Option<Page>,
    problem: Option<String>,
    learner: String,
    measured: Measured,
    answer: Option<usize>,
}

/// An attempt under way.
struct Run {
    recorder: Recorder,
    guided: bool,
}

impl Lesson {
    /// The target to be shown in 3D, while the guide shows it.
    fn ghost(&self, model: &Model) -> Option<DAffine3> {
        let goal = &model.tasks.get(self.chosen)?.goal;
        match goal {
            Goal::View(target) if self.guides() => Some(target.world_from_probe),
            _ => None,
        }
    }

    /// The way that is shown in 3D, of the middle of the probe's face: of the attempt that is chosen in the history,
    /// else of the last one.
    fn way(&self, model: &Model) -> &[[f64; 3]] {
        let attempt = match &self.page {
            Some(page) => page.chosen(),
            None => self.result.as_ref(),
        };
        let here = attempt.filter(|attempt| self.open && attempt.scene == model.title);
        here.map_or(&[], |attempt| &attempt.way)
    }

    fn guides(&self) -> bool {
        self.open && self.run.is_some() && self.guide && !self.examiner
    }

    /// Draws the target and the way of an attempt over the 3D view, by the picture's own camera.
    pub(super) fn in_3d(
        &self,
        ui: &Ui,
        place: &view3d::Place,
        model: &Model,
        pictured: Option<&Pictured>,
    ) {
        let Some(pictured) = pictured else { return };
        let painter = ui.painter_at(place.rect);
        let place = place.of(pictured);
        let at = |point: DVec3| place.project(&pictured.look.camera, point);
        if let Some(target) = self.ghost(model) {
            let border = view3d::outline(&pictured.probe);
            let border = border.into_iter().map(|point| at(target.transform_point3(point)));
            if let Some(mut corners) = border.collect::<Option<Vec<_>>>() {
                // The face closes it, so that it is no fan of the probe itself.
                corners.extend(corners.first().copied());
                painter.add(Shape::line(corners, Stroke::new(2.0, GHOST)));
            }
            let (start, _) = pictured.probe.ray(0, 0);
            if let Some(mark) = at(target.transform_point3(DVec3::new(start.x, 0.0, start.z))) {
                painter.circle_filled(mark, 4.0, GHOST);
            }
        }
        let way: Option<Vec<_>> = self.way(model).iter().map(|&point| at(point.into())).collect();
        if let Some(way) = way
            && let Some(&end) = way.last()
        {
            painter.add(Shape::line(way, Stroke::new(2.0, GHOST)));
            painter.circle_filled(end, 4.0, GHOST);
        }
    }
}

impl Panel for Lesson {
    fn row(&self) -> &'static Row {
        &ROW
    }

    /// Records the learner's way, and takes over the score once it is there.
    fn follow(&mut self, ctx: &Context, desk: &mut Desk<'_>) {
        let (lesson, model, now) = (self, &mut *desk.model, desk.seen.now);
        lesson.open = desk.common.open.has(&ROW);
        let guides = lesson.guides();
        model.examined = lesson.run.is_some() && lesson.examiner;
        let looked_up = std::mem::take(&mut model.looked_up);
        if let Some(run) = &mut lesson.run {
            run.recorder.note("lesson", model.pose, now);
            // Also where a key has switched it on.
            if lesson.examiner && model.layer.shown {
                model.layer.shown = false;
                model.touch(now);
            }
            run.guided |= guides || model.layer.shown || looked_up;
        }
        if let Some(marking) = &lesson.marking
            && let Some(found) = marking.done()
        {
            lesson.marking = None;
            match found {
                Ok((attempt, problem)) => {
                    (lesson.result, lesson.problem) = (Some(attempt), problem);
                }
                Err(problem) => lesson.problem = Some(problem),
            }
            // The 3D view, with the way, has been drawn before.
            ctx.request_repaint();
        }
    }

    fn show(&mut self, ui: &mut Ui, desk: &mut Desk<'_>) {
        let lesson = self;
        let Desk { model, common, seen } = desk;
        let now = seen.now;
        let mut open = true;
        // At first beside the tools and above the bar: it grows upwards from there, off the results at the upper left.
        let corner = ui.ctx().content_rect().left_bottom() + vec2(46.0, -44.0);
        let window = egui::Window::new("Lesson").open(&mut open).auto_sized();
        window.pivot(Align2::LEFT_BOTTOM).default_pos(corner).show(ui.ctx(), |ui| {
            ui.set_width(if lesson.page.is_some() { history::WIDTH } else { WIDTH });
            if model.tasks.is_empty() {
                ui.label("This scene sets no tasks. They stand in its file, as [[task]].");
                return;
            }
            lesson.chosen = lesson.chosen.min(model.tasks.len() - 1);
            if let Some(page) = &mut lesson.page {
                let task = &model.tasks[lesson.chosen].name;
                if !history::show(ui, page, &model.title, task) {
                    lesson.page = None;
                }
                return;
            }
            match lesson.run.is_some() {
                false => before(ui, model, lesson, now),
                true => during(ui, model, lesson, &common.wake, now),
            }
            if lesson.marking.is_some() {
                ui.label("Scoring ...");
            }
            if let Some(problem) = &lesson.problem {
                ui.label(RichText::new(problem).color(style::WARN));
            }
        });
        lesson.open = open;
        common.open.set(&ROW, open);
    }

    fn leave(&mut self) {
        let Self { open, examiner, guide, .. } = *self;
        let learner = std::mem::take(&mut self.learner);
        *self = Self { open, examiner, guide, learner, ..Self::default() };
    }
}

/// Choice of a task, and the last result.
fn before(ui: &mut Ui, model: &mut Model, lesson: &mut Lesson, now: Instant) {
    let all: Vec<usize> = (0..model.tasks.len()).collect();
    let was = lesson.chosen;
    let name = |index: usize| model.tasks[index].name.clone();
    style::choice(ui, "task", WIDTH - 12.0, &mut lesson.chosen, &all, name);
    if was != lesson.chosen {
        (lesson.result, lesson.problem) = (None, None);
    }
    ui.label(&model.tasks[lesson.chosen].text);
    ui.checkbox(&mut lesson.examiner, "Examination")
        .on_hover_text("Without guide and overlay, poses of the scene, and names of what is seen");
    ui.horizontal(|ui| {
        ui.label("Learner");
        let field = TextEdit::singleline(&mut lesson.learner).desired_width(150.0);
        ui.add(field.hint_text("name, for the history"))
            .on_hover_text(folder().map_or_else(String::new, |at| at.display().to_string()));
    });
    if lesson.marking.is_none() {
        ui.horizontal(|ui| {
            if button(ui, "Start", "The time begins, and the probe's way is recorded") {
                start(model, lesson, now);
            }
            let learner = lesson.learner.trim();
            let tip = "This learner's attempts: scores, and their ways in the 3D view";
            if !learner.is_empty() && button(ui, "History", tip) {
                lesson.page = Some(Page::of(learner));
            }
        });
    }
    if let Some(attempt) = &lesson.result {
        ui.separator();
        show_score(ui, &attempt.score);
        if let Goal::Question(question) = &model.tasks[lesson.chosen].goal {
            ui.label(&question.explanation);
        }
    }
}

/// A score: whether the task is reached, why not, and the numbers.
fn show_score(ui: &mut Ui, score: &Score) {
    let (word, colour) = match score.reached {
        true => ("Reached", GHOST),
        false => ("Not reached", style::WARN),
    };
    ui.label(RichText::new(word).color(colour).strong());
    for reason in &score.reasons {
        ui.label(reason);
    }
    for line in score.lines() {
        ui.label(RichText::new(line).color(style::FAINT));
    }
}

fn start(model: &mut Model, lesson: &mut Lesson, now: Instant) {
    if let Some(pose) = model.tasks[lesson.chosen].start {
        model.place_probe(Source::Pointer, pose, now);
    }
    let recorder = Recorder::new(model.pose, model.clock.at(now), now);
    lesson.run = Some(Run { recorder, guided: false });
    (lesson.result, lesson.problem, lesson.answer, lesson.hints) = (None, None, None, 0);
    lesson.measured = Measured::default();
}

/// What is to be done, the guide, and the way to hand it in.
fn during(ui: &mut Ui, model: &mut Model, lesson: &mut Lesson, wake: &Wake, now: Instant) {
    let task = model.tasks[lesson.chosen].clone();
    ui.label(RichText::new(&task.name).strong());
    ui.label(&task.text);
    if !lesson.examiner {
        guided(ui, model, lesson, &task, now);
    }
    match &task.goal {
        Goal::Measure(measurement) => {
            measured::show(ui, model, &mut lesson.measured, measurement.unit);
        }
        Goal::Question(question) => {
            for (index, choice) in question.choices.iter().enumerate() {
                ui.radio_value(&mut lesson.answer, Some(index), choice);
            }
        }
        Goal::View(_) | Goal::Show(_) => {}
    }
    let measured = lesson.measured.value();
    let lacks = matches!(task.goal, Goal::Measure(_)) && measured.is_none();
    ui.horizontal(|ui| {
        let hand_in = egui::Button::new("Submit");
        if ui.add_enabled(!lacks, hand_in).on_hover_text("The time ends").clicked()
            && let Some(run) = lesson.run.take()
        {
            let order = Order {
                file: model.file.path.clone(),
                overrides: model.file.overrides.clone(),
                task: task.name.clone(),
                track: run.recorder.finish(now).track(),
                measured: measured.filter(|_| matches!(task.goal, Goal::Measure(_))),
                answer: lesson.answer,
                guided: run.guided,
                learner: lesson.learner.trim().to_owned(),
                folder: folder(),
            };
            match marked(order, wake.clone()) {
                Ok(marking) => lesson.marking = Some(marking),
                Err(problem) => lesson.problem = Some(problem.to_string()),
            }
        }
        if button(ui, "Give up", "Nothing is scored") {
            lesson.run = None;
        }
    });
}

fn guided(ui: &mut Ui, model: &mut Model, lesson: &mut Lesson, task: &Task, now: Instant) {
    ui.horizontal(|ui| {
        if matches!(task.goal, Goal::View(_)) {
            let tip = "The target in the 3D view, and what to do next";
            ui.checkbox(&mut lesson.guide, "Guide").on_hover_text(tip);
        }
        let tip = "Structures in their colours over the image";
        if ui.checkbox(&mut model.layer.shown, "Structures").on_hover_text(tip).changed() {
            model.touch(now);
        }
        if lesson.hints < task.hints.len() && button(ui, "Hint", "A hint of the task's author") {
            lesson.hints += 1;
        }
    });
    for hint in &task.hints[..lesson.hints] {
        ui.label(RichText::new(hint).color(style::FAINT));
    }
    if let (Goal::View(target), true) = (&task.goal, lesson.guides()) {
        let steps = guide::steps(&model.pose, &target.world_from_probe);
        let mut left = steps.iter().filter(|step| !step.is_small()).peekable();
        if left.peek().is_none() {
            ui.label("You are there: hold the view, and submit.");
        }
        for step in left {
            ui.label(format!("{} {}", step.arrow(), step.words()));
        }
    }
}
