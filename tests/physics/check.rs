//! The parts of a proof: figures compared with closed forms, with curves and pictures that show them. Tests and
//! the report take their verdicts from here.

use std::any::Any;
use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt::Debug;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::rc::Rc;
use std::sync::Arc;

use insonify::gpu;
pub use insonify::output::plot::{Curve, Plot};
use insonify::sim::Tracer;

use crate::physics::render::{Renderer, renderers};

/// State of the physics: right, or wrong in the way of [`Check::planted`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Physics {
    Right,
    Planted,
}

/// One row of the validation table.
pub struct Check {
    /// Row of the table, such as "T5".
    pub row: &'static str,
    /// The proof's name, equal to its test's: `attenuation_slope_matches_beer_lambert`.
    pub name: &'static str,
    /// The closed form, and its source.
    pub claim: &'static str,
    /// The error that every figure must notice, except those that name one of their own ([`Figure::unlike`]).
    pub planted: &'static str,
    pub run: fn(&Bench, Physics) -> Outcome,
}

/// A number, its expected value, and its tolerance; all in the unit that `what` names.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The quantity and its renderer: "bvh: slope, dB/cm".
    pub what: String,
    pub measured: f64,
    pub expected: f64,
    /// Largest allowed |measured - expected|.
    pub tolerance: f64,
    /// An error that moves this figure, and the value it would then have.
    pub other: Option<(&'static str, f64)>,
}

impl Figure {
    /// Returns whether it is within the tolerance; false for NaN.
    pub fn holds(&self) -> bool {
        (self.measured - self.expected).abs() <= self.tolerance
    }

    /// Names an error that only this figure would notice, and the figure's value with it: for a figure that the check's
    /// planted error does not move.
    pub fn unlike(&mut self, error: &'static str, value: f64) {
        self.other = Some((error, value));
    }

    /// Returns whether it would fail with the error that it names.
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
    /// Returns whether it has a title and whole rows.
    pub fn is_drawable(&self) -> bool {
        !self.title.is_empty()
            && !self.grey.is_empty()
            && self.width > 0
            && self.grey.len().is_multiple_of(self.width as usize)
    }
}

/// Result of a check.
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

    /// Returns whether every plot and every picture can be shown.
    pub fn is_drawable(&self) -> bool {
        self.plots.iter().all(Plot::is_drawable) && self.pictures.iter().all(Picture::is_drawable)
    }

    /// Figures outside their tolerance.
    pub fn failures(&self) -> Vec<&Figure> {
        self.figures.iter().filter(|f| !f.holds()).collect()
    }

    /// Returns whether something was measured and every figure is within its tolerance.
    pub fn holds(&self) -> bool {
        !self.figures.is_empty() && self.failures().is_empty()
    }
}

/// Results by what they were made of, for the run with the planted error: what it leaves alone is made once.
#[derive(Clone, Default)]
pub struct Memo(Rc<RefCell<HashMap<u64, Rc<dyn Any>>>>);

impl Memo {
    /// The result of `make`, or what it was for an equal `of`, which names everything that `make` depends on. `keep`: false
    /// where there is no room for another one.
    pub fn once<T: 'static>(&self, of: &impl Debug, keep: bool, make: impl FnOnce() -> T) -> Rc<T> {
        let mut key = DefaultHasher::new();
        format!("{} {of:?}", std::any::type_name::<T>()).hash(&mut key);
        let key = key.finish();
        let kept = self.0.borrow().get(&key).cloned();
        let made = kept.unwrap_or_else(|| {
            let made: Rc<dyn Any> = Rc::new(make());
            if keep {
                self.0.borrow_mut().insert(key, Rc::clone(&made));
            }
            made
        });
        made.downcast().expect("its type is part of the key")
    }
}

/// The device and the renderers for checks.
pub struct Bench {
    pub device: Arc<gpu::Device>,
    /// Those by which paths are followed: of the report and of long runs both. Others have the compute tracer alone where the
    /// subject is what sound does and not who finds the surfaces: that both find the same and show the same is proven by itself.
    pub tracers: &'static [Tracer],
    /// The f64 twins, and the device with each of the tracers.
    pub renderers: Vec<Renderer>,
    /// Results that both runs of a check share.
    pub memo: Memo,
}

/// Both tracers.
pub const TRACERS: [Tracer; 2] = [Tracer::Bvh, Tracer::RayQuery];

impl Bench {
    #[cfg(test)]
    pub fn new() -> Self {
        let long = std::env::var_os("INSONIFY_LONG").is_some();
        Self::with(gpu::test_device().clone(), if long { &TRACERS } else { &TRACERS[..1] })
    }

    /// For the report.
    #[cfg_attr(test, allow(dead_code))]
    pub fn on(device: Arc<gpu::Device>) -> Self {
        Self::with(device, &TRACERS)
    }

    fn with(device: Arc<gpu::Device>, tracers: &'static [Tracer]) -> Self {
        let memo = Memo::default();
        Self { renderers: renderers(&device, tracers, &memo), device, tracers, memo }
    }
}

/// Result of a check, and the one with its error planted: the verdict of tests and report.
pub struct Examined {
    pub right: Outcome,
    planted: Outcome,
    /// Messages of the validation layers in the meantime.
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

    /// Returns whether every figure noticed the planted error, or its own.
    pub fn noticed(&self) -> bool {
        self.blind().is_empty()
    }

    /// Returns whether every figure holds, can be shown and has noticed an error, and the validation layers are silent.
    pub fn holds(&self) -> bool {
        self.right.holds() && self.right.is_drawable() && self.noticed() && self.messages.is_empty()
    }

    /// The reasons for failure, a text line each; empty if it holds.
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

/// Asserts that the check holds.
///
/// # Panics
/// It does not hold; with the reasons.
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
