//! Values of keys: as text, as JSON, and what is wrong with one.

use glam::DVec3;
use serde_json::{Value as Json, json};

use super::key::{Facts, Form};
use super::units::ANGLE;

/// The value of a key, in the unit used inside.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number, or a quantity.
    Number(f64),
    /// A count.
    Whole(u32),
    /// Yes or no.
    Switch(bool),
    /// One of the key's words.
    Word(&'static str),
    /// Several numbers or quantities.
    List(Vec<f64>),
    /// A name, or another text.
    Text(String),
    /// Several of them.
    Texts(Vec<String>),
    /// The file does not say it.
    Absent,
}

impl Facts {
    /// A value as TOML says it; none for [`Value::Absent`].
    pub fn text(&self, value: &Value) -> Option<String> {
        let listed = |all: &[f64]| {
            let texts: Vec<_> = all.iter().map(|v| plain(*v)).collect();
            format!("[{}]", texts.join(", "))
        };
        Some(match (value, self.form) {
            (Value::Absent, _) => return None,
            (Value::Number(radians), form) if form.measures(&ANGLE) => angle(*radians),
            (Value::Number(number), Form::Quantity(measure)) if number.is_finite() => {
                format!("\"{} {}\"", plain(*number), measure.unit())
            }
            (Value::Number(number), _) => plain(*number),
            (Value::Whole(count), _) => count.to_string(),
            (Value::Switch(on), _) => on.to_string(),
            (Value::Word(word), _) => format!("\"{word}\""),
            (Value::List(all), Form::Factors) if all.iter().all(|v| *v == all[0]) => plain(all[0]),
            (Value::List(all), _) => listed(all),
            (Value::Text(text), _) => format!("{text:?}"),
            (Value::Texts(texts), _) => format!("{texts:?}"),
        })
    }

    /// A value as JSON, in the unit of [`Self::unit`]; a number that JSON cannot hold (`inf`, `-inf`) is the text of a scene
    /// file, and [`Value::Absent`] is null.
    pub fn json(&self, value: &Value) -> Json {
        match value {
            Value::Absent => Json::Null,
            Value::Number(number) if number.is_finite() => json!(number),
            Value::Number(number) => plain(*number).into(),
            Value::Whole(count) => json!(count),
            Value::Switch(on) => json!(on),
            Value::Word(word) => json!(word),
            Value::List(all) => json!(all),
            Value::Text(text) => json!(text),
            Value::Texts(texts) => json!(texts),
        }
    }

    /// The fault of a value outside the key's range, and its remedy; none for a value in the range. NaN is in no range.
    pub fn fault(&self, value: &Value) -> Option<(String, String)> {
        let all = match value {
            Value::List(all) if matches!(self.form, Form::Direction) => {
                let direction = DVec3::from_slice(all).try_normalize();
                let cause = format!("this {} has no length", self.name());
                let remedy = "give a vector such as [0, 0, 1]".to_owned();
                return direction.is_none().then_some((cause, remedy));
            }
            Value::List(all)
                if let Some([least, most]) = self.counts
                    && !(least..=most).contains(&all.len()) =>
            {
                let cause = format!("{} has {} values", self.name(), all.len());
                return Some((cause, format!("give {least} to {most} of them")));
            }
            Value::Number(number) => std::slice::from_ref(number),
            Value::List(all) => all,
            Value::Whole(count) => return self.outside(f64::from(*count)),
            _ => return None,
        };
        all.iter().find_map(|&number| self.outside(number))
    }

    fn outside(&self, number: f64) -> Option<(String, String)> {
        let [least, most] = self.range;
        // A key without limits is checked by the code that knows its limits.
        let endless = least == f64::NEG_INFINITY && most == f64::INFINITY;
        if endless || (least..=most).contains(&number) {
            return None;
        }
        let unit = match self.unit() {
            "" => String::new(),
            unit => format!(" {unit}"),
        };
        let remedy = match most.is_infinite() {
            true => format!("it must be at least {least}{unit}"),
            false => format!("it must lie between {least} and {most}{unit}"),
        };
        Some((format!("{} is {}{unit}", self.name(), plain(number)), remedy))
    }
}

/// The text of a number that TOML reads back exactly.
pub fn plain(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// The text of an angle: in degrees, as most people write them, if they give exactly the same number.
fn angle(radians: f64) -> String {
    let degrees = (radians.to_degrees() * 1e9).round() / 1e9;
    match degrees * (std::f64::consts::PI / 180.0) == radians {
        true => format!("\"{} deg\"", plain(degrees)),
        false => format!("\"{} rad\"", plain(radians)),
    }
}
