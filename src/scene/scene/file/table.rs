//! Tables of scene files, read by the rows of their keys.

use std::collections::BTreeSet;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};

use super::document::Document;
use super::error::SceneError;
use crate::settings::{Facts, Form, Group, Row, Value};

/// A setting to be written: its path, as [`crate::scene::Scene::load`] takes it, and its value, or none if
/// the key is to be removed. Names with dots are quoted, as in TOML: `mesh."a.b".roughness`. A `pose` is added under a
/// name that the file does not have, and removed as a whole.
pub type Entry = (String, Option<String>);

/// Contents of a table of scene files.
pub trait Keys: 'static {
    /// The table, as the reference writes it: `tissues.NAME`.
    const TABLE: &'static str;

    /// All keys.
    fn keys() -> Vec<Key>;
}

/// A key of a table.
pub struct Key {
    /// Its place in the table, with those of the tables in between: `inside.roughness`.
    pub path: String,
    /// All facts about it.
    pub facts: &'static Facts,
    /// The form of its values.
    pub form: Form,
    /// Its default, as the reference writes it.
    pub default: String,
    /// That as a value; none where there is none, or not always the same one.
    pub usual: Option<Value>,
}

/// The keys of a group whose defaults are not always the same, in the table `below` of theirs; `default` says what
/// they are, where their rows do not.
pub(super) fn keys<T: Group>(
    below: &'static str,
    default: &'static str,
) -> impl Iterator<Item = Key> {
    T::rows().iter().map(move |Row { facts, .. }| Key {
        path: format!("{below}{}", facts.key),
        facts,
        form: facts.form,
        default: match default {
            "" => facts.default.unwrap_or_default().to_owned(),
            words => words.to_owned(),
        },
        usual: None,
    })
}

/// The keys of a group with defaults, like [`keys`].
pub(super) fn defaults<T: Group + Default>(below: &'static str) -> impl Iterator<Item = Key> {
    let own = T::default();
    keys::<T>(below, "").zip(T::rows()).map(move |(key, Row { facts, get, .. })| {
        let value = get(&own);
        let default = match (facts.default, &value) {
            (None, Value::Text(text)) => format!("`{text}`"),
            (None, value) => {
                let text = facts.text(value).map(|text| match facts.form {
                    Form::Quantity(_) => format!("`{}`", text.trim_matches('"')),
                    _ => format!("`{text}`"),
                });
                text.unwrap_or_default()
            }
            (Some(words), _) => words.to_owned(),
        };
        Key { default, usual: facts.default.is_none().then_some(value), ..key }
    })
}

/// A table with the keys of `K`.
pub struct Table<K> {
    /// The values that it states.
    pub stated: Stated,
    of: PhantomData<K>,
}

/// Values of the keys that a table states.
#[derive(Debug, Default)]
pub struct Stated {
    /// Each with its key's place in the table, in the order of the file.
    values: Vec<(String, Value)>,
    /// The tables in it.
    tables: BTreeSet<String>,
}

impl<K> Default for Table<K> {
    fn default() -> Self {
        Self { stated: Stated::default(), of: PhantomData }
    }
}

impl<K> fmt::Debug for Table<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.stated.fmt(f)
    }
}

impl<K: Keys> Table<K> {
    /// Fails at the first value out of its range; `path` is the table's.
    pub fn check(&self, document: &Document<'_>, path: &str) -> Result<(), SceneError> {
        for key in K::keys() {
            if let Some(value) = self.stated.value(&key.path) {
                document.within(&format!("{path}.{}", key.path), key.facts, value)?;
            }
        }
        Ok(())
    }
}

impl Stated {
    /// The value of a key; none if the table does not state it.
    pub fn value(&self, key: &str) -> Option<&Value> {
        self.values.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }

    /// The keys that the table states, in its order.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.values.iter().map(|(key, _)| key.as_str())
    }

    /// Returns whether the table has the key, or a table of this name.
    pub fn has(&self, key: &str) -> bool {
        self.value(key).is_some() || self.tables.contains(key)
    }

    /// The number at a key; none if the table does not state it.
    pub fn number(&self, key: &str) -> Option<f64> {
        match self.value(key) {
            Some(Value::Number(number)) => Some(*number),
            _ => None,
        }
    }

    /// The text at a key; none if the table does not state it.
    pub fn text(&self, key: &str) -> Option<&str> {
        match self.value(key) {
            Some(Value::Text(text)) => Some(text),
            _ => None,
        }
    }

    /// Writes the settings that the table `below` states into `out`.
    pub fn put<T: Group>(&self, below: &str, out: &mut T) {
        for row in T::rows() {
            if let Some(value) = self.value(&format!("{below}{}", row.facts.key)) {
                (row.set)(out, value);
            }
        }
    }

    /// The settings that the table `below` states, and defaults of the others.
    pub fn get<T: Group + Default>(&self, below: &str) -> T {
        let mut out = T::default();
        self.put(below, &mut out);
        out
    }
}

impl<'de, K: Keys> Deserialize<'de> for Table<K> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut table = Self::default();
        let below = String::new();
        let reader = Reader { keys: &K::keys(), below, stated: &mut table.stated };
        reader.deserialize(deserializer)?;
        Ok(table)
    }
}

/// Reader of a table, or of the table in it whose keys begin with `below`.
struct Reader<'r> {
    keys: &'r [Key],
    below: String,
    stated: &'r mut Stated,
}

impl<'r> Reader<'r> {
    /// The keys from here on.
    fn here(&self) -> impl Iterator<Item = (&'r str, &'r Key)> {
        let keys = self.keys;
        let below = self.below.clone();
        keys.iter().filter_map(move |key| Some((key.path.strip_prefix(&below)?, key)))
    }

    /// Names of keys and tables.
    fn names(&self) -> Vec<&'r str> {
        let names = self.here().map(|(path, _)| path.split('.').next().unwrap_or(path));
        let mut seen = BTreeSet::new();
        names.filter(|name| seen.insert(*name)).collect()
    }
}

impl<'de> Visitor<'de> for Reader<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(name) = map.next_key_seed(Name(&self.names()))? {
            let path = format!("{}{name}", self.below);
            match self.keys.iter().find(|key| key.path == path) {
                Some(key) => {
                    let value = map.next_value_seed(&key.form)?;
                    self.stated.values.push((path, value));
                }
                None => {
                    let below = format!("{path}.");
                    let inner = Reader { keys: self.keys, below, stated: &mut *self.stated };
                    map.next_value_seed(inner)?;
                    self.stated.tables.insert(path);
                }
            }
        }
        let lacks = |(name, key): &(&str, &Key)| {
            key.facts.required && !name.contains('.') && self.stated.value(&key.path).is_none()
        };
        match self.here().find(lacks) {
            Some((name, _)) => Err(A::Error::custom(format!("missing field `{name}`"))),
            None => Ok(()),
        }
    }
}

impl<'de> DeserializeSeed<'de> for Reader<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

/// Reader of a key, which must be one of these names.
struct Name<'n>(&'n [&'n str]);

impl<'n> Visitor<'_> for Name<'n> {
    type Value = &'n str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<&'n str, E> {
        let known = self.0.iter().find(|name| **name == text);
        known.copied().ok_or_else(|| unknown(text, self.0.iter()))
    }
}

impl<'de, 'n> DeserializeSeed<'de> for Name<'n> {
    type Value = &'n str;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'n str, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

/// The error for a key that is none of `all`, in the words of derived readers.
pub(super) fn unknown<E: Error>(key: &str, all: impl Iterator<Item = impl fmt::Display>) -> E {
    let all: Vec<_> = all.map(|name| format!("`{name}`")).collect();
    E::custom(format!("unknown field `{key}`, expected one of {}", all.join(", ")))
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
    differing(entries(from, path), entries(to, path))
}

/// Those of `to` that are not as in `from`, which has the same keys in the same order.
pub fn differing(from: Vec<Entry>, to: Vec<Entry>) -> Vec<Entry> {
    let pairs = from.into_iter().zip(to);
    pairs.filter(|(from, to)| from != to).map(|(_, entry)| entry).collect()
}
