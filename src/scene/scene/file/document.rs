//! The text of a scene file with its overrides, and the place of each value in it.

mod paths;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{SceneError, advice};
use crate::scene::mesh::Mesh;
use crate::scene::shipped;
use crate::settings::{Facts, Value};
pub use paths::LISTS;
pub use paths::Misfit;
pub(super) use paths::element;
pub use paths::quoted;
pub(crate) use paths::segments;
use paths::{find, insert};

/// Largest scene file, bytes: they hold names and numbers, not meshes.
const MAX_TEXT: u64 = 4 << 20;

/// The name that stands in place of a file's where a setting is at fault that a command line, a client, the window or a program
/// has put in.
const OVERRIDE: &str = "setting";

/// Most parts of a path to a value; the longest key of a scene file has six. What is nested deeper than the stack allows
/// would end the program, whoever sent it.
const MAX_PARTS: usize = 16;

/// The text of a scene file and of the overrides.
#[derive(Clone)]
pub struct Source {
    /// The file; messages name it.
    pub path: PathBuf,
    text: String,
    /// The page that describes it.
    manual: &'static str,
    overrides: Vec<Override>,
    /// Meshes that are in no file, by name.
    pub given: BTreeMap<String, Arc<Mesh>>,
}

/// One `path = value` of the command line or of a study. Its spans count from `start`, after the file's text.
#[derive(Clone)]
struct Override {
    path: String,
    /// The path's parts.
    segments: Vec<String>,
    shown: String,
    /// `v = value` after as many blanks as give its spans this numbering.
    padded: String,
    start: usize,
}

/// The parsed file with the overrides in place.
pub struct Document<'s> {
    /// What it was parsed from.
    pub source: &'s Source,
    root: DeTable<'s>,
}

impl Source {
    /// Reads the file and stores the overrides.
    pub fn read(path: &Path, overrides: &[(String, String)]) -> Result<Self, SceneError> {
        let fail = |cause: String, remedy| SceneError::file(path, cause, remedy);
        let check =
            format!("check the path of the scene file; scenes that ship: {}", shipped::names());
        let check = check.as_str();
        let unreadable = |e: std::io::Error| fail(format!("cannot be read: {e}"), check);
        let info = std::fs::metadata(path).map_err(unreadable)?;
        if info.is_dir() {
            return Err(fail("is a folder".to_owned(), "name a scene file (.toml) in it"));
        }
        if !info.is_file() {
            return Err(fail("is a pipe or a device, not a file".to_owned(), check));
        }
        if info.len() > MAX_TEXT {
            let cause =
                format!("is {} MB; a scene file may have {}", info.len() >> 20, MAX_TEXT >> 20);
            let remedy = "name a scene file (.toml); meshes and volumes lie in files of their own";
            return Err(fail(cause, remedy));
        }
        let bytes = std::fs::read(path).map_err(unreadable)?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let at = e.utf8_error().valid_up_to();
            let line = e.as_bytes()[..at].iter().filter(|&&b| b == b'\n').count() + 1;
            let utf16 = matches!(e.as_bytes(), [0xff, 0xfe, ..] | [0xfe, 0xff, ..]);
            let kind = if utf16 { "is text in UTF-16" } else { "is not text in UTF-8" };
            fail(format!("{kind}: line {line}, byte {at}"), "save it as UTF-8 in a text editor")
        })?;
        Ok(Self::of(path, text).with(overrides))
    }

    /// The same with more overrides.
    pub fn with(&self, overrides: &[(String, String)]) -> Self {
        let mut all = self.overrides.clone();
        let last = all.last().map(|o| o.start + o.shown.len());
        let mut start = last.unwrap_or(self.text.len()) + 1;
        for (path, value) in overrides {
            // A value that is not TOML is a string: shells remove the quotes of "80 mm".
            let written = match DeValue::parse(value) {
                Ok(_) => value.clone(),
                Err(_) => format!("{value:?}"),
            };
            let shown = format!("{path} = {written}");
            let blanks = " ".repeat(start + path.len() - 1);
            let end = start + shown.len();
            all.push(Override {
                path: path.clone(),
                segments: segments(path),
                shown,
                padded: format!("{blanks}v = {written}"),
                start,
            });
            start = end + 1;
        }
        Self { overrides: all, ..self.clone() }
    }

    /// A text that is to become the file `path`; no overrides.
    pub fn of(path: &Path, text: String) -> Self {
        let manual = "docs/scenes.md";
        Self { path: path.to_owned(), text, manual, overrides: Vec::new(), given: BTreeMap::new() }
    }

    /// The same for a file that another page describes.
    pub fn described_in(self, manual: &'static str) -> Self {
        Self { manual, ..self }
    }

    /// The file's text, without the overrides.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Parses the text and puts the overrides in.
    pub fn document(&self) -> Result<Document<'_>, SceneError> {
        let root = self.table(&self.text)?;
        let mut document = Document { source: self, root };
        for set in &self.overrides {
            let value = self.table(&set.padded)?.into_iter().next();
            let value = value.expect("the text has one key").1;
            let key = set.start..set.start + set.path.len();
            if set.segments.len() > MAX_PARTS {
                let begin: String = set.path.chars().take(24).collect();
                let message = format!(
                    "`{begin}...` has {} parts; the path of a setting has at most {MAX_PARTS}",
                    set.segments.len()
                );
                let remedy = "write it as docs/scenes.md does, like `imaging.gain`";
                return Err(SceneError::file(Path::new(OVERRIDE), message, remedy));
            }
            let segments: Vec<&str> = set.segments.iter().map(String::as_str).collect();
            insert(&mut document.root, &segments, value, &key)
                .map_err(|(message, remedy)| self.error(key, message, Some(remedy)))?;
        }
        Ok(document)
    }

    fn table<'s>(&self, text: &'s str) -> Result<DeTable<'s>, SceneError> {
        let table = DeTable::parse(text).map_err(|e| {
            let span = e.span().unwrap_or(0..0);
            // The parser takes any bare word for a number that is wrong.
            let word = text.get(span.start..).unwrap_or_default();
            let len = word.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(word.len());
            let (message, remedy) = match &word[..len] {
                word if e.message().starts_with("invalid float") && !word.is_empty() => (
                    format!("`{word}` is no value"),
                    Some(
                        "put text in quotes; leave the key out where nothing is to be set"
                            .to_owned(),
                    ),
                ),
                _ => (e.message().to_owned(), None),
            };
            self.error(span, message, remedy)
        })?;
        Ok(table.into_inner())
    }

    /// The override in which a span lies, and its place in what that shows; none of a span in the file.
    fn in_override(&self, span: &Range<usize>) -> Option<(&Override, Range<usize>)> {
        let set = self.overrides.iter().rev().find(|o| span.start >= o.start)?;
        let local = |at: usize| at.saturating_sub(set.start).min(set.shown.len());
        Some((set, local(span.start)..local(span.end)))
    }

    fn text_at(&self, span: Range<usize>) -> Option<&str> {
        match self.in_override(&span) {
            Some((set, span)) => set.shown.get(span),
            None => self.text.get(span),
        }
    }

    fn error(&self, span: Range<usize>, message: String, remedy: Option<String>) -> SceneError {
        match self.in_override(&span) {
            Some((set, span)) => {
                SceneError::at(Path::new(OVERRIDE), &set.shown, span, message, remedy)
            }
            None => SceneError::at(&self.path, &self.text, span, message, remedy),
        }
    }
}

impl Document<'_> {
    /// The file as `T` understands it.
    pub fn parse_as<T: DeserializeOwned>(&self) -> Result<T, SceneError> {
        let root = Spanned::new(0..self.source.text.len(), self.root.clone());
        let deserializer = toml::de::Deserializer::from(root);
        let mut track = serde_path_to_error::Track::new();
        let tracked = serde_path_to_error::Deserializer::new(deserializer, &mut track);
        // With dynamic dispatch each table is compiled once; with generics three times, a quarter of the library.
        let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(tracked);
        let read = erased_serde::deserialize(&mut erased);
        drop(erased);
        read.map_err(|e| {
            let path: Vec<_> = track.path().iter().map(segment).collect();
            let names: Vec<_> = path.iter().map(String::as_str).collect();
            // Dynamic dispatch keeps an error's message in its first line and appends lines about its origin.
            let message = e.to_string();
            let message = message.lines().next().unwrap_or_default();
            let span = match message.starts_with("unknown field") {
                true => self.key_span(&names),
                false => self.span(&names),
            };
            let advice = advice(message, self.source.manual);
            let brief = match advice {
                Some(_) => message.split(", expected").next().unwrap_or(message),
                None => message,
            };
            let message = format!("{}{brief}", self.readable(&names));
            self.source.error(span, message, advice)
        })
    }

    /// "mesh 3 (`liver`).thickness: " for a path; a number alone is hard to find in a file.
    fn readable(&self, path: &[&str]) -> String {
        let mut out = String::new();
        for (n, part) in path.iter().enumerate() {
            match part.parse::<usize>() {
                Ok(index) => {
                    out.push_str(&format!(" {}", index + 1));
                    let named = [&path[..=n], &["name"]].concat();
                    let name = find(&self.root, &named).and_then(|v| v.get_ref().as_str());
                    out.extend(name.map(|name| format!(" (`{name}`)")));
                }
                Err(_) if n == 0 => out.push_str(part),
                Err(_) => {
                    out.push('.');
                    out.push_str(part);
                }
            }
        }
        if !out.is_empty() {
            out.push_str(": ");
        }
        out
    }

    /// An error at the value of a dotted path, or at its nearest parent that is in the file.
    pub fn fail(
        &self,
        path: &str,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> SceneError {
        self.source.error(self.span_of(path), message.into(), Some(remedy.into()))
    }

    /// Fails at the value of a dotted path, whose key has these facts, if `value` is out of its range.
    pub fn within(&self, path: &str, facts: &Facts, value: &Value) -> Result<(), SceneError> {
        match facts.fault(value) {
            Some((message, remedy)) => Err(self.fail(path, message, remedy)),
            None => Ok(()),
        }
    }

    /// The value at a dotted path, as TOML writes it.
    pub fn stated(&self, path: &str) -> Option<String> {
        let segments = segments(path);
        let value = find(&self.root, &segments.iter().map(String::as_str).collect::<Vec<_>>())?;
        self.source.text_at(value.span()).map(str::to_owned)
    }

    /// True if the top-level `table` has a key other than `but`.
    pub fn says_of(&self, table: &str, but: &str) -> bool {
        let table = self.root.get(table).and_then(|v| v.get_ref().as_table());
        table.is_some_and(|t| t.keys().any(|key| key.get_ref() != but))
    }

    /// The name under which the file has the table `vary`: it was called `sweep`.
    pub fn vary(&self) -> &'static str {
        match self.root.contains_key("sweep") {
            true => "sweep",
            false => "vary",
        }
    }

    /// The offset, in bytes, of the value of a dotted path or of its nearest parent: for the order of tables.
    pub fn place(&self, path: &str) -> usize {
        self.span_of(path).start
    }

    fn span_of(&self, path: &str) -> Range<usize> {
        let segments = segments(path);
        self.span(&segments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// The span of the key of a path, bytes.
    fn key_span(&self, path: &[&str]) -> Range<usize> {
        let Some((last, above)) = path.split_last() else { return 0..0 };
        let table = match above {
            [] => Some(&self.root),
            above => find(&self.root, above).and_then(|value| value.get_ref().as_table()),
        };
        let key = table.and_then(|table| table.get_key_value(*last));
        key.map_or_else(|| self.span(path), |(key, _)| key.span())
    }

    fn span(&self, path: &[&str]) -> Range<usize> {
        (1..=path.len())
            .rev()
            .find_map(|n| find(&self.root, &path[..n]))
            .map_or(0..0, Spanned::span)
    }
}

fn segment(segment: &serde_path_to_error::Segment) -> String {
    use serde_path_to_error::Segment;
    match segment {
        Segment::Seq { index } => index.to_string(),
        Segment::Map { key } => key.clone(),
        Segment::Enum { variant } => variant.clone(),
        Segment::Unknown => "?".to_owned(),
    }
}
