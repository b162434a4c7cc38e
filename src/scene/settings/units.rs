//! Quantities of scene files: a number in the unit used inside, or a string with its unit.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, Visitor};

/// Largest distance from the origin along an axis at which anything of a scene lies, mm: single precision, in which meshes and
/// the device have their coordinates, resolves a hundredth of a millimetre there.
pub const FARTHEST: f64 = 1e5;

/// A measure: a kind of quantity with its units.
#[derive(Debug, PartialEq)]
pub struct Measure {
    /// Its name in the reference (docs/scenes.md).
    pub name: &'static str,
    /// Noun for messages, with article.
    what: &'static str,
    /// Units with their factors to the one used inside, which is the first and that of a plain number.
    units: &'static [(&'static str, f64)],
    /// A remark of the reference beside the units.
    pub note: &'static str,
    /// True if a plain number is accepted.
    plain: bool,
}

macro_rules! measures {
    ($($(#[$doc:meta])* $constant:ident: $name:literal, $what:literal, $plain:literal, $note:literal,
        [$($unit:expr),+];)+
    ) => {
        $(
            $(#[$doc])*
            pub const $constant: Measure = Measure {
                name: $name, what: $what, units: &[$($unit),+], note: $note, plain: $plain,
            };
        )+

        /// All measures, in the order of the reference.
        pub const MEASURES: &[&Measure] = &[$(&$constant),+];
    };
}

measures! {
    /// mm.
    LENGTH: "length", "a length", true, "",
        [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("um", 1e-3)];
    /// Radians. A plain number is refused: most people would mean degrees.
    ANGLE: "angle", "an angle", false, "a plain number other than 0 is refused",
        [("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)];
    /// MHz.
    FREQUENCY: "frequency", "a frequency", true, "",
        [("MHz", 1.0), ("kHz", 1e-3), ("Hz", 1e-6)];
    /// mm/us.
    SPEED: "speed", "a speed of sound", true, "",
        [("mm/us", 1.0), ("m/s", 1e-3), ("km/s", 1.0)];
    /// mm/s.
    VELOCITY: "velocity", "a velocity", true, "of blood and tissue",
        [("mm/s", 1.0), ("cm/s", 10.0), ("m/s", 1000.0)];
    /// g/cm3.
    DENSITY: "density", "a density", true, "",
        [("g/cm3", 1.0), ("kg/m3", 1e-3), ("g/cm^3", 1.0), ("kg/m^3", 1e-3)];
    /// dB/(cm MHz).
    ATTENUATION: "attenuation", "an attenuation", true,
        "one way, at 1 MHz",
        [("dB/cm/MHz", 1.0), ("dB/(cm MHz)", 1.0), ("dB/m/MHz", 1e-2), ("dB/mm/MHz", 10.0)];
    /// s.
    DURATION: "duration", "a duration", true, "", [("s", 1.0), ("ms", 1e-3)];
    /// Times per second, Hz.
    RATE: "rate", "a rate", true, "", [("Hz", 1.0), ("kHz", 1000.0)];
    /// MRayl.
    IMPEDANCE: "impedance", "an impedance", true, "",
        [("MRayl", 1.0), ("kg/m2/s", 1e-6), ("Rayl", 1e-6)];
    /// dB.
    LEVEL: "level", "a level", true,
        "of amplitude: 20 dB are a factor of 10; `\"-inf dB\"` or `-inf` is off",
        [("dB", 1.0)];
}

impl Measure {
    /// The unit used inside.
    pub fn unit(&self) -> &'static str {
        self.units[0].0
    }

    /// All units, as messages and the reference list them.
    pub fn allowed(&self) -> String {
        let names: Vec<_> = self.units.iter().map(|u| format!("`{}`", u.0)).collect();
        names.join(", ")
    }

    /// Parses "60 mm".
    ///
    /// # Errors
    /// A message with the fault of the text and the units that exist.
    pub fn parse(&self, text: &str) -> Result<f64, String> {
        let text = text.trim();
        let end = (0..=text.len())
            .rev()
            .filter(|&i| text.is_char_boundary(i))
            .find(|&i| text[..i].trim_end().parse::<f64>().is_ok())
            .ok_or_else(|| {
                format!("`{text}` is not {}; write it like \"1.5 {}\"", self.what, self.unit())
            })?;
        let value: f64 = text[..end].trim_end().parse().map_err(|_| "not a number".to_owned())?;
        let compact = |s: &str| s.split_whitespace().collect::<String>();
        let unit = compact(&text[end..]);
        if unit.is_empty() {
            return Err(format!("`{text}` has no unit; {} takes {}", self.what, self.allowed()));
        }
        let factor = self.units.iter().find(|u| compact(u.0) == unit);
        let (_, factor) = factor.ok_or_else(|| {
            format!("unit `{unit}` does not fit: {} takes {}", self.what, self.allowed())
        })?;
        Ok(value * factor)
    }

    /// Parses a finite quantity as on the command line: a plain number where scene files take one, or with a unit.
    ///
    /// # Errors
    /// The fault of the text, in words.
    pub fn finite(&self, text: &str) -> Result<f64, String> {
        let plain = text.trim().parse().ok().filter(|_| self.plain);
        let value = plain.map_or_else(|| self.parse(text), Ok)?;
        match value.is_finite() {
            true => Ok(value),
            false => Err(format!("{value} {} is no {}", self.unit(), self.name)),
        }
    }

    fn plain<E: Error>(&self, value: f64) -> Result<f64, E> {
        // Zero is zero in every unit.
        if !self.plain && value != 0.0 {
            return Err(E::custom(format!("{} needs its unit: {}", self.what, self.allowed())));
        }
        self.number(value)
    }

    fn number<E: Error>(&self, value: f64) -> Result<f64, E> {
        match value.is_nan() {
            true => Err(E::custom(format!("{} cannot be NaN", self.what))),
            false => Ok(value),
        }
    }
}

impl Visitor<'_> for &Measure {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.unit();
        write!(f, "{}: a number in {unit} or a string like \"1.5 {unit}\"", self.what)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        self.plain(value)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        self.plain(value as f64)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<f64, E> {
        self.number(self.parse(text).map_err(E::custom)?)
    }
}

impl<'de> DeserializeSeed<'de> for &Measure {
    type Value = f64;

    fn deserialize<R: Deserializer<'de>>(self, deserializer: R) -> Result<f64, R::Error> {
        deserializer.deserialize_any(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_converted() {
        for (text, value) in
            [("60 mm", 60.0), ("6cm", 60.0), ("0.5 m", 500.0), ("1e3 um", 1.0), ("-2.5 mm", -2.5)]
        {
            assert_eq!(LENGTH.parse(text), Ok(value), "{text}");
        }
        assert_eq!(FREQUENCY.parse("5 MHz"), Ok(5.0));
        assert_eq!(FREQUENCY.parse("500 kHz"), Ok(0.5));
        assert_eq!(ANGLE.parse("1.2 rad"), Ok(1.2));
        assert_eq!(ANGLE.parse("180 deg"), Ok(std::f64::consts::PI));
        assert_eq!(SPEED.parse("1540 m/s"), Ok(1.54));
        assert_eq!(SPEED.parse("1.54 km/s"), Ok(1.54));
        assert_eq!(DENSITY.parse("1050 kg/m3"), Ok(1.05));
        assert_eq!(ATTENUATION.parse("0.5 dB/cm/MHz"), Ok(0.5));
        assert_eq!(ATTENUATION.parse("0.5 dB/(cm MHz)"), Ok(0.5));
        assert_eq!(ATTENUATION.parse("50 dB/m/MHz"), Ok(0.5));
        assert_eq!(IMPEDANCE.parse("1.65 MRayl"), Ok(1.65));
        assert_eq!(DURATION.parse("800 ms"), Ok(0.8));
        assert_eq!(RATE.parse("30 Hz"), Ok(30.0));
        assert_eq!(LEVEL.parse("-3 dB"), Ok(-3.0));
        assert_eq!(LEVEL.parse("-inf dB"), Ok(f64::NEG_INFINITY));
    }

    #[test]
    fn wrong_units_name_the_right_ones() {
        let wrong = FREQUENCY.parse("5 mm").expect_err("wrong unit");
        assert!(wrong.contains("`mm` does not fit") && wrong.contains("`MHz`, `kHz`"), "{wrong}");
        assert!(LENGTH.parse("60").expect_err("no unit").contains("has no unit"));
        assert!(LENGTH.parse("wide").expect_err("no number").contains("write it like"));
        assert!(LENGTH.parse("").is_err());
    }

    #[test]
    fn plain_numbers_are_in_the_inside_unit_except_angles() {
        let read = |measure: &Measure, text: &str| {
            let value = toml::de::ValueDeserializer::parse(text).expect("TOML");
            measure.deserialize(value).ok()
        };
        assert_eq!((read(&LENGTH, "60"), read(&ANGLE, "0")), (Some(60.0), Some(0.0)));
        assert_eq!((read(&ANGLE, "65"), read(&LENGTH, "nan")), (None, None));
    }
}
