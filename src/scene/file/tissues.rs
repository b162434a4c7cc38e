//! The table `tissues`, and names of tissues everywhere else.

use std::collections::BTreeMap;

use super::document::Document;
use super::error::SceneError;
use super::schema::TissueTable;
use super::within;
use crate::scene::tissue::table;
use crate::scene::{Issue, Tissue, suggest};

/// Impedance stated beside speed and density may differ from their product by this fraction:
/// tables round to two digits. More, and refraction and reflection would contradict each other.
const IMPEDANCE_TOLERANCE: f64 = 0.02;

/// Tissues that a scene may name, and those that it has named.
pub(super) struct Tissues<'a> {
    document: &'a Document<'a>,
    own: Vec<Tissue>,
    used: Vec<Tissue>,
}

impl<'a> Tissues<'a> {
    pub fn new(
        document: &'a Document<'a>,
        tables: &BTreeMap<String, TissueTable>,
    ) -> Result<Self, SceneError> {
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

/// Names of the tissues from which `name` takes what it does not say, the nearest first.
pub(super) fn bases(tables: &BTreeMap<String, TissueTable>, name: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut at = name;
    while let Some(base) = tables.get(at).and_then(|table| table.based_on.as_deref())
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
    tables: &BTreeMap<String, TissueTable>,
    name: &str,
    chain: &mut Vec<String>,
) -> Result<Tissue, SceneError> {
    let table = &tables[name];
    let path = format!("tissues.{name}");
    let based_on = format!("{path}.based_on");
    chain.push(name.to_owned());
    let base = match table.based_on.as_deref() {
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
        Some(base) => Some(Tissue::shipped(base).ok_or_else(|| {
            unknown(document, &based_on, base, tables.keys().map(String::as_str))
        })?),
        None => Tissue::shipped(name),
    };
    let tissue = overlay(document, table, base, &path, name)?;
    validate(document, &tissue, &path)?;
    if let Some(stated) = table.impedance {
        let product = tissue.impedance();
        let off = (stated.0 - product).abs() / stated.0;
        // Written so that a zero or infinite impedance fails as well.
        if !matches!(off.partial_cmp(&IMPEDANCE_TOLERANCE), Some(std::cmp::Ordering::Less)) {
            return Err(document.fail(
                &format!("{path}.impedance"),
                format!(
                    "impedance {} MRayl differs from density times speed, {product:.4} MRayl, by {:.1} %",
                    stated.0,
                    off * 100.0
                ),
                "correct speed or density, or leave impedance out (it is derived); 2 % are allowed",
            ));
        }
    }
    Ok(tissue)
}

fn overlay(
    document: &Document<'_>,
    table: &TissueTable,
    base: Option<Tissue>,
    path: &str,
    name: &str,
) -> Result<Tissue, SceneError> {
    let need = |key: &str, given: Option<f64>, base: Option<f64>| {
        given.or(base).ok_or_else(|| {
            let message = format!("tissue `{name}` has no {key}");
            document.fail(path, message, format!("add `{key}` or `based_on`"))
        })
    };
    let b = base.as_ref();
    let tissue = Tissue {
        name: name.to_owned(),
        speed: need("speed", table.speed.map(|q| q.0), b.map(|t| t.speed))?,
        density: need("density", table.density.map(|q| q.0), b.map(|t| t.density))?,
        attenuation: need("attenuation", table.attenuation.map(|q| q.0), b.map(|t| t.attenuation))?,
        echogenicity: need(
            "echogenicity",
            table.echogenicity.map(|q| q.0),
            b.map(|t| t.echogenicity),
        )?,
        ..base.unwrap_or_else(|| Tissue {
            source: "scene file".to_owned(),
            texture_depth: 0.0,
            ..Tissue::shipped("liver").expect("the reference tissue is shipped")
        })
    };
    let source = match &table.source {
        Some(source) => source.clone(),
        None => match tissue.source.as_str() {
            "scene file" => tissue.source.clone(),
            inherited => format!("changed by the scene file; before that\n{inherited}"),
        },
    };
    Ok(Tissue {
        density_of_scatterers: table.density_of_scatterers.unwrap_or(tissue.density_of_scatterers),
        mean_over_sigma: table.mean_over_sigma.unwrap_or(tissue.mean_over_sigma),
        texture_depth: table.texture_depth.unwrap_or(tissue.texture_depth),
        texture_length: table.texture_length.map_or(tissue.texture_length, |q| q.0),
        source,
        ..tissue
    })
}

fn validate(document: &Document<'_>, t: &Tissue, path: &str) -> Result<(), SceneError> {
    for (key, value, (least, most), unit) in [
        ("speed", t.speed, (0.1, 10.0), "mm/us"),
        ("density", t.density, (1e-4, 25.0), "g/cm3"),
        ("attenuation", t.attenuation, (0.0, 1000.0), "dB/(cm MHz)"),
        ("echogenicity", t.echogenicity, (f64::NEG_INFINITY, 60.0), "dB"),
        ("density_of_scatterers", t.density_of_scatterers, (0.0, 1.0), ""),
        ("mean_over_sigma", t.mean_over_sigma, (-100.0, 100.0), ""),
        ("texture_depth", t.texture_depth, (0.0, 0.5), ""),
        ("texture_length", t.texture_length, (0.01, 1000.0), "mm"),
    ] {
        within(document, &format!("{path}.{key}"), value, least, most, unit)?;
    }
    Ok(())
}
