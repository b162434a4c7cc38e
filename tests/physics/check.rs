//! What a proof consists of: figures held against closed forms, with the curves and pictures that
//! show them. Tests and the report take their verdicts from here.

use std::sync::Arc;

use insonify::gpu;
pub use insonify::output::plot::{Curve, Plot};

use crate::render::{Renderer, renderers};

/// Whether the physics is as it should be, or wrong in the way that [`Check::planted`] says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Physics {
    Right,
    Planted,
}

/// One row of the validation table.
pub struct Check {
    /// "T5".
    pub row: &'static str,
    /// What it proves, as its test is called: `attenuation_slope_matches_beer_lambert`.
    pub name: &'static str,
    /// The closed form, and its source.
    pub claim: &'static str,
    /// The error that every figure must notice, but for those that name one of their own ([`Figure::unlike`]).
    pub planted: &'static str,
    pub run: fn(&Bench, Physics) -> Outcome,
}

/// A number, what it should be, and by how much it may be off; all in the unit that `what` names.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What is measured and by which renderer: "bvh: slope, dB/cm".
    pub what: String,
    pub measured: f64,
    pub expected: f64,
    /// Largest allowed |measured - expected|.
    pub tolerance: f64,
    /// An error that moves this figure, and what would then be expected.
    pub other: Option<(&'static str, f64)>,
}

impl Figure {
    /// A NaN never holds.
    pub fn holds(&self) -> bool {
        (self.measured - self.expected).abs() <= self.tolerance
    }

    /// Names an error that would be noticed by this figure alone, and what the figure would be with it: for one that
    /// the check's planted error leaves as it is.
    pub fn unlike(&mut self, error: &'static str, value: f64) {
        self.other = Some((error, value));
    }

    /// It would not hold with the error that it names.
    fn tells(&self) -> bool {
        self.other.is_some_and(|(_, value)| (self.measured - value).abs() > self.tolerance)
    }
}

impl std::fmt::Display for Figure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { what, measured, expected, tolerance, .. } = self;
        write!(f, "{what}: {measured}, expected {expected} within {tolerance}")
    }
}

/// Grey levels row by row.
#[derive(Clone, Debug)]
pub struct Picture {
    pub title: String,
    pub width: u32,
    pub grey: Vec<u8>,
}

impl Picture {
    /// It has a name and whole rows.
    pub fn is_drawable(&self) -> bool {
        !self.title.is_empty()
            && !self.grey.is_empty()
            && self.width > 0
            && self.grey.len().is_multiple_of(self.width as usize)
    }
}

/// What a check found.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    pub figures: Vec<Figure>,
    pub plots: Vec<Plot>,
    pub pictures: Vec<Picture>,
}

impl Outcome {
    /// Adds a figure.
    pub fn compare(
        &mut self,
        what: impl Into<String>,
        measured: f64,
        expected: f64,
        tolerance: f64,
    ) -> &mut Figure {
        let figure = Figure { what: what.into(), measured, expected, tolerance, other: None };
        self.figures.push_mut(figure)
    }

    /// Every plot and every picture can be shown.
    pub fn is_drawable(&self) -> bool {
        self.plots.iter().all(Plot::is_drawable) && self.pictures.iter().all(Picture::is_drawable)
    }

    /// Figures that do not hold.
    pub fn failures(&self) -> Vec<&Figure> {
        self.figures.iter().filter(|f| !f.holds()).collect()
    }

    /// Something was measured, and all of it holds.
    pub fn holds(&self) -> bool {
        !self.figures.is_empty() && self.failures().is_empty()
    }
}

/// What checks are run on.
pub struct Bench {
    pub device: Arc<gpu::Device>,
    /// The f64 twins, and the device with either tracer.
    pub renderers: [Renderer; 3],
}

impl Bench {
    #[cfg(test)]
    pub fn new() -> Self {
        Self::on(gpu::test_device())
    }

    pub fn on(device: Arc<gpu::Device>) -> Self {
        Self { renderers: renderers(&device), device }
    }
}

/// What a check found, and what it found with its error planted: the verdict of tests and report.
pub struct Examined {
    pub right: Outcome,
    planted: Outcome,
    /// Of the validation layers, in the meantime.
    pub messages: Vec<String>,
}

impl Examined {
    /// Figures that hold with the planted error as well, and with the one that they name: they prove nothing.
    pub fn blind(&self) -> Vec<&Figure> {
        let moved = |figure: &Figure| {
            let mut planted = self.planted.figures.iter();
            planted.any(|other| other.what == figure.what && !other.holds())
        };
        self.right.figures.iter().filter(|figure| !moved(figure) && !figure.tells()).collect()
    }

    /// The planted error showed in every figure, or the figure's own.
    pub fn noticed(&self) -> bool {
        self.blind().is_empty()
    }

    /// Every figure holds and can be shown and has noticed an error, and the validation layers are silent.
    pub fn holds(&self) -> bool {
        self.right.holds() && self.right.is_drawable() && self.noticed() && self.messages.is_empty()
    }

    /// Why it does not hold, in lines; empty if it does.
    pub fn complaints(&self, check: &Check) -> String {
        let mut lines: Vec<String> = self.right.failures().iter().map(|f| f.to_string()).collect();
        if self.right.figures.is_empty() {
            lines.push("nothing was measured".into());
        }
        if !self.right.is_drawable() {
            lines.push("a plot or picture cannot be drawn".into());
        }
        if !self.noticed() {
            let figures = self.blind().into_iter().map(|figure| {
                let other = figure.other.map(|(error, value)| format!(", nor {error}: {value}"));
                format!("\n        {figure}{}", other.unwrap_or_default())
            });
            let figures: String = figures.collect();
            lines.push(format!("not noticed: {}{figures}", check.planted));
        }
        lines.extend(self.messages.iter().cloned());
        lines.iter().map(|line| format!("     {line}\n")).collect()
    }
}

/// Runs a check, and runs it with its error planted.
pub fn examine(check: &Check, bench: &Bench) -> Examined {
    let before = bench.device.validation_messages().len();
    Examined {
        right: (check.run)(bench, Physics::Right),
        planted: (check.run)(bench, Physics::Planted),
        messages: bench.device.validation_messages().split_off(before),
    }
}

/// The check holds.
///
/// # Panics
/// With what does not.
#[cfg(test)]
pub fn prove(check: &Check) {
    let found = examine(check, &Bench::new());
    assert!(
        found.holds(),
        "{} {}: {}\n{}",
        check.row,
        check.name,
        check.claim,
        found.complaints(check)
    );
}
