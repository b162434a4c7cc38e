//! Tables of settings, read by their rows.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::StrDeserializer;
use serde::de::{DeserializeSeed, Deserializer, Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, forward_to_deserialize_any};

use super::document::Document;
use super::error::SceneError;
use super::save::Entry;
use crate::settings::{Group, Row, Value};

/// A table of a scene file: its settings and its other keys.
#[derive(Debug)]
pub struct Table<T: Group, X = Nothing> {
    /// The settings that it states.
    pub stated: Stated<T>,
    /// Its other keys.
    pub other: X,
}

/// No other keys.
#[derive(Debug, Default, Deserialize)]
pub struct Nothing {}

/// Values of the settings that a table states.
pub struct Stated<T: Group> {
    /// For each row the value; none if the table does not state it.
    values: Vec<Option<Value>>,
    of: PhantomData<T>,
}

impl<T: Group> Default for Stated<T> {
    fn default() -> Self {
        Self { values: vec![None; T::rows().len()], of: PhantomData }
    }
}

impl<T: Group, X: Default> Default for Table<T, X> {
    fn default() -> Self {
        Self { stated: Stated::default(), other: X::default() }
    }
}

impl<T: Group> fmt::Debug for Stated<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stated = T::rows().iter().zip(&self.values);
        f.debug_map().entries(stated.map(|(row, value)| (row.facts.key, value))).finish()
    }
}

impl<T: Group> Stated<T> {
    /// The value of a key; none where the table does not say it.
    pub fn value(&self, key: &str) -> Option<&Value> {
        let at = T::rows().iter().position(|row| row.facts.key == key)?;
        self.values[at].as_ref()
    }

    /// The number at a key; none where the table does not say it.
    pub fn number(&self, key: &str) -> Option<f64> {
        match self.value(key) {
            Some(Value::Number(number)) => Some(*number),
            _ => None,
        }
    }

    /// Writes the settings that the table at `path` states into `out`.
    ///
    /// # Errors
    /// The first value out of its range.
    pub fn put(&self, document: &Document<'_>, path: &str, out: &mut T) -> Result<(), SceneError> {
        for (row, value) in T::rows().iter().zip(&self.values) {
            let Some(value) = value else { continue };
            if let Some((message, remedy)) = row.facts.fault(value) {
                return Err(document.fail(&format!("{path}.{}", row.facts.key), message, remedy));
            }
            (row.set)(out, value);
        }
        Ok(())
    }
}

impl<'de, T: Group, X: Deserialize<'de>> Deserialize<'de> for Table<T, X> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AsTable<T, X>(PhantomData<(T, X)>);

        impl<'de, T: Group, X: Deserialize<'de>> Visitor<'de> for AsTable<T, X> {
            type Value = Table<T, X>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let mut stated = Stated::default();
                let other = X::deserialize(Others { map, stated: &mut stated, fields: &[] })?;
                Ok(Table { stated, other })
            }
        }

        deserializer.deserialize_map(AsTable(PhantomData))
    }
}

/// Reader of a table's other keys; the settings that it meets on the way are stored in `stated`.
struct Others<'s, A, T: Group> {
    map: A,
    stated: &'s mut Stated<T>,
    /// The other keys.
    fields: &'static [&'static str],
}

impl<'de, A: MapAccess<'de>, T: Group> Deserializer<'de> for Others<'_, A, T> {
    type Error = A::Error;

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, A::Error> {
        visitor.visit_map(Self { fields, ..self })
    }

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, A::Error> {
        visitor.visit_map(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

impl<'de, A: MapAccess<'de>, T: Group> MapAccess<'de> for Others<'_, A, T> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        loop {
            let known = Known::<T> { fields: self.fields, of: PhantomData };
            match self.map.next_key_seed(known)? {
                None => return Ok(None),
                Some(Name::Row(at)) => {
                    let value = self.map.next_value_seed(&T::rows()[at].facts.form)?;
                    self.stated.values[at] = Some(value);
                }
                Some(Name::Other(name)) => {
                    let name: StrDeserializer<'_, A::Error> = name.into_deserializer();
                    return seed.deserialize(name).map(Some);
                }
            }
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        self.map.next_value_seed(seed)
    }
}

/// A key of a table.
enum Name {
    /// The setting of this row.
    Row(usize),
    Other(&'static str),
}

/// Reads a key, which must be one of the rows of `T` or of `fields`.
struct Known<T> {
    fields: &'static [&'static str],
    of: PhantomData<T>,
}

impl<T: Group> Visitor<'_> for Known<T> {
    type Value = Name;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Name, E> {
        let rows = T::rows();
        if let Some(at) = rows.iter().position(|row| row.facts.key == text) {
            return Ok(Name::Row(at));
        }
        if let Some(name) = self.fields.iter().find(|name| **name == text) {
            return Ok(Name::Other(name));
        }
        let all = self.fields.iter().copied().chain(rows.iter().map(|row| row.facts.key));
        let all: Vec<_> = all.map(|name| format!("`{name}`")).collect();
        let all = all.join(", ");
        Err(E::custom(format!("unknown field `{text}`, expected one of {all}")))
    }
}

impl<'de, T: Group> DeserializeSeed<'de> for Known<T> {
    type Value = Name;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Name, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

/// Every setting of a group as an entry of the table at `path`.
pub fn entries<T: Group>(settings: &T, path: &str) -> Vec<Entry> {
    let rows = T::rows().iter();
    let entry =
        |row: &Row<T>| (format!("{path}.{}", row.facts.key), row.facts.text(&(row.get)(settings)));
    rows.map(entry).collect()
}

/// The entries by which the table at `path`, which gives `from` now, gives `to`.
pub fn changes<T: Group>(from: &T, to: &T, path: &str) -> Vec<Entry> {
    let pairs = entries(from, path).into_iter().zip(entries(to, path));
    pairs.filter(|(from, to)| from != to).map(|(_, entry)| entry).collect()
}
