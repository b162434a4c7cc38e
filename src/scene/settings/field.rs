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

/// Fields that hold what a value of one kind holds.
macro_rules! fields {
    ($($type:ty as $kind:ident),+) => {
        $(impl Field for $type {
            fn get(&self) -> Value {
                Value::$kind(self.clone())
            }

            fn set(&mut self, value: &Value) {
                if let Value::$kind(own) = value {
                    self.clone_from(own);
                }
            }
        })+
    };
}

fields!(
    f64 as Number,
    u32 as Whole,
    bool as Switch,
    &'static str as Word,
    String as Text,
    Vec<f64> as List
);

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
            Form::Several(form) => Value::List(deserializer.deserialize_seq(Each(form))?),
            Form::Integer => Value::Number(f64::from(i32::deserialize(deserializer)?)),
            Form::Text => Value::Text(String::deserialize(deserializer)?),
            Form::Texts => Value::Texts(Vec::deserialize(deserializer)?),
            Form::Factors | Form::OneOrSeveral | Form::TextOrTrue => {
                let given = toml::Value::deserialize(deserializer)?;
                self.either(&given).map_err(D::Error::custom)?
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

/// Reader of any count of values of a form.
struct Each(&'static Form);

impl<'de> Visitor<'de> for Each {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        let mut out = Vec::new();
        while let Some(value) = list.next_element_seed(self.0)? {
            out.extend(match value {
                Value::Number(number) => Some(number),
                _ => None,
            });
        }
        Ok(out)
    }
}

impl Form {
    /// The value of a form of several kinds; or what it takes, if `given` is nothing of that.
    fn either(&self, given: &toml::Value) -> Result<Value, String> {
        let number = |v: &toml::Value| v.as_float().or(v.as_integer().map(|whole| whole as f64));
        let text = |v: &toml::Value| v.as_str().map(str::to_owned);
        let list = given.as_array();
        let (value, takes) = match self {
            Self::Factors => {
                let three = list.filter(|list| list.len() == 3);
                let three = three.and_then(|list| list.iter().map(number).collect());
                let value = number(given).map(Value::Number).or(three.map(Value::List));
                (value, "a number or 3 numbers: along x, y and z")
            }
            Self::OneOrSeveral => {
                let several = list.and_then(|list| list.iter().map(text).collect());
                (
                    text(given).map(Value::Text).or(several.map(Value::Texts)),
                    "text or list of texts",
                )
            }
            _ => {
                let yes = given.as_bool().filter(|yes| *yes);
                (text(given).map(Value::Text).or(yes.map(Value::Switch)), "text or true")
            }
        };
        value.ok_or_else(|| format!("invalid {} {given}, expected {takes}", given.type_str()))
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
