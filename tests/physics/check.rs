//! What a proof consists of: figures held against closed forms, with the curves and pictures that
//! show them. Tests and the report take their verdicts from here.

use std::sync::Arc;

use insonify::gpu;

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
    /// The error that the comparison must notice.
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
}

impl Figure {
    /// A NaN never holds.
    pub fn holds(&self) -> bool {
        (self.measured - self.expected).abs() <= self.tolerance
    }
}

/// One line, or one cloud of dots.
#[derive(Clone, Debug)]
pub struct Curve {
    pub label: String,
    pub points: Vec<[f64; 2]>,
    /// Drawn as a line: closed forms; else as dots: measurements.
    pub line: bool,
}

#[derive(Clone, Debug)]
pub struct Plot {
    pub title: String,
    /// What the axes show, with units.
    pub axes: [String; 2],
    /// Decades instead of a linear scale, per axis.
    pub logarithmic: [bool; 2],
    pub curves: Vec<Curve>,
}

/// Grey levels row by row.
#[derive(Clone, Debug)]
pub struct Picture {
    pub title: String,
    pub width: u32,
    pub grey: Vec<u8>,
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
    ) {
        self.figures.push(Figure {
            what: what.into(),
            measured,
            expected,
            tolerance,
        });
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
    pub fn new() -> Self {
        Self {
            device: gpu::test_device(),
            renderers: renderers(),
        }
    }
}

/// The check holds, and notices its planted error.
///
/// # Panics
/// With the figures, if not.
pub fn prove(check: &Check) {
    let bench = Bench::new();
    let right = (check.run)(&bench, Physics::Right);
    assert!(
        right.holds(),
        "{} {}: {:#?}",
        check.row,
        check.name,
        right.failures()
    );
    let wrong = (check.run)(&bench, Physics::Planted);
    assert!(
        !wrong.holds(),
        "{} {}: not noticed: {}",
        check.row,
        check.name,
        check.planted
    );
}
