//! Measurements and texts, with the image on which each was put.

use glam::{DAffine3, DVec2};
use serde::{Deserialize, Serialize};

use super::super::calipers::Caliper;

/// A text on the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Note {
    /// The text.
    pub text: String,
    /// Its left edge at half its height, mm lateral and mm deep.
    pub at: DVec2,
    /// Point that its arrow shows, mm.
    pub arrow: Option<DVec2>,
}

/// The pose and the time of an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// World from probe.
    pub pose: DAffine3,
    /// Time of the scene, s.
    pub seconds: f64,
}

/// Content of a mark.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum What {
    /// A measurement.
    Caliper(Caliper),
    /// A text.
    Note(Note),
}

/// A measurement or text, with the image on which it was put.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Its letter, `A` to `Z`.
    pub letter: char,
    /// Its content.
    pub what: What,
    /// Pose and time of its image.
    pub of: Moment,
}

impl Mark {
    /// Returns whether it is a measurement with a name, which the worksheet takes.
    pub fn is_named(&self) -> bool {
        matches!(&self.what, What::Caliper(caliper) if !caliper.label.trim().is_empty())
    }

    /// Points that the pointer can take, mm.
    pub fn points(&self) -> Vec<DVec2> {
        match &self.what {
            What::Caliper(caliper) => caliper.points.clone(),
            What::Note(note) => [note.at].into_iter().chain(note.arrow).collect(),
        }
    }

    pub(super) fn drag(&mut self, point: usize, to: DVec2) {
        match &mut self.what {
            What::Caliper(caliper) => caliper.drag(point, to),
            What::Note(note) if point == 0 => note.at = to,
            What::Note(note) => note.arrow = Some(to),
        }
    }
}

/// All marks of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marks {
    /// Those on the image.
    pub shown: Vec<Mark>,
    /// Named measurements that have left the image with an earlier freeze; the worksheet has them still.
    pub kept: Vec<Mark>,
}

impl Marks {
    /// All of them, in the order of their making as far as it is known: first what has left the image.
    pub fn iter(&self) -> impl Iterator<Item = &Mark> {
        self.kept.iter().chain(&self.shown)
    }
}
