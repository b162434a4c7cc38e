//! The nodes of a scene file, and their parents.

use std::collections::HashMap;

use super::document::Document;
use super::error::SceneError;
use super::table::{Keys, Table};
use crate::settings::{Form, group, suggest};

group! {
    /// Keys of every node.
    pub struct NodeKeys in "group" {
        /// Name in messages, and for `--set`.
        name: String = String::new(), Facts::of(Form::Text).required().limits("not empty, unique");
        /// Group, transform or selector that it belongs to.
        parent: Option<String> = None, Facts::of(Form::Text).by_default("the world");
    }
}

/// A table that is a node.
pub(super) struct Entry<'f> {
    /// Its path: `selector.0`.
    pub path: String,
    pub name: &'f str,
    pub parent: Option<&'f str>,
    pub kind: TableKind,
}

/// Kind, with the number of the table among those of its kind.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum TableKind {
    Group,
    Transform(usize),
    Selector(usize),
    Mesh(usize),
}

/// Tables that are nodes of one kind.
pub(super) fn of_kind<'f, K: Keys>(
    tables: &'f [Table<K>],
    kind: fn(usize) -> TableKind,
) -> impl Iterator<Item = Entry<'f>> {
    tables.iter().enumerate().map(move |(i, Table { stated, .. })| Entry {
        path: format!("{}.{i}", K::TABLE),
        name: stated.text("name").unwrap_or_default(),
        parent: stated.text("parent"),
        kind: kind(i),
    })
}

/// All nodes in the order in which they stand in the file; their names are unique.
pub(super) fn in_order<'f>(
    document: &Document<'_>,
    nodes: impl Iterator<Item = Entry<'f>>,
) -> Result<Vec<Entry<'f>>, SceneError> {
    let mut out: Vec<Entry<'f>> = nodes.collect();
    out.sort_by_key(|e| document.place(&e.path));
    let kind = |e: &Entry| e.path.split('.').next().unwrap_or_default().to_owned();
    let mut names = HashMap::new();
    for (e, entry) in out.iter().enumerate() {
        if entry.name.trim().is_empty() {
            let remedy = "say what it is; messages and `--set` use the name";
            let message = format!("a {} needs a name", kind(entry));
            return Err(document.fail(&format!("{}.name", entry.path), message, remedy));
        }
        if let Some(other) = names.insert(entry.name, e) {
            let other: &Entry = &out[other];
            return Err(document.fail(
                &format!("{}.name", entry.path),
                format!("a {} is already named `{}`", kind(other), entry.name),
                "give each node its own name",
            ));
        }
    }
    Ok(out)
}

/// For each entry the entry that it names as its parent.
pub(super) fn parents(
    document: &Document<'_>,
    entries: &[Entry<'_>],
) -> Result<Vec<Option<usize>>, SceneError> {
    let by_name: HashMap<_, _> = entries.iter().zip(0..).map(|(e, i)| (e.name, i)).collect();
    let holds = |e: &Entry| !matches!(e.kind, TableKind::Mesh(_));
    let find = |entry: &Entry, parent: &str| {
        let at = format!("{}.parent", entry.path);
        match by_name.get(parent) {
            Some(&p) if holds(&entries[p]) => Ok(p),
            Some(_) => Err(document.fail(
                &at,
                format!("`{parent}` is a mesh, and meshes have no children"),
                "name a group, a transform or a selector",
            )),
            None => {
                let names = entries.iter().filter(|e| holds(e)).map(|e| e.name);
                let remedy = suggest::among(parent, names);
                Err(document.fail(&at, format!("there is no node `{parent}`"), remedy))
            }
        }
    };
    let one = |entry: &Entry| entry.parent.map(|parent| find(entry, parent)).transpose();
    entries.iter().map(one).collect()
}

/// Most nodes above each other. Anatomy needs ten, skeletons some more.
const DEEPEST: usize = 100;

/// For each entry the number of its ancestors.
pub(super) fn depths(
    document: &Document<'_>,
    entries: &[Entry<'_>],
    parents: &[Option<usize>],
) -> Result<Vec<usize>, SceneError> {
    let mut depths: Vec<Option<usize>> = vec![None; entries.len()];
    for start in 0..entries.len() {
        // First up to an entry whose depth is known, then down again.
        let mut chain = Vec::new();
        let mut at = Some(start);
        while let Some(e) = at.filter(|&e| depths[e].is_none()) {
            // More steps than there are nodes mean a cycle.
            if chain.len() == entries.len() {
                let by = parents[e].expect("it was come by");
                let by = match by == e {
                    true => String::new(),
                    false => format!(" by way of `{}`", entries[by].name),
                };
                return Err(document.fail(
                    &format!("{}.parent", entries[e].path),
                    format!("`{}` is its own ancestor{by}", entries[e].name),
                    "leave out `parent` of one of them",
                ));
            }
            chain.push(e);
            at = parents[e];
        }
        let first = at.and_then(|e| depths[e]).map_or(0, |d| d + 1);
        for (e, depth) in chain.into_iter().rev().zip(first..) {
            depths[e] = Some(depth);
        }
    }
    let depths: Vec<_> = depths.into_iter().map(|d| d.expect("all visited")).collect();
    match depths.iter().position(|&depth| depth > DEEPEST) {
        Some(e) => Err(document.fail(
            &format!("{}.parent", entries[e].path),
            format!("`{}` has more than {DEEPEST} nodes above it", entries[e].name),
            "leave out groups and transforms on the way that do nothing",
        )),
        None => Ok(depths),
    }
}
