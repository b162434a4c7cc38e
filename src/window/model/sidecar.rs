//! The text beside a saved picture: pose, time, settings and measurements.

use serde_json::{Map, Value, json};

use super::calipers::{Caliper, Reading};
use super::sheet::{Marks, Moment, What};

/// Measurements and texts of saved images, under the keys `measurements`, `texts`, and `worksheet` for named
/// measurements that have left the image. `moments` are those of the images: each mark on the image says whether it was
/// put on one of these; of several, on which.
pub fn marks(all: &Marks, moments: &[Moment]) -> Map<String, Value> {
    let (mut measurements, mut texts) = (Vec::new(), Vec::new());
    for mark in &all.shown {
        let place = moments.iter().position(|moment| *moment == mark.of);
        let here = match moments.len() {
            1 => ("of_this_image", json!(place.is_some())),
            _ => ("of_frame", json!(place)),
        };
        match &mark.what {
            What::Caliper(caliper) => {
                let mut entry = measurement(mark.letter, caliper);
                entry.insert(here.0.into(), here.1);
                measurements.push(Value::Object(entry));
            }
            What::Note(note) => texts.push(json!({
                "text": note.text,
                "at_mm": note.at.to_array(),
                "arrow_mm": note.arrow.map(|tip| tip.to_array()),
                (here.0): here.1,
            })),
        }
    }
    let earlier = all.kept.iter().filter_map(|mark| match &mark.what {
        What::Caliper(caliper) => Some(Value::Object(measurement(mark.letter, caliper))),
        What::Note(_) => None,
    });
    let mut out = Map::new();
    out.insert("measurements".into(), Value::Array(measurements));
    out.insert("texts".into(), Value::Array(texts));
    out.insert("worksheet".into(), earlier.collect());
    out
}

fn measurement(letter: char, caliper: &Caliper) -> Map<String, Value> {
    let points: Vec<_> = caliper.points.iter().map(|p| p.to_array()).collect();
    let head = [
        ("letter", json!(letter)),
        ("kind", json!(caliper.kind.name())),
        ("label", json!(caliper.label)),
        ("points_mm", json!(points)),
    ];
    let head = head.into_iter().map(|(key, value)| (key.to_owned(), value));
    head.chain(values(&caliper.reading())).collect()
}

fn values(reading: &Reading) -> Map<String, Value> {
    let pairs = match *reading {
        Reading::Distance(mm) => vec![("length_mm", json!(mm))],
        Reading::Ellipse { axes, circumference, area } => vec![
            ("axes_mm", json!(axes)),
            ("circumference_mm", json!(circumference)),
            ("area_mm2", json!(area)),
        ],
        Reading::Angle(degrees) => vec![("angle_deg", json!(degrees))],
        Reading::Trace { circumference, area } => {
            vec![("circumference_mm", json!(circumference)), ("area_mm2", json!(area))]
        }
    };
    pairs.into_iter().map(|(key, value)| (key.into(), value)).collect()
}

/// A title as part of a file's name: letters, digits and hyphens.
pub fn stem(title: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }
    };
    let text: String = title.chars().map(plain).collect();
    let words: Vec<&str> = text.split('-').filter(|word| !word.is_empty()).collect();
    match words.is_empty() {
        true => "image".into(),
        false => words.join("-").chars().take(60).collect(),
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec2, DVec3, dvec2};
    use serde_json::json;

    use super::super::calipers::{Caliper, CaliperKind};
    use super::super::sheet::{Mark, Marks, Moment, Note, What};
    use super::{marks, stem};
    use crate::sim::facts::pose;

    #[test]
    fn names_of_files_are_plain() {
        for (title, expected) in [
            ("General-purpose phantom", "general-purpose-phantom"),
            ("../../etc/passwd", "etc-passwd"),
            ("Fœtus 20 wk: AC/HC", "f-tus-20-wk-ac-hc"),
            ("", "image"),
            ("...", "image"),
        ] {
            assert_eq!(stem(title), expected);
        }
        assert_eq!(stem(&"a".repeat(999)).len(), 60);
    }

    #[test]
    fn measurements_say_what_they_measure_and_where() {
        let moment =
            Moment { pose: DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)), seconds: 0.5 };
        let later = Moment { seconds: 0.6, ..moment };
        let caliper = |kind, points: &[DVec2], label: &str| Caliper {
            label: label.into(),
            ..Caliper::new(kind, points.to_vec())
        };
        let note = Note { text: "vessel".into(), at: dvec2(1.0, 2.0), arrow: None };
        let all = [
            Mark {
                letter: 'A',
                what: What::Caliper(caliper(
                    CaliperKind::Distance,
                    &[DVec2::ZERO, dvec2(3.0, 4.0)],
                    "BPD",
                )),
                of: moment,
            },
            Mark { letter: 'B', what: What::Note(note), of: later },
        ];
        let all = Marks { kept: all[..1].to_vec(), shown: all.to_vec() };
        let listed = marks(&all, &[moment]);
        let expected = json!([{
            "letter": "A", "kind": "distance", "label": "BPD",
            "points_mm": [[0.0, 0.0], [3.0, 4.0]],
            "of_this_image": true,
            "length_mm": 5.0,
        }]);
        assert_eq!(listed["measurements"], expected);
        assert_eq!(listed["texts"][0]["text"], "vessel");
        assert_eq!(listed["texts"][0]["of_this_image"], false);
        let earlier = &listed["worksheet"][0];
        assert_eq!((&earlier["label"], &earlier["length_mm"]), (&json!("BPD"), &json!(5.0)));
        assert_eq!(earlier["of_this_image"], json!(null));
        let listed = marks(&all, &[later, moment]);
        assert_eq!(listed["measurements"][0]["of_frame"], 1);
        assert_eq!(listed["texts"][0]["of_frame"], 0);
        assert_eq!(pose(&moment.pose)["position_mm"], json!([1.0, 2.0, 3.0]));
        assert_eq!(pose(&moment.pose)["depth"], json!([0.0, 0.0, 1.0]));
    }
}
