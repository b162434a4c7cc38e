//! The lines of `docs/scenes.md` that follow from the program: a row of a table for each setting, the units, and what
//! `insonify vary` shows. `INSONIFY_BLESS=1 cargo test --test docs` writes them.

use insonify::scene::vary::Parameter;
use insonify::settings::units::MEASURES;
use insonify::settings::{
    Display, Facts, Form, Fusion, Group, Imaging, Live, Probe, Simulation, Surface, Tissue, Value,
};

/// A line of a table: the table's heading, and the cells.
#[derive(Debug, PartialEq)]
pub struct Line {
    pub table: String,
    cells: Vec<String>,
}

impl Line {
    fn new(table: &str, cells: &[&str]) -> Self {
        let cells = cells.iter().map(|cell| (*cell).to_owned()).collect();
        Self { table: table.to_owned(), cells }
    }

    /// The first cell, with its blanks: what finds the line.
    fn start(&self) -> String {
        format!("| {} |", self.cells[0])
    }

    fn text(&self) -> String {
        format!("| {} |", self.cells.join(" | ")).replace("|  |", "| |")
    }
}

/// What the reference calls a form.
fn type_of(form: Form) -> String {
    match form {
        Form::Number => "number".to_owned(),
        Form::Quantity(measure) => measure.name.to_owned(),
        Form::Whole => "integer".to_owned(),
        Form::Switch => "true or false".to_owned(),
        Form::Words(_) => "one of".to_owned(),
        Form::Numbers(count) => format!("{count} numbers"),
        Form::Quantities(measure, count) => format!("{count} {}s", measure.name),
    }
}

fn range_of(facts: &Facts) -> String {
    let unit = match facts.unit() {
        "" => String::new(),
        unit => format!(" {unit}"),
    };
    match (facts.limits, facts.form, facts.range) {
        (Some(words), ..) => words.to_owned(),
        (_, Form::Words(words), _) => {
            let words: Vec<_> = words.iter().map(|word| format!("`\"{word}\"`")).collect();
            words.join(", ")
        }
        (_, Form::Switch, _) => String::new(),
        (.., [least, f64::INFINITY]) => format!("at least {least}{unit}"),
        (.., [least, most]) => format!("{least} to {most}{unit}"),
    }
}

/// The default that a group gives, as the reference writes it.
fn default_of(facts: &Facts, value: Value) -> String {
    let text = facts.text(&value).unwrap_or_default();
    match facts.form {
        Form::Quantity(_) => format!("`{}`", text.trim_matches('"')),
        _ => format!("`{text}`"),
    }
}

/// A line for each setting of a group in the table of this heading. `before` stands before the keys; `default` is that
/// of all; none: what the row says, or the value in `from`.
fn of_group<T: Group>(from: Option<&T>, (before, default): (&str, Option<&str>)) -> Vec<Line> {
    let rows = T::rows().iter();
    let line = |row: &insonify::settings::Row<T>| {
        let facts = &row.facts;
        let value = from.map(|from| default_of(facts, (row.get)(from)));
        let own = facts.default.map(str::to_owned).or(value);
        let default = default.map(str::to_owned).or(own).unwrap_or_default();
        let meaning = match before {
            "" => facts.meaning(),
            _ => "The same, met from within.",
        };
        let key = format!("`{before}{}`", facts.key);
        Line::new(T::TABLE, &[&key, &type_of(facts.form), &default, &range_of(facts), meaning])
    };
    rows.map(line).collect()
}

/// Every line that the program knows, by tables.
pub fn lines() -> Vec<Line> {
    let preset = ("", Some("preset"));
    let plain = ("", None);
    let mut out = of_group::<Probe>(None, preset);
    out.extend(of_group(Some(&Simulation::default()), plain));
    out.extend(of_group(Some(&Imaging::default()), plain));
    out.extend(of_group(Some(&Live::default()), plain));
    out.extend(of_group(Some(&Fusion::default()), plain));
    out.extend(of_group::<Display>(None, plain));
    out.extend(of_group::<Tissue>(None, plain));
    out.extend(of_group::<Surface>(None, plain));
    out.extend(of_group::<Surface>(None, ("inside.", Some("as outside"))));
    out.extend(MEASURES.iter().map(|measure| {
        let units = match measure.note {
            "" => measure.allowed(),
            note => format!("{}; {note}", measure.allowed()),
        };
        Line::new("", &[measure.name, &units])
    }));
    out.extend(Parameter::suggested().map(|parameter| {
        let key = format!("`{}`", parameter.key());
        let path = format!("`{}`", parameter.path());
        Line::new("vary", &[&key, &path, &parameter.suggested_values()])
    }));
    out
}

/// Paths of the keys that have a row.
pub fn keys() -> Vec<String> {
    let lines = lines().into_iter().filter(|line| line.cells.len() == 5);
    lines.map(|line| format!("{}.{}", line.table, line.cells[0].trim_matches('`'))).collect()
}

/// The document with these lines: those that are there are replaced, others stand below the last one that is.
pub fn written(document: &str, lines: &[Line]) -> String {
    let mut out: Vec<String> = document.lines().map(str::to_owned).collect();
    let mut last = None;
    for line in lines {
        let table = heading(&out, &line.table);
        let within = table.clone().filter(|&at| out[at].starts_with(&line.start()));
        match within.last() {
            Some(at) => {
                out[at] = line.text();
                last = Some(at);
            }
            None => {
                // After the line before it, where that is of the same table, else at the table's end.
                let end = table.clone().rev().find(|&at| out[at].starts_with("| "));
                let at = last.filter(|at| table.contains(at)).or(end).expect("a table") + 1;
                out.insert(at, line.text());
                last = Some(at);
            }
        }
    }
    out.join("\n") + "\n"
}

/// Numbers of the lines below the heading of a table; below the heading of units for no name.
fn heading(lines: &[String], table: &str) -> std::ops::Range<usize> {
    let named = match table {
        "" => "## Quantities and units".to_owned(),
        table => format!("`[{table}]`"),
    };
    let is_it = |line: &String| {
        line.starts_with('#') && (line.contains(&named) || line.contains(&format!("`[[{table}]]`")))
    };
    let start = lines.iter().position(is_it).unwrap_or_else(|| panic!("no heading {table}")) + 1;
    let length = lines[start..].iter().position(|line| line.starts_with('#'));
    start..length.map_or(lines.len(), |length| start + length)
}
