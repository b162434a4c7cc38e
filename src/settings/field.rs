//! The types that fields of settings may have, and the reading of their values.

use std::fmt;

use serde::Deserialize;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, SeqAccess, Unexpected, VariantAccess, Visitor,
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

    /// One number stands for all of them.
    fn set(&mut self, value: &Value) {
        match value {
            Value::Number(number) => *self = [*number; N],
            Value::List(list) => {
                if let Ok(all) = list.as_slice().try_into() {
                    *self = all;
                }
            }
            _ => {}
        }
    }
}

impl Field for i32 {
    fn get(&self) -> Value {
        Value::Number(f64::from(*self))
    }

    fn set(&mut self, value: &Value) {
        if let Value::Number(number) = value {
            *self = *number as i32;
        }
    }
}

impl Field for &'static str {
    fn get(&self) -> Value {
        Value::Word(self)
    }

    fn set(&mut self, value: &Value) {
        if let Value::Word(word) = value {
            *self = word;
        }
    }
}

impl Field for String {
    fn get(&self) -> Value {
        Value::Text(self.clone())
    }

    fn set(&mut self, value: &Value) {
        if let Value::Text(text) = value {
            self.clone_from(text);
        }
    }
}

impl Field for Vec<String> {
    fn get(&self) -> Value {
        Value::Texts(self.clone())
    }

    fn set(&mut self, value: &Value) {
        match value {
            Value::Texts(texts) => self.clone_from(texts),
            Value::Text(text) => *self = vec![text.clone()],
            _ => {}
        }
    }
}

impl<T: Field + Default> Field for Option<T> {
    fn get(&self) -> Value {
        self.as_ref().map_or(Value::Absent, T::get)
    }

    fn set(&mut self, value: &Value) {
        *self = (*value != Value::Absent).then(|| {
            let mut out = T::default();
            out.set(value);
            out
        });
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
            Form::Direction => {
                let three = Several { count: 3, measure: None };
                Value::List(deserializer.deserialize_seq(three)?)
            }
            Form::Integer => Value::Number(f64::from(i32::deserialize(deserializer)?)),
            Form::Text => Value::Text(String::deserialize(deserializer)?),
            Form::Texts => Value::Texts(Vec::deserialize(deserializer)?),
            Form::Factors => deserializer
                .deserialize_any(Either("a number or 3 numbers: along x, y and z", *self))?,
            Form::OneOrSeveral => {
                deserializer.deserialize_any(Either("text or list of texts", *self))?
            }
            Form::TextOrTrue => deserializer.deserialize_any(Either("text or true", *self))?,
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

/// Reader of a form of several kinds, with the words for what it expects.
struct Either(&'static str, Form);

impl<'de> Visitor<'de> for Either {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_f64<E: Error>(self, factor: f64) -> Result<Value, E> {
        match self.1 {
            Form::Factors => Ok(Value::Number(factor)),
            _ => Err(E::invalid_type(Unexpected::Float(factor), &self)),
        }
    }

    fn visit_i64<E: Error>(self, factor: i64) -> Result<Value, E> {
        match self.1 {
            Form::Factors => Ok(Value::Number(factor as f64)),
            _ => Err(E::invalid_type(Unexpected::Signed(factor), &self)),
        }
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Value, E> {
        match self.1 {
            Form::Factors => Err(E::invalid_type(Unexpected::Str(text), &self)),
            _ => Ok(Value::Text(text.to_owned())),
        }
    }

    fn visit_bool<E: Error>(self, yes: bool) -> Result<Value, E> {
        match (self.1, yes) {
            (Form::TextOrTrue, true) => Ok(Value::Switch(true)),
            (Form::TextOrTrue, false) => Err(E::custom("leave it out where there is none")),
            _ => Err(E::invalid_type(Unexpected::Bool(yes), &self)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Value, A::Error> {
        match self.1 {
            Form::Factors => Several { count: 3, measure: None }.visit_seq(list).map(Value::List),
            Form::OneOrSeveral => {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(Value::Texts)
            }
            _ => Err(A::Error::invalid_type(Unexpected::Seq, &self)),
        }
    }
}

/// Takes so many numbers, or quantities of one measure.
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
