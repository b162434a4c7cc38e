//! Unsaved work.

use super::exit::Exit;
use super::model::Model;
use super::tools::Tools;

/// The unsaved work that a way would lose.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Unsaved {
    /// Settings and named poses.
    pub(super) settings: bool,
    /// A recorded trajectory.
    pub(super) trajectory: bool,
    /// Number of measurements and texts.
    pub(super) marks: usize,
}

impl Unsaved {
    /// What a way out would lose; `with_pose` counts the probe's pose among the settings.
    pub(super) fn of(exit: &Exit, model: &Model, tools: &Tools, with_pose: bool) -> Self {
        let whole = matches!(exit, Exit::Quit | Exit::Open(_));
        let recording = whole && model.trajectory.recorder.is_some();
        Self {
            settings: whole && model.is_modified(with_pose),
            trajectory: recording || model.unsaved_trajectory().is_some(),
            marks: if whole { tools.unfiled(model).iter().count() } else { 0 },
        }
    }

    /// All that is unsaved.
    pub(super) fn of_all(model: &Model, tools: &Tools, with_pose: bool) -> Self {
        Self::of(&Exit::Quit, model, tools, with_pose)
    }

    /// What is unsaved, in words.
    pub(super) fn words(&self) -> Vec<String> {
        let settings = self.settings.then(|| "Settings, named poses".to_owned());
        let recorded = self.trajectory.then(|| "A recorded trajectory".to_owned());
        let marks = (self.marks > 0).then(|| format!("Measurements and texts, {}", self.marks));
        settings.into_iter().chain(recorded).chain(marks).collect()
    }

    pub(super) fn is_empty(&self) -> bool {
        !self.settings && !self.trajectory && self.marks == 0
    }
}
