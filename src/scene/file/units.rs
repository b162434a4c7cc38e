//! Quantities of scene files: a number in the unit used inside, or a string with its unit.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, Visitor};

/// What is measured: its units with the factor to the one used inside, first the inside one.
pub trait Dimension {
    /// Noun for messages, with article.
    const WHAT: &'static str;
    /// Units; the first is that of a plain number.
    const UNITS: &'static [(&'static str, f64)];
    /// Whether a plain number is accepted.
    const PLAIN: bool = true;
}

/// A value of dimension `D` in the unit used inside. Never NaN; may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity<D>(pub f64, PhantomData<D>);

impl<D> Quantity<D> {
    /// A value in the unit used inside.
    pub fn new(value: f64) -> Self {
        Self(value, PhantomData)
    }

    /// Nothing, or 0 dB.
    pub fn zero() -> Self {
        Self::new(0.0)
    }
}

macro_rules! dimension {
    ($(#[$doc:meta])* $alias:ident, $tag:ident, $what:literal, $plain:literal, [$($unit:expr),+]) => {
        /// Marker of the dimension.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $tag;

        impl Dimension for $tag {
            const WHAT: &'static str = $what;
            const UNITS: &'static [(&'static str, f64)] = &[$($unit),+];
            const PLAIN: bool = $plain;
        }

        $(#[$doc])*
        pub type $alias = Quantity<$tag>;
    };
}

dimension!(
    /// mm.
    Length, InLength, "a length", true,
    [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("um", 1e-3)]
);
dimension!(
    /// MHz.
    Frequency, InFrequency, "a frequency", true,
    [("MHz", 1.0), ("kHz", 1e-3), ("Hz", 1e-6)]
);
dimension!(
    /// Radians. A plain number is refused: most people would mean degrees.
    Angle, InAngle, "an angle", false,
    [("rad", 1.0), ("deg", std::f64::consts::PI / 180.0)]
);
dimension!(
    /// mm/us.
    Speed, InSpeed, "a speed of sound", true,
    [("mm/us", 1.0), ("m/s", 1e-3), ("km/s", 1.0)]
);
dimension!(
    /// g/cm3.
    Density, InDensity, "a density", true,
    [("g/cm3", 1.0), ("kg/m3", 1e-3), ("g/cm^3", 1.0), ("kg/m^3", 1e-3)]
);
dimension!(
    /// dB/(cm MHz).
    Attenuation, InAttenuation, "an attenuation", true,
    [("dB/cm/MHz", 1.0), ("dB/(cm MHz)", 1.0), ("dB/m/MHz", 1e-2), ("dB/mm/MHz", 10.0)]
);
dimension!(
    /// MRayl.
    Impedance, InImpedance, "an impedance", true,
    [("MRayl", 1.0), ("kg/m2/s", 1e-6), ("Rayl", 1e-6)]
);
dimension!(
    /// s.
    Duration, InDuration, "a duration", true,
    [("s", 1.0), ("ms", 1e-3)]
);
dimension!(
    /// Times per second, Hz.
    Rate, InRate, "a rate", true,
    [("Hz", 1.0)]
);
dimension!(
    /// dB.
    Level, InLevel, "a level", true,
    [("dB", 1.0)]
);

fn allowed<D: Dimension>() -> String {
    let names: Vec<_> = D::UNITS.iter().map(|u| format!("`{}`", u.0)).collect();
    names.join(", ")
}

/// Parses "60 mm"; the message says which units there are.
pub(super) fn parse<D: Dimension>(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let end = (0..=text.len())
        .rev()
        .filter(|&i| text.is_char_boundary(i))
        .find(|&i| text[..i].trim_end().parse::<f64>().is_ok())
        .ok_or_else(|| {
            format!("`{text}` is not {}; write it like \"1.5 {}\"", D::WHAT, D::UNITS[0].0)
        })?;
    let value: f64 = text[..end].trim_end().parse().map_err(|_| "not a number".to_owned())?;
    let compact = |s: &str| s.split_whitespace().collect::<String>();
    let unit = compact(&text[end..]);
    if unit.is_empty() {
        return Err(format!("`{text}` has no unit; {} takes {}", D::WHAT, allowed::<D>()));
    }
    let factor = D::UNITS.iter().find(|u| compact(u.0) == unit);
    let (_, factor) = factor.ok_or_else(|| {
        format!("unit `{unit}` does not fit: {} takes {}", D::WHAT, allowed::<D>())
    })?;
    Ok(value * factor)
}

impl<'de, D: Dimension> Deserialize<'de> for Quantity<D> {
    fn deserialize<R: Deserializer<'de>>(deserializer: R) -> Result<Self, R::Error> {
        struct AsQuantity<D>(PhantomData<D>);

        impl<D: Dimension> AsQuantity<D> {
            fn plain<E: Error>(value: f64) -> Result<Quantity<D>, E> {
                // Zero is zero in every unit.
                if !D::PLAIN && value != 0.0 {
                    return Err(E::custom(format!(
                        "{} needs its unit: {}",
                        D::WHAT,
                        allowed::<D>()
                    )));
                }
                Self::number(value)
            }

            fn number<E: Error>(value: f64) -> Result<Quantity<D>, E> {
                if value.is_nan() {
                    return Err(E::custom(format!("{} cannot be NaN", D::WHAT)));
                }
                Ok(Quantity(value, PhantomData))
            }
        }

        impl<D: Dimension> Visitor<'_> for AsQuantity<D> {
            type Value = Quantity<D>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                let unit = D::UNITS[0].0;
                write!(f, "{}: a number in {unit} or a string like \"1.5 {unit}\"", D::WHAT)
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Self::Value, E> {
                Self::plain(value)
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Self::Value, E> {
                Self::plain(value as f64)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
                Self::number(parse::<D>(text).map_err(E::custom)?)
            }
        }

        deserializer.deserialize_any(AsQuantity(PhantomData))
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
            assert_eq!(parse::<InLength>(text), Ok(value), "{text}");
        }
        assert_eq!(parse::<InFrequency>("5 MHz"), Ok(5.0));
        assert_eq!(parse::<InFrequency>("500 kHz"), Ok(0.5));
        assert_eq!(parse::<InAngle>("1.2 rad"), Ok(1.2));
        assert_eq!(parse::<InAngle>("180 deg"), Ok(std::f64::consts::PI));
        assert_eq!(parse::<InSpeed>("1540 m/s"), Ok(1.54));
        assert_eq!(parse::<InSpeed>("1.54 km/s"), Ok(1.54));
        assert_eq!(parse::<InDensity>("1050 kg/m3"), Ok(1.05));
        assert_eq!(parse::<InAttenuation>("0.5 dB/cm/MHz"), Ok(0.5));
        assert_eq!(parse::<InAttenuation>("0.5 dB/(cm MHz)"), Ok(0.5));
        assert_eq!(parse::<InAttenuation>("50 dB/m/MHz"), Ok(0.5));
        assert_eq!(parse::<InImpedance>("1.65 MRayl"), Ok(1.65));
        assert_eq!(parse::<InDuration>("800 ms"), Ok(0.8));
        assert_eq!(parse::<InRate>("30 Hz"), Ok(30.0));
        assert_eq!(parse::<InLevel>("-3 dB"), Ok(-3.0));
        assert_eq!(parse::<InLevel>("-inf dB"), Ok(f64::NEG_INFINITY));
    }

    #[test]
    fn wrong_units_name_the_right_ones() {
        let wrong = parse::<InFrequency>("5 mm").expect_err("wrong unit");
        assert!(wrong.contains("`mm` does not fit") && wrong.contains("`MHz`, `kHz`"), "{wrong}");
        assert!(parse::<InLength>("60").expect_err("no unit").contains("has no unit"));
        assert!(parse::<InLength>("wide").expect_err("no number").contains("write it like"));
        assert!(parse::<InLength>("").is_err());
    }

    #[test]
    fn plain_numbers_are_in_the_inside_unit_except_angles() {
        #[derive(serde::Deserialize)]
        struct Values {
            length: Length,
            angle: Angle,
        }
        let values: Values = toml::from_str("length = 60\nangle = 0").expect("plain");
        assert_eq!((values.length.0, values.angle.0), (60.0, 0.0));
        assert!(toml::from_str::<Values>("length = 60\nangle = 65").is_err());
        assert!(toml::from_str::<Values>("length = nan\nangle = 0").is_err());
    }
}
