//! The body mark: a small figure of the region that is examined, with the probe on it.

use std::f64::consts::PI;

use glam::DVec2;
use serde_json::{Value, json};

use crate::settings::Exam;

/// The figure of a body mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// The trunk from the front.
    Abdomen,
    /// The chest with the heart.
    Heart,
    /// The fetus in the womb.
    Fetus,
    /// The neck from the front.
    Neck,
    /// A leg.
    Limb,
}

impl Figure {
    /// All figures, in the order in which the button offers them.
    pub const ALL: [Self; 5] = [Self::Abdomen, Self::Heart, Self::Fetus, Self::Neck, Self::Limb];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Abdomen => "abdomen",
            Self::Heart => "heart",
            Self::Fetus => "fetus",
            Self::Neck => "neck",
            Self::Limb => "limb",
        }
    }

    /// The figure that suits an examination.
    pub fn of(exam: Exam) -> Self {
        match exam {
            Exam::General | Exam::Abdomen => Self::Abdomen,
            Exam::Cardiac | Exam::Lung => Self::Heart,
            Exam::Obstetric => Self::Fetus,
            Exam::Vascular => Self::Neck,
            Exam::SmallParts => Self::Limb,
        }
    }
}

/// A body mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMark {
    /// Its figure.
    pub figure: Figure,
    /// Middle of the probe: from -1 to 1 across the figure, and down it.
    pub probe: DVec2,
    /// Turn of the probe from across, clockwise, radians; the end with the orientation mark is at the left at 0.
    pub turn: f64,
}

impl BodyMark {
    /// Half the length of the probe's bar, where the figure is 2 wide.
    pub const HALF: f64 = 0.3;

    /// A mark with the probe across the figure's middle.
    pub fn new(figure: Figure) -> Self {
        Self { figure, probe: DVec2::ZERO, turn: 0.0 }
    }

    /// Both ends of the probe's bar; the first one is that of the orientation mark.
    pub fn ends(&self) -> [DVec2; 2] {
        let half = Self::HALF * DVec2::from_angle(self.turn);
        [self.probe - half, self.probe + half]
    }

    /// Puts the probe's middle somewhere, within the figure.
    pub fn place(&mut self, at: DVec2) {
        self.probe = at.clamp(DVec2::NEG_ONE, DVec2::ONE);
    }

    /// Turns the probe so that an end points to `at`: the one with the orientation mark where `first`.
    pub fn point(&mut self, first: bool, at: DVec2) {
        let way = if first { self.probe - at } else { at - self.probe };
        if way.length() > 1e-3 {
            self.turn = way.to_angle().rem_euclid(2.0 * PI);
        }
    }

    /// What sidecars say: figure, the probe's middle as shares of the figure's half width and height, its turn.
    pub fn json(&self) -> Value {
        json!({
            "figure": self.figure.name(),
            "probe": self.probe.to_array(),
            "turn_deg": self.turn.to_degrees(),
        })
    }
}

/// The mark that follows another one as the button is pressed: the examination's figure first, then all others, then
/// none. The probe stays where it is.
pub fn next(mark: Option<BodyMark>, exam: Exam) -> Option<BodyMark> {
    let first = Figure::of(exam);
    let Some(mark) = mark else {
        return Some(BodyMark::new(first));
    };
    let of = |figure| Figure::ALL.iter().position(|one| *one == figure).unwrap_or(0);
    let figure = Figure::ALL[(of(mark.figure) + 1) % Figure::ALL.len()];
    (figure != first).then_some(BodyMark { figure, ..mark })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    #[test]
    fn the_button_goes_through_all_figures_from_that_of_the_examination() {
        for exam in [Exam::Obstetric, Exam::Abdomen, Exam::SmallParts] {
            let (mut mark, mut seen) = (None, Vec::new());
            while let Some(one) = next(mark, exam) {
                seen.push(one.figure);
                mark = Some(one);
            }
            assert_eq!((seen[0], seen.len()), (Figure::of(exam), Figure::ALL.len()));
        }
    }

    #[test]
    fn the_probe_is_placed_within_the_figure_and_turned_by_its_ends() {
        let mut mark = BodyMark::new(Figure::Neck);
        mark.place(dvec2(0.5, 9.0));
        assert_eq!(mark.probe, dvec2(0.5, 1.0));
        mark.point(false, dvec2(0.5, 3.0));
        assert!((mark.turn - PI / 2.0).abs() < 1e-12, "the second end is down");
        assert!(mark.ends()[0].distance(dvec2(0.5, 0.7)) < 1e-12);
        // Held by the other end, the same place turns it over.
        mark.point(true, dvec2(0.5, 3.0));
        assert!((mark.turn - 1.5 * PI).abs() < 1e-12);
        let before = mark;
        mark.point(true, mark.probe);
        assert_eq!(mark, before, "no direction");
        assert_eq!(mark.json()["figure"], "neck");
        assert!((mark.json()["turn_deg"].as_f64().expect("a number") - 270.0).abs() < 1e-9);
    }
}
