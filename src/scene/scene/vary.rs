//! One parameter at a time below and above the scene's own value: an observer picks the most realistic
//! of the images, as in the user study of Starkov et al. 2019, section III-B. That tuned eleven major
//! parameters and does not list them; [`SUGGESTED`] are ours.

use crate::settings::units::ANGLE;
use crate::settings::{Facts, Form, Group, Member, Settings, Value, Visitor};

/// Distance from the scene's own value, below and above.
#[derive(Clone, Copy, Debug)]
enum Around {
    /// The value times these factors.
    Times(f64, f64),
    /// The value minus and plus this step.
    Plus(f64),
}

/// The parameters that are varied where the scene file names none: key, name on the contact sheet, and distance, so
/// that the images differ to the eye. The frequencies relate to each other as the 5, 7 and 9 MHz of the paper's
/// figure 13; the others were found by looking.
const SUGGESTED: [(&str, &str, Around); 11] = [
    ("frequency", "frequency", Around::Times(5.0 / 7.0, 9.0 / 7.0)),
    ("gain", "gain", Around::Plus(6.0)),
    ("tgc_attenuation", "TGC slope", Around::Times(0.75, 1.25)),
    ("dynamic_range", "dynamic range", Around::Times(0.75, 1.25)),
    ("speckle_gain", "speckle level", Around::Plus(6.0)),
    ("density_scale", "scatterer density", Around::Times(0.05, 4.0)),
    ("psf_lateral", "lateral PSF", Around::Times(0.5, 2.0)),
    ("psf_axial", "axial PSF", Around::Times(0.5, 2.0)),
    ("surface_gain", "surface level", Around::Plus(12.0)),
    ("roughness_scale", "roughness exponent", Around::Times(0.001, 100.0)),
    ("thickness_scale", "surface thickness", Around::Times(0.0, 10.0)),
];

/// A number among the settings of probe, simulation or imaging.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    table: &'static str,
    pub(super) facts: &'static Facts,
    /// Index of the number in a list.
    part: Option<usize>,
}

impl PartialEq for Parameter {
    fn eq(&self, other: &Self) -> bool {
        self.path() == other.path() && self.part == other.part
    }
}

/// All numbers among the settings of a table.
fn numbers<T: Group>() -> impl Iterator<Item = Parameter> {
    T::rows().iter().flat_map(|row| {
        let facts = &row.facts;
        let parts = match facts.form {
            Form::Number | Form::Quantity(_) | Form::Whole => vec![None],
            Form::Numbers(_) => (0..facts.parts.len()).map(Some).collect(),
            _ => Vec::new(),
        };
        // The probe may not be a sector.
        let parts = parts.into_iter().filter(|_| !facts.form.measures(&ANGLE));
        parts.map(|part| Parameter { table: T::TABLE, facts, part })
    })
}

impl Parameter {
    /// All parameters.
    pub fn all() -> impl Iterator<Item = Self> {
        struct All(Vec<Parameter>);
        impl Visitor for All {
            fn visit<T: Group>(&mut self, _: Member<T>) {
                // A contact sheet has neither colours nor spectra.
                if !Settings::MODES.contains(&T::TABLE) {
                    self.0.extend(numbers::<T>());
                }
            }
        }
        let mut all = All(Vec::new());
        Settings::each(&mut all);
        all.0.into_iter()
    }

    /// The parameters of a contact sheet where the file names none, in its order.
    pub fn suggested() -> impl Iterator<Item = Self> {
        SUGGESTED.iter().filter_map(|(key, ..)| Self::of(key))
    }

    /// The parameter with this key.
    pub fn of(key: &str) -> Option<Self> {
        Self::all().find(|parameter| parameter.key() == key)
    }

    fn suggestion(&self) -> Option<&'static (&'static str, &'static str, Around)> {
        SUGGESTED.iter().find(|(key, ..)| *key == self.key())
    }

    /// Its key in the table `[vary]` of a scene file: that of the setting, or of one number of it (`psf_axial`).
    pub fn key(&self) -> String {
        match self.part {
            None => self.facts.key.to_owned(),
            Some(part) => {
                let stem = self.facts.key.split('_').next().unwrap_or_default();
                format!("{stem}_{}", self.facts.parts[part])
            }
        }
    }

    /// Path of its setting.
    pub fn path(&self) -> String {
        format!("{}.{}", self.table, self.facts.key)
    }

    /// Form of its values.
    pub(super) fn form(&self) -> &'static Form {
        match &self.facts.form {
            Form::Numbers(_) | Form::Whole => &Form::Number,
            form => form,
        }
    }

    /// Its name on a contact sheet.
    pub fn name(&self) -> String {
        match self.suggestion() {
            Some((_, name, _)) => (*name).to_owned(),
            None => self.key().replace('_', " "),
        }
    }

    /// Its unit; empty for a factor.
    pub fn unit(&self) -> &'static str {
        self.facts.unit()
    }

    /// Its value, in [`Self::unit`]; none where the probe does not have it.
    pub fn value(&self, settings: &Settings) -> Option<f64> {
        match (settings.value(self.table, self.facts.key)?, self.part) {
            (Value::Number(number), _) => Some(number),
            (Value::Whole(count), _) => Some(f64::from(count)),
            (Value::List(list), Some(part)) => list.get(part).copied(),
            _ => None,
        }
    }

    /// A value below and one above `own`, from [`SUGGESTED`]; none for other parameters.
    pub fn around(&self, own: f64) -> Option<[f64; 2]> {
        Some(match self.suggestion()?.2 {
            Around::Times(below, above) => [round(own * below), round(own * above)],
            Around::Plus(step) => [own - step, own + step],
        })
    }

    /// Text about the values where the file gives none; empty for parameters that are not
    /// suggested.
    pub fn suggested_values(&self) -> String {
        match self.suggestion() {
            Some((.., Around::Times(below, above))) => {
                format!("the scene's times {} and {}", short(*below), short(*above))
            }
            Some((.., Around::Plus(step))) => {
                format!("the scene's -{step} and +{step} {}", self.unit())
            }
            None => String::new(),
        }
    }

    /// The entry of the scene file, path and value, for `value` beside the other `settings`.
    pub fn setting(&self, settings: &Settings, value: f64) -> (String, String) {
        let text = match (self.part, settings.value(self.table, self.facts.key)) {
            (Some(part), Some(Value::List(mut list))) => {
                list[part] = value;
                let list: Vec<_> = list.iter().map(f64::to_string).collect();
                format!("[{}]", list.join(","))
            }
            _ => value.to_string(),
        };
        (self.path(), text)
    }

    /// Name and value for a contact sheet: "gain 10 dB", "axial PSF x 2".
    pub fn caption(&self, value: f64) -> String {
        let (name, value) = (self.name(), short(value));
        match (self.unit(), self.suggestion()) {
            ("", Some(_)) => format!("{name} \u{d7} {value}"),
            ("", None) => format!("{name} {value}"),
            (unit, _) => format!("{name} {value} {unit}"),
        }
    }
}

/// A value rounded to two digits: a suggested value may be a plain one.
fn round(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}

/// A value as text with at most four digits.
pub fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    rounded.to_string()
}

/// A scene with one parameter at another value.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value, in [`Parameter::unit`].
    pub value: f64,
    /// The equivalent entry of the scene file, path and value.
    pub setting: (String, String),
    /// The scene's settings with it.
    pub settings: Settings,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(key: &str) -> Parameter {
        Parameter::of(key).expect(key)
    }

    #[test]
    fn every_key_is_the_key_of_one_parameter_and_all_that_are_suggested_exist() {
        let mut keys: Vec<_> = Parameter::all().map(|p| p.key()).collect();
        assert!(keys.len() > 40 && keys.contains(&"focus".to_owned()), "{keys:?}");
        keys.sort();
        let count = keys.len();
        keys.dedup();
        assert_eq!(keys.len(), count);
        assert_eq!(Parameter::suggested().count(), SUGGESTED.len());
    }

    #[test]
    fn suggested_values_lie_on_both_sides_and_are_plain() {
        for parameter in Parameter::suggested() {
            for own in [0.5, 1.0, 7.0, 60.0] {
                let [below, above] = parameter.around(own).expect("suggested");
                assert!(below < own && own < above, "{parameter:?} {own}");
            }
        }
        assert_eq!(parameter("frequency").around(7.0), Some([5.0, 9.0]));
        assert_eq!(parameter("frequency").around(6.0), Some([4.3, 7.7]));
        assert_eq!(parameter("dynamic_range").around(60.0), Some([45.0, 75.0]));
        assert_eq!(parameter("focus").around(60.0), None);
    }

    #[test]
    fn captions_name_value_and_unit() {
        assert_eq!(parameter("gain").caption(-10.0), "gain -10 dB");
        assert_eq!(parameter("psf_axial").caption(2.0 / 3.0), "axial PSF \u{d7} 0.6667");
        assert_eq!(parameter("elevation_focus").caption(60.0), "elevation focus 60 mm");
        assert_eq!(short(f64::NEG_INFINITY), "-inf");
    }
}
