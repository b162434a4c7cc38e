//! Checks the JSON of a glTF file against the specification before anything is built from it.
//!
//! Faults where geometry is described stop the loading; elsewhere they are warnings.

use std::path::Path;

use serde_json::{Map, Value};

use super::schema::{ROOT, Table, ValueKind};
use crate::issue::{Issue, Severity};
use crate::settings::suggest;

mod rules;

/// Top-level lists that the geometry depends on.
const GEOMETRY: [&str; 7] =
    ["asset", "accessors", "bufferViews", "buffers", "meshes", "nodes", "scenes"];

/// Top-level lists that motion depends on besides.
const MOTION: [&str; 2] = ["animations", "skins"];

/// Findings that are printed one by one; the rest are counted.
const SHOWN: usize = 8;

/// One fault, at a JSON pointer.
pub(super) struct Finding {
    pub pointer: String,
    pub message: String,
    pub severity: Severity,
    pub remedy: &'static str,
}

/// Remedy for files that break the rules.
pub(super) const EXPORT_AGAIN: &str = "export it again";

/// All findings on a file.
pub(super) struct Findings<'a> {
    root: &'a Map<String, Value>,
    /// True if animations are read, too.
    animated: bool,
    list: Vec<Finding>,
    /// True where no other fault means anything.
    ended: bool,
}

/// Checks types, ranges and references of every property, then the rules between them. `animated`:
/// whether animations and skins are read, so that faults there stop the loading, too.
pub(super) fn validate(root: &Map<String, Value>, animated: bool) -> Vec<Finding> {
    let mut findings = Findings { root, animated, list: Vec::new(), ended: false };
    findings.object(root, ROOT, "");
    rules::check(&mut findings);
    findings.list
}

/// Findings as issues: each of the first few, then their number.
pub(super) fn issues(path: &Path, mut findings: Vec<Finding>) -> Vec<Issue> {
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    let mut out: Vec<Issue> = findings
        .iter()
        .take(SHOWN)
        .map(|f| {
            let make = match f.severity {
                Severity::Error => Issue::error,
                Severity::Warning => Issue::warning,
            };
            make(path, 1, f.message.as_str(), f.remedy).of(&f.pointer)
        })
        .collect();
    let more = findings.len().saturating_sub(SHOWN);
    if more > 0 {
        out.push(Issue::warning(path, more, format!("{more} further faults against glTF 2.0"), ""));
    }
    out
}

impl<'a> Findings<'a> {
    /// A fault that stops loading where the geometry depends on it.
    pub fn fault(&mut self, pointer: &str, message: impl Into<String>) {
        let top = pointer.split('/').nth(1).unwrap_or_default();
        let moves = self.animated && MOTION.contains(&top);
        let severity = match GEOMETRY.contains(&top) || moves || pointer == "/scene" {
            true => Severity::Error,
            false => Severity::Warning,
        };
        self.add(pointer, message.into(), severity);
    }

    /// A fault that leaves the geometry as it is.
    pub fn remark(&mut self, pointer: &str, message: impl Into<String>) {
        self.add(pointer, message.into(), Severity::Warning);
    }

    /// No fault, but worth knowing.
    pub fn note(&mut self, pointer: &str, message: impl Into<String>) {
        self.add(pointer, message.into(), Severity::Warning);
        if let Some(last) = self.list.last_mut() {
            last.remedy = "";
        }
    }

    /// Drops all faults but the last, of which this is the remedy.
    pub fn only_last(&mut self, remedy: &'static str) {
        self.list.drain(..self.list.len().saturating_sub(1));
        if let Some(last) = self.list.last_mut() {
            last.remedy = remedy;
        }
        self.ended = true;
    }

    fn add(&mut self, pointer: &str, message: String, severity: Severity) {
        if self.ended {
            return;
        }
        self.list.push(Finding {
            pointer: pointer.to_owned(),
            message,
            severity,
            remedy: EXPORT_AGAIN,
        });
    }

    fn object(&mut self, object: &'a Map<String, Value>, table: &Table, at: &str) {
        for (name, required, kind) in table {
            match object.get(*name) {
                Some(value) => self.value(value, kind, &format!("{at}/{name}")),
                None if *required => self.fault(&format!("{at}/{name}"), "is missing"),
                None => {}
            }
        }
        for (name, value) in object {
            let here = format!("{at}/{name}");
            match name.as_str() {
                "extras" => {}
                "extensions" => self.extensions(value, &here),
                _ if table.iter().any(|p| p.0 == name) => {}
                _ => {
                    let near = suggest::nearest(name, table.iter().map(|p| p.0));
                    let hint =
                        near.map_or(String::new(), |n| format!("; did its author mean `{n}`?"));
                    self.remark(&here, format!("is not a property of glTF 2.0{hint}"));
                }
            }
        }
    }

    fn extensions(&mut self, value: &Value, at: &str) {
        let Some(extensions) = value.as_object() else {
            return self.fault(at, "is not an object");
        };
        let used = self.root.get("extensionsUsed").and_then(Value::as_array);
        for name in extensions.keys() {
            let declared = used.is_some_and(|u| u.iter().any(|v| v.as_str() == Some(name)));
            if !declared {
                self.remark(&format!("{at}/{name}"), "is not declared in extensionsUsed");
            }
        }
        if extensions.is_empty() {
            self.remark(at, "is empty");
        }
    }

    fn value(&mut self, value: &'a Value, kind: &ValueKind, at: &str) {
        match kind {
            ValueKind::Bool => self.require(value.is_boolean(), at, "is not true or false"),
            ValueKind::Text => self.require(value.is_string(), at, "is not a string"),
            ValueKind::Uri => match value.as_str() {
                Some(uri) => self.require(is_uri(uri), at, "is not a valid URI"),
                None => self.fault(at, "is not a string"),
            },
            ValueKind::Int(least, most) => match integer(value) {
                Some(i) if (*least..=*most).contains(&i) => {}
                Some(i) => self.fault(at, format!("is {i}, out of range")),
                None => self.fault(at, "is not an integer"),
            },
            ValueKind::Num(least, most) => match value.as_f64() {
                Some(v) if (*least..=*most).contains(&v) => {}
                Some(v) => self.fault(at, format!("is {v}, out of range")),
                None => self.fault(at, "is not a number"),
            },
            ValueKind::IntIn(allowed) => match integer(value) {
                Some(i) if allowed.contains(&i) => {}
                _ => self.fault(at, format!("is {value}, not one of {allowed:?}")),
            },
            ValueKind::TextIn(allowed) => match value.as_str() {
                Some(text) if allowed.contains(&text) => {}
                _ => self.fault(at, format!("is {value}, not one of {allowed:?}")),
            },
            ValueKind::Id(list) => {
                let held = self.root.get(*list).and_then(Value::as_array).map_or(0, Vec::len);
                match integer(value) {
                    Some(i) if (0..held as i64).contains(&i) => {}
                    Some(i) => self
                        .fault(at, format!("names {list}[{i}], which does not exist ({held} do)")),
                    None => self.fault(at, "is not an index"),
                }
            }
            ValueKind::Object(table) => match value.as_object() {
                Some(object) => self.object(object, table, at),
                None => self.fault(at, "is not an object"),
            },
            ValueKind::List(of, least, most, distinct) => {
                self.list(value, of, *least, *most, *distinct, at)
            }
            ValueKind::Map(of) => match value.as_object() {
                Some(map) => {
                    if map.is_empty() {
                        self.remark(at, "is empty");
                    }
                    for (name, value) in map {
                        self.value(value, of, &format!("{at}/{name}"));
                    }
                }
                None => self.fault(at, "is not an object"),
            },
        }
    }

    fn list(
        &mut self,
        value: &'a Value,
        of: &ValueKind,
        least: usize,
        most: usize,
        distinct: bool,
        at: &str,
    ) {
        let Some(list) = value.as_array() else {
            return self.fault(at, "is not a list");
        };
        if list.is_empty() {
            // Tolerable: an empty list describes nothing, as does none.
            self.remark(at, "is empty");
        } else if !(least..=most).contains(&list.len()) {
            self.fault(at, format!("has {} elements, out of range", list.len()));
        }
        for (i, element) in list.iter().enumerate() {
            self.value(element, of, &format!("{at}/{i}"));
        }
        if distinct && (1..list.len()).any(|i| list[..i.min(1000)].contains(&list[i])) {
            self.fault(at, "names the same thing twice");
        }
    }

    fn require(&mut self, holds: bool, at: &str, message: &str) {
        if !holds {
            self.fault(at, message);
        }
    }
}

/// Integers may be written as `1.0` (specification 2.7, JSON encoding).
pub(super) fn integer(value: &Value) -> Option<i64> {
    value.as_i64().or_else(|| {
        let v = value.as_f64()?;
        // 2^53: past it a double no longer tells integers apart.
        (v.fract() == 0.0 && v.abs() < 9e15).then_some(v as i64)
    })
}

/// Characters of RFC 3986 and complete percent escapes; other letters pass as IRIs.
fn is_uri(uri: &str) -> bool {
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    let sound_scheme = scheme.is_none_or(|s| {
        s.starts_with(|c: char| c.is_ascii_alphabetic())
            && s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    let bytes = uri.as_bytes();
    let escapes = bytes.iter().enumerate().filter(|(_, b)| **b == b'%').all(|(i, _)| {
        let two = bytes.get(i + 1..i + 3);
        two.is_some_and(|hex| hex.iter().all(u8::is_ascii_hexdigit))
    });
    let legal = |c: char| !c.is_control() && !"\"<>\\^`{|}".contains(c);
    sound_scheme && escapes && uri.chars().all(legal) && !uri.starts_with("//:")
}
