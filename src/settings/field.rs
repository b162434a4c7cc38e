//! The types that fields of settings may have, and the reading of their values.

use std::fmt;

use serde::Deserialize;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, SeqAccess, VariantAccess, Visitor,
};

use super::units::Measure;
use super::{Form, Value};

/// A type that a field of settings may have.
pub trait Field {
    /// The field's value.
    fn get(&self) -> Value;
    /// Stores a value of the field's own kind; a value of another kind changes nothing.
    fn set(&mut self, value: &Value);
}

impl Field for f64 {
    fn get(&self) -> Value {
        Value::Number(*self)
    }

    fn set(&mut self, value: &Value) {
        if let Value::Number(number) = value {
            *self = *number;
        }
    }
}

impl Field for u32 {
    fn get(&self) -> Value {
        Value::Whole(*self)
    }

    fn set(&mut self, value: &Value) {
        if let Value::Whole(count) = value {
            *self = *count;
        }
    }
}

impl Field for bool {
    fn get(&self) -> Value {
        Value::Switch(*self)
    }

    fn set(&mut self, value: &Value) {
        if let Value::Switch(on) = value {
            *self = *on;
        }
    }
}

impl<const N: usize> Field for [f64; N] {
    fn get(&self) -> Value {
        Value::List(self.to_vec())
    }

    fn set(&mut self, value: &Value) {
        if let Value::List(list) = value
            && let Ok(all) = list.as_slice().try_into()
        {
            *self = all;
        }
    }
}

impl Field for Option<f64> {
    fn get(&self) -> Value {
        self.map_or(Value::Absent, Value::Number)
    }

    fn set(&mut self, value: &Value) {
        *self = match value {
            Value::Number(number) => Some(*number),
            _ => None,
        };
    }
}

impl<'de> DeserializeSeed<'de> for &Form {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        Ok(match *self {
            Form::Number => Value::Number(f64::deserialize(deserializer)?),
            Form::Quantity(measure) => Value::Number(measure.deserialize(deserializer)?),
            Form::Whole => Value::Whole(u32::deserialize(deserializer)?),
            Form::Switch => Value::Switch(bool::deserialize(deserializer)?),
            Form::Words(words) => {
                Value::Word(deserializer.deserialize_enum("choice", words, OneOf(words))?)
            }
            Form::Numbers(count) => {
                Value::List(deserializer.deserialize_seq(Several { count, measure: None })?)
            }
            Form::Quantities(measure, count) => {
                let measure = Some(measure);
                Value::List(deserializer.deserialize_seq(Several { count, measure })?)
            }
        })
    }
}

/// Reads one of the words.
struct OneOf(&'static [&'static str]);

impl<'de> Visitor<'de> for OneOf {
    type Value = &'static str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one of the words of this key")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<&'static str, E> {
        let known = self.0.iter().find(|word| **word == text);
        known.copied().ok_or_else(|| E::unknown_variant(text, self.0))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, access: A) -> Result<&'static str, A::Error> {
        let (word, rest) = access.variant_seed(Self(self.0))?;
        rest.unit_variant()?;
        Ok(word)
    }
}

impl<'de> DeserializeSeed<'de> for OneOf {
    type Value = &'static str;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'static str, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

/// Reads `count` numbers, or quantities of one measure.
struct Several {
    count: usize,
    measure: Option<&'static Measure>,
}

impl<'de> Visitor<'de> for Several {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an array of length {}", self.count)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        let mut out = Vec::new();
        let mut next = || match self.measure {
            Some(measure) => list.next_element_seed(measure),
            None => list.next_element(),
        };
        while let Some(number) = next()? {
            out.push(number);
            // One number too many is enough for the error.
            if out.len() > self.count {
                break;
            }
        }
        match out.len() == self.count {
            true => Ok(out),
            false => Err(A::Error::invalid_length(out.len(), &self)),
        }
    }
}
