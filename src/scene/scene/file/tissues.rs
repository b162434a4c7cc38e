//! The table `tissues`, and names of tissues everywhere else.

use std::collections::BTreeMap;

use super::document::{Document, quoted};
use super::error::SceneError;
use super::table::Table;
use crate::scene::tissue::table;
use crate::scene::{Issue, Tissue};
use crate::settings::units::IMPEDANCE;
use crate::settings::{Form, Group, group, suggest};

type Tables = BTreeMap<String, Table<Tissue>>;

group! {
    /// Keys of a tissue beside its acoustics.
    pub struct TissueKeys in "tissues.NAME" {
        /// Shipped tissue, or another one of this file.
        based_on: Option<String> = None, Facts::of(Form::Text).by_default("itself, if shipped");
        /// Only checked: a stated value that contradicts the product is an error.
        impedance: Option<f64> = None,
            Facts::of(Form::Quantity(&IMPEDANCE)).by_default("density times speed").limits("within 2 % of it");
        /// Origin of the numbers.
        source: Option<String> = None, Facts::of(Form::Text).by_default("base, marked as changed");
    }
}

/// Largest relative difference between a stated impedance and the product of speed and density:
/// tables round to two digits. With a larger one refraction and reflection would contradict each other.
const IMPEDANCE_TOLERANCE: f64 = 0.02;

/// Tissues that a scene may name, and those that it has named.
pub(super) struct Tissues<'a> {
    document: &'a Document<'a>,
    own: Vec<Tissue>,
    used: Vec<Tissue>,
}

impl<'a> Tissues<'a> {
    pub fn new(document: &'a Document<'a>, tables: &Tables) -> Result<Self, SceneError> {
        let mut own: Vec<Tissue> = Vec::new();
        for name in tables.keys() {
            let mut chain = Vec::new();
            let tissue = resolve(document, tables, name, &mut chain)?;
            own.push(tissue);
        }
        Ok(Self { document, own, used: Vec::new() })
    }

    /// Index in the scene's table of the tissue that is named at `path`.
    pub fn index(&mut self, path: &str, name: &str) -> Result<usize, SceneError> {
        if let Some(index) = self.used.iter().position(|t| t.name == name) {
            return Ok(index);
        }
        let own = self.own.iter().find(|t| t.name == name).cloned();
        let tissue = own.or_else(|| Tissue::shipped(name)).ok_or_else(|| {
            unknown(self.document, path, name, self.own.iter().map(|t| t.name.as_str()))
        })?;
        self.used.push(tissue);
        Ok(self.used.len() - 1)
    }

    /// The tissue at an index that [`Tissues::index`] gave.
    pub fn get(&self, index: usize) -> &Tissue {
        &self.used[index]
    }

    /// Warnings about tissues that the file defines and never names.
    pub fn unused(&self) -> Vec<Issue> {
        let idle = |t: &&Tissue| self.used.iter().all(|u| u.name != t.name);
        let file = &self.document.source.path;
        self.own
            .iter()
            .filter(idle)
            .map(|t| {
                let message = format!("tissue `{}` is defined and not used", t.name);
                Issue::warning(file, 1, message, "name it in a mesh or remove it")
            })
            .collect()
    }

    pub fn used(self) -> Vec<Tissue> {
        self.used
    }
}

fn unknown<'n>(
    document: &Document<'_>,
    path: &str,
    name: &str,
    own: impl Iterator<Item = &'n str> + Clone,
) -> SceneError {
    let remedy = suggest::among(name, own.chain(table::names().map(|n| -> &'n str { n })));
    document.fail(path, format!("unknown tissue `{name}`"), remedy)
}

/// Names of the tissues from which `name` takes the values that it does not state, the nearest first.
pub(super) fn bases(tables: &Tables, name: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut at = name;
    while let Some(base) = tables.get(at).and_then(|table| table.stated.text("based_on"))
        && base != at
    {
        out.push(base.to_owned());
        at = base;
    }
    out
}

/// The tissue `name` of the file, over what it is based on: another one of the file, a shipped
/// one, or the shipped one of its own name.
fn resolve(
    document: &Document<'_>,
    tables: &Tables,
    name: &str,
    chain: &mut Vec<String>,
) -> Result<Tissue, SceneError> {
    let table = &tables[name];
    let path = format!("tissues.{}", quoted(name));
    let based_on = format!("{path}.based_on");
    chain.push(name.to_owned());
    let base = match table.stated.text("based_on") {
        Some(base) if base != name && chain.iter().any(|c| c == base) => {
            return Err(document.fail(
                &based_on,
                format!("`{name}` is based on itself by way of `{base}`"),
                "base one of them on a shipped tissue",
            ));
        }
        Some(base) if base != name && tables.contains_key(base) => {
            Some(resolve(document, tables, base, chain)?)
        }
        Some(base) => Some(Tissue::shipped(base).ok_or_else(|| match base == name {
            true => document.fail(
                &based_on,
                format!("`{name}` is based on itself, and no shipped tissue has this name"),
                "base it on another tissue, or give all its values and leave `based_on` out",
            ),
            false => unknown(document, &based_on, base, tables.keys().map(String::as_str)),
        })?),
        None => Tissue::shipped(name),
    };
    let tissue = over(document, table, base, &path, name)?;
    if let Some(stated) = table.stated.number("impedance") {
        let product = tissue.impedance();
        let off = (stated - product).abs() / stated;
        // Written so that a zero or infinite impedance fails as well.
        if !matches!(off.partial_cmp(&IMPEDANCE_TOLERANCE), Some(std::cmp::Ordering::Less)) {
            return Err(document.fail(
                &format!("{path}.impedance"),
                format!(
                    "impedance {} MRayl differs from density times speed, {product:.4} MRayl, by {:.1} %",
                    stated,
                    off * 100.0
                ),
                "correct speed or density, or leave impedance out (it is derived); 2 % are allowed",
            ));
        }
    }
    Ok(tissue)
}

/// The tissue `base` with the values that `table` states.
fn over(
    document: &Document<'_>,
    table: &Table<Tissue>,
    base: Option<Tissue>,
    path: &str,
    name: &str,
) -> Result<Tissue, SceneError> {
    if base.is_none() {
        let required = Tissue::rows().iter().map(|row| &row.facts);
        let required = required.filter(|facts| facts.default == Some("required"));
        for key in required.map(|facts| facts.key) {
            if table.stated.value(key).is_none() {
                let message = format!("tissue `{name}` has no {key}");
                return Err(document.fail(path, message, format!("add `{key}` or `based_on`")));
            }
        }
    }
    let mut out = base.unwrap_or_else(|| Tissue {
        source: "scene file".to_owned(),
        texture_depth: 0.0,
        ..Tissue::shipped("liver").expect("the reference tissue is shipped")
    });
    out.name = name.to_owned();
    table.stated.put("", &mut out);
    out.source = match table.stated.text("source") {
        Some(source) => source.to_owned(),
        None => match out.source.as_str() {
            "scene file" => out.source,
            inherited => format!("changed by the scene file; before that\n{inherited}"),
        },
    };
    Ok(out)
}
