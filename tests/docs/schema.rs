//! The program's messages about the keys of a scene file.

use std::collections::BTreeMap;

use insonify::scene::SceneError;

use crate::load;

/// A key unlike any existing one: the program then lists all of them.
const NO_KEY: &str = "zzzzzzzzzzzzzzzzzzzzzzzzzzzzzzzz";

/// Kind of a key's values, in the words of the program.
#[derive(Debug, PartialEq)]
pub enum Takes {
    Choices(Vec<String>),
    Value(String),
}

/// The names that the program offers instead of an unknown one. For the keys of a shape they are in the
/// message, for all others in the remedy.
fn listed(error: &SceneError) -> Vec<String> {
    if let Some((_, keys)) = error.message.split_once("available keys: ") {
        return keys.split(", ").map(str::to_owned).collect();
    }
    let remedy = error.remedy.as_deref().unwrap_or_default();
    let names = remedy.split('`').skip(1).step_by(2);
    names.map(str::to_owned).collect()
}

/// Finds all keys of the table between `open` and `close`, and of the tables in it.
pub fn explore(open: &str, close: &str, path: &str, found: &mut BTreeMap<String, Takes>) {
    let ask =
        |inner: &str| load(&format!("{open}{inner}{close}"), &[]).map(|_| ()).expect_err(inner);
    let unknown = |error: &SceneError| {
        let field = format!("unknown field `{NO_KEY}`");
        let key = format!("unexpected keys in table: {NO_KEY}");
        error.message.contains(&field) || error.message.contains(&key)
    };
    let all = ask(&format!("{NO_KEY} = 1"));
    assert!(unknown(&all), "{path}: {all}");
    for name in listed(&all) {
        let here = match path {
            "" => name.clone(),
            _ => format!("{path}.{name}"),
        };
        let forms = [
            ("{ ", " }", here.clone()),
            ("[{ ", " }]", here.clone()),
            ("{ own = { ", " } }", format!("{here}.NAME")),
        ];
        let replies: Vec<_> =
            forms.iter().map(|(a, b, _)| ask(&format!("{name} = {a}{NO_KEY} = 1{b}"))).collect();
        if let Some(i) = replies.iter().position(unknown) {
            let (a, b, path) = &forms[i];
            let open = format!("{open}{name} = {a}");
            explore(&open, &format!("{b}{close}"), path, found);
        } else if replies[0].message.contains("unknown variant") {
            let choices = listed(&replies[0]);
            let table = |choice: &String| {
                unknown(&ask(&format!("{name} = {{ {choice} = {{ {NO_KEY} = 1 }} }}")))
            };
            if !choices.iter().all(table) {
                found.insert(here, Takes::Choices(choices));
                continue;
            }
            for choice in choices {
                let open = format!("{open}{name} = {{ {choice} = {{ ");
                let close = format!(" }} }}{close}");
                explore(&open, &close, &format!("{here}.{choice}"), found);
            }
        } else {
            let wanted = |error: &SceneError| {
                let (_, wanted) = error.message.split_once("expected ").unwrap_or_default();
                wanted.split(':').next().unwrap_or_default().to_owned()
            };
            let whole = wanted(&replies[0]);
            let value = match (whole.as_str(), whole.strip_prefix("an array of length ")) {
                ("a sequence", _) => format!("list of x {}", wanted(&replies[1])),
                (_, Some(count)) => format!("{count} x {}", wanted(&replies[1])),
                _ => whole,
            };
            found.insert(here, Takes::Value(value));
        }
    }
}

/// The document's word for the program's `wanted`.
pub fn type_name(wanted: &str) -> String {
    let (count, one) = wanted.split_once(" x ").unwrap_or(("", wanted));
    let name = match one {
        "a string" => "text",
        "u32" | "i32" => "integer",
        "f64" => "number",
        "a boolean" => "true or false",
        "a speed of sound" => "speed",
        quantity => quantity.trim_start_matches("an ").trim_start_matches("a "),
    };
    match (count, name.strip_suffix('y')) {
        ("", _) => name.to_owned(),
        (_, Some(stem)) => format!("{count} {stem}ies"),
        (_, None) => format!("{count} {name}s"),
    }
}
