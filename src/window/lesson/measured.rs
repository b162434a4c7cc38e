//! The value of a measurement task: taken from what is measured on the image, or typed.

use egui::{RichText, TextEdit, Ui};

use crate::exam;
use crate::model::Model;
use crate::model::calipers::{Caliper, Reading};
use crate::model::sheet::{Mark, Marks, What};
use crate::scene::task::Unit;
use crate::settings::Words as _;
use crate::style::{self, button};
use insonify_lab::exam::Worksheet;

/// What is to be handed in.
#[derive(Default)]
pub(super) struct Measured {
    text: String,
    /// Name of the offer that the learner has chosen; where there is none of that name, the newest is.
    chosen: String,
}

impl Measured {
    /// The value, once there is a number.
    pub(super) fn value(&self) -> Option<f64> {
        let value = self.text.trim().replace(',', ".").parse::<f64>().ok();
        value.filter(|value| value.is_finite())
    }
}

/// A measurement that suits the task.
#[derive(Clone, Debug, PartialEq)]
struct Offer {
    name: String,
    /// In the task's unit.
    value: f64,
}

/// The measurements in a unit, the newest first; of several with one name, that one. Those with a letter are on the
/// image.
fn offers(marks: &Marks, worksheet: &Worksheet, unit: Unit) -> Vec<Offer> {
    let mut all: Vec<Offer> = Vec::new();
    let mut add = |name: String, value: f64| {
        if all.iter().all(|offer| offer.name != name) {
            all.push(Offer { name, value });
        }
    };
    if unit == Unit::Volume {
        let derived = worksheet.derived.iter().filter(|one| one.unit == unit.word());
        derived.for_each(|one| add(one.name.to_owned(), one.value));
        let lines = worksheet.lines.iter().filter(|line| line.quantity.unit() == unit.word());
        lines.for_each(|line| add(line.name.clone(), line.mean()));
        return all;
    }
    let shown = marks.shown.iter().rev().map(|mark| (mark, format!("{} ", mark.letter)));
    let kept = marks.kept.iter().rev().map(|mark| (mark, String::new()));
    for (Mark { what, .. }, letter) in shown.chain(kept) {
        let What::Caliper(caliper) = what else { continue };
        let label = caliper.label.trim();
        let label = if label.is_empty() { caliper.kind.name() } else { label };
        for (part, value) in values(caliper, unit) {
            add(format!("{letter}{label}{part}"), value);
        }
    }
    all
}

/// What a measurement says in mm or mm2, each value with what it is where there are several.
fn values(caliper: &Caliper, unit: Unit) -> Vec<(&'static str, f64)> {
    match (caliper.reading(), unit) {
        (Reading::Distance(mm), Unit::Length) => vec![("", mm)],
        (Reading::Ellipse { axes: [a, b], circumference, .. }, Unit::Length) => {
            vec![(", first axis", a), (", second axis", b), (", circumference", circumference)]
        }
        (Reading::Trace { circumference, .. }, Unit::Length) => {
            vec![(", circumference", circumference)]
        }
        (Reading::Ellipse { area, .. } | Reading::Trace { area, .. }, Unit::Area) => {
            vec![("", area)]
        }
        _ => Vec::new(),
    }
}

/// Draws the field, and what of the image may be taken into it.
pub(super) fn show(ui: &mut Ui, model: &Model, measured: &mut Measured, unit: Unit) {
    ui.horizontal(|ui| {
        ui.label("Measured");
        ui.add(TextEdit::singleline(&mut measured.text).desired_width(80.0));
        ui.label(unit.word());
    });
    let offers = offers(model.sheet.all(), &exam::worksheet(model), unit);
    if offers.is_empty() {
        let text = match unit {
            Unit::Volume => {
                "Name three lengths on the image volume L, volume AP and volume W: what follows from them is offered here."
            }
            Unit::Length | Unit::Area => "What is measured on the image is offered here.",
        };
        ui.label(RichText::new(text).color(style::FAINT));
        return;
    }
    let was = offers.iter().position(|offer| offer.name == measured.chosen).unwrap_or(0);
    let mut at = was;
    ui.horizontal(|ui| {
        if button(ui, "Take", "The measurement on the image, as it is now, into the field") {
            measured.text = format!("{:.2}", offers[at].value);
        }
        let all: Vec<usize> = (0..offers.len()).collect();
        let shown = |at: usize| {
            let Offer { name, value } = &offers[at];
            format!("{name}: {value:.1} {}", unit.word())
        };
        style::choice(ui, "measured", 200.0, &mut at, &all, shown);
    });
    if at != was {
        measured.chosen.clone_from(&offers[at].name);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::{DAffine3, DVec2, dvec2};

    use super::*;
    use crate::model::calipers::CaliperKind;
    use crate::model::sheet::Moment;
    use crate::settings::Exam;

    fn mark(letter: char, kind: CaliperKind, label: &str, points: &[DVec2]) -> Mark {
        let caliper = Caliper { label: label.to_owned(), ..Caliper::new(kind, points.to_vec()) };
        let of = Moment { pose: DAffine3::IDENTITY, seconds: 0.0 };
        Mark { letter, what: What::Caliper(caliper), of }
    }

    fn length(letter: char, label: &str, mm: f64) -> Mark {
        mark(letter, CaliperKind::Distance, label, &[DVec2::ZERO, DVec2::X * mm])
    }

    fn offered(marks: &Marks, unit: Unit) -> Vec<(String, f64)> {
        let measured: Vec<_> = (marks.iter())
            .map(|mark| match &mark.what {
                What::Caliper(caliper) => caliper.measured(),
                What::Note(_) => panic!("there is no text"),
            })
            .collect();
        let sheet = Worksheet::of(Exam::Abdomen, &measured);
        offers(marks, &sheet, unit).into_iter().map(|Offer { name, value }| (name, value)).collect()
    }

    #[test]
    fn what_suits_the_unit_is_offered_the_newest_first() {
        let ellipse = [dvec2(0.0, 0.0), dvec2(20.0, 0.0), dvec2(10.0, 5.0)];
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|p| 8.0 * p);
        let marks = Marks {
            kept: vec![length('A', "CBD", 4.0), length('B', "CBD", 5.0)],
            shown: vec![
                length('A', "", 30.0),
                mark('B', CaliperKind::Ellipse, "cyst", &ellipse),
                mark('C', CaliperKind::Angle, "", &ellipse),
                mark('D', CaliperKind::Trace, "", &square),
            ],
        };
        let names = |unit| -> Vec<String> {
            offered(&marks, unit).into_iter().map(|(name, _)| name).collect()
        };
        let lengths = [
            "D trace, circumference",
            "B cyst, first axis",
            "B cyst, second axis",
            "B cyst, circumference",
            "A distance",
            "CBD",
        ];
        assert_eq!(names(Unit::Length), lengths);
        assert_eq!(offered(&marks, Unit::Length)[5].1, 5.0, "the newer one of the name");
        assert_eq!(names(Unit::Area), ["D trace", "B cyst"]);
        assert!((offered(&marks, Unit::Area)[1].1 - 50.0 * PI).abs() < 1e-9, "mm2");
        assert_eq!(names(Unit::Volume), [""; 0]);
    }

    #[test]
    fn a_volume_follows_from_three_axes() {
        for (names, of) in [
            (["kidney L", "kidney AP", "kidney W"], "kidney volume"),
            (["volume L", "volume AP", "volume W"], "volume"),
        ] {
            let [l, ap, w] = names;
            let shown = vec![length('A', ap, 50.0), length('B', w, 60.0)];
            let mut marks = Marks { kept: vec![length('A', l, 100.0)], shown };
            let found = offered(&marks, Unit::Volume);
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].0, of);
            assert!((found[0].1 - PI / 6.0 * 300.0).abs() < 1e-6, "{found:?}");
            marks.kept.clear();
            assert_eq!(offered(&marks, Unit::Volume), []);
        }
    }

    #[test]
    fn a_number_is_typed_with_a_point_or_a_comma() {
        let typed = |text: &str| Measured { text: text.to_owned(), ..Measured::default() }.value();
        assert_eq!([typed(" 9.5"), typed("9,5 ")], [Some(9.5); 2]);
        assert_eq!([typed(""), typed("nan"), typed("9.5 mm")], [None; 3]);
    }
}
