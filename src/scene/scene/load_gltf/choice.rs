//! The choice of an animation of a file.

use std::path::Path;

use serde_json::{Map, Value};

use crate::issue::Issue;
use crate::scene::mesh::Choice;
use crate::settings::suggest;

/// An animation of a file.
pub(super) struct Chosen {
    pub number: usize,
    pub name: String,
    /// Names of the others.
    others: Vec<String>,
}

/// Names of all animations of a file.
pub(super) fn names(root: &Map<String, Value>) -> Vec<String> {
    let animations = root.get("animations").and_then(Value::as_array);
    let names = animations.into_iter().flatten().enumerate().map(|(i, a)| {
        let name = a.get("name").and_then(Value::as_str);
        name.map_or_else(|| format!("animation {i}"), str::to_owned)
    });
    names.collect()
}

impl Chosen {
    /// The chosen animation. Those without a name are called `animation N`, counted from 0.
    pub fn of(path: &Path, root: &Map<String, Value>, choice: Choice<'_>) -> Result<Self, Issue> {
        let mut names = names(root);
        if names.is_empty() {
            return Err(Issue::error(
                path,
                1,
                "has no animation",
                "load it as a mesh without animation, or export it with one",
            ));
        }
        let number = match choice {
            Choice::First => 0,
            Choice::Number(number) if number < names.len() => number,
            Choice::Number(number) => {
                let cause = format!("has no animation {number}");
                let remedy = format!("count from 0; it has {}", names.len());
                return Err(Issue::error(path, 1, cause, remedy));
            }
            Choice::Named(name) => names.iter().position(|n| n == name).ok_or_else(|| {
                let remedy = suggest::among(name, names.iter().map(String::as_str));
                Issue::error(path, 1, format!("has no animation `{name}`"), remedy)
            })?,
        };
        Ok(Self { number, name: names.remove(number), others: names })
    }

    /// Message for an animation that moves no chosen part.
    pub fn moves_nothing(&self, path: &Path, node: Option<&str>) -> Issue {
        let what = match node {
            Some(node) => format!("no mesh of node `{node}`"),
            None => "no mesh".to_owned(),
        };
        let remedy = match self.others.as_slice() {
            [] => "load it as a mesh without animation".to_owned(),
            others => {
                let others: Vec<_> = others.iter().map(|n| format!("`{n}`")).collect();
                format!("choose one of {}", others.join(", "))
            }
        };
        Issue::error(path, 1, format!("animation `{}` moves {what}", self.name), remedy)
    }
}
