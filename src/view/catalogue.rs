//! What the reference of scene files says of each key: unit, range, choices, meaning. The tests hold
//! that document to the program, so that the console cannot tell anything else.

use std::collections::HashMap;
use std::sync::LazyLock;

const REFERENCE: &str = include_str!("../../docs/scenes.md");

/// One key.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Unit of the value as the program holds it; empty without one.
    pub unit: String,
    /// Least and largest value that a scene file may give.
    pub range: [f64; 2],
    /// The words that it takes, if it takes words.
    pub choices: Vec<String>,
    /// What it is.
    pub meaning: String,
}

/// The entry of a key with its tables, as `--set` takes it: `probe.depth`, `tissues.NAME.speed`.
///
/// # Panics
/// A key that scene files do not have.
pub fn entry(key: &str) -> &'static Entry {
    let found = ENTRIES.get(key);
    found.unwrap_or_else(|| panic!("docs/scenes.md has no key {key}"))
}

static ENTRIES: LazyLock<HashMap<String, Entry>> = LazyLock::new(|| read(REFERENCE));

/// All keys, in no order.
#[cfg(test)]
pub(super) fn keys() -> impl Iterator<Item = &'static str> {
    ENTRIES.keys().map(String::as_str)
}

fn read(document: &str) -> HashMap<String, Entry> {
    let (mut table, mut units, mut out) = ("", HashMap::new(), HashMap::new());
    for line in document.lines() {
        if line.starts_with('#') {
            table = line.split('`').nth(1).unwrap_or("").trim_matches(['[', ']']);
        }
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        match *cells.as_slice() {
            [kind, list] => {
                if let Some(first) = list.split('`').nth(1) {
                    units.insert(kind.to_owned(), first.to_owned());
                }
            }
            [key, kind, _, range, meaning] if key.starts_with('`') => {
                let key = key.trim_matches('`');
                let key = match table {
                    "" => key.to_owned(),
                    table => format!("{table}.{key}"),
                };
                out.insert(key, describe(&units, kind, range, meaning));
            }
            _ => {}
        }
    }
    out
}

fn describe(units: &HashMap<String, String>, kind: &str, range: &str, meaning: &str) -> Entry {
    let words = range.split_whitespace().collect::<Vec<_>>();
    let number = |i: usize| words.get(i).and_then(|w| w.parse::<f64>().ok());
    let limits = match (words.first(), number(0), number(2)) {
        (Some(&"at"), _, Some(least)) => [least, f64::INFINITY],
        (_, Some(least), Some(most)) => [least, most],
        _ => [f64::NEG_INFINITY, f64::INFINITY],
    };
    // Of several quantities the reference gives the plural: "8 levels".
    let singular = kind.trim_start_matches(|c: char| c.is_ascii_digit() || c == ' ');
    let unit = (units.get(singular)).or_else(|| units.get(singular.trim_end_matches('s'))).cloned();
    let plain = words.get(3).filter(|_| kind == "integer" && number(2).is_some());
    let choices = range.split('"').skip(1).step_by(2).map(str::to_owned);
    Entry {
        unit: unit.or(plain.map(|w| (*w).to_owned())).unwrap_or_default(),
        range: limits,
        choices: choices.collect(),
        meaning: meaning.replace('`', ""),
    }
}

#[cfg(test)]
mod tests {
    use super::entry;

    #[test]
    fn keys_have_unit_range_and_meaning() {
        let depth = entry("probe.depth");
        assert_eq!((depth.unit.as_str(), depth.range), ("mm", [1.0, 1000.0]));
        assert_eq!(depth.meaning, "Depth of the image.");
        assert_eq!(entry("probe.aperture").range, [0.1, f64::INFINITY]);
        assert_eq!(entry("imaging.noise").range, [f64::NEG_INFINITY, 200.0]);
        let sliders = entry("imaging.tgc_sliders");
        assert_eq!((sliders.unit.as_str(), sliders.range), ("dB", [-100.0, 100.0]));
        assert_eq!(entry("imaging.image_height").unit, "pixels");
        assert_eq!(entry("simulation.paths").unit, "");
        assert_eq!(entry("simulation.sequence").choices, ["sobol", "random"]);
        let speed = entry("tissues.NAME.speed");
        assert_eq!((speed.unit.as_str(), speed.range), ("mm/us", [0.1, 10.0]));
    }

    #[test]
    #[should_panic(expected = "no key probe.deepness")]
    fn a_key_that_does_not_exist_is_noticed() {
        entry("probe.deepness");
    }
}
