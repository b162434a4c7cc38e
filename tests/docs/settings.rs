//! The text lines of `docs/scenes.md` that follow from the program: a row of a table for each setting, the units, and
//! the parameters of `insonify vary`. `INSONIFY_BLESS=1 cargo test --test docs` writes them.

use insonify::scene::tissue::table;
use insonify::scene::vary::Parameter;
use insonify::settings::units::MEASURES;
use insonify::settings::{
    Display, Facts, Form, Fusion, Group, Imaging, Live, Probe, Simulation, Surface, Tissue, Value,
    plain,
};

/// A line of a table: the section's heading, the first word of the table's head, and the cells.
#[derive(Debug, PartialEq)]
pub struct Line {
    section: &'static str,
    head: &'static str,
    cells: Vec<String>,
}

impl Line {
    fn new(section: &'static str, head: &'static str, cells: &[&str]) -> Self {
        let cells = cells.iter().map(|cell| (*cell).to_owned()).collect();
        Self { section, head, cells }
    }

    /// The first cell with its blanks, by which the line is found.
    fn start(&self) -> String {
        format!("| {} |", self.cells[0])
    }

    fn text(&self) -> String {
        let cell =
            |cell: &String| if cell.is_empty() { " |".to_owned() } else { format!(" {cell} |") };
        format!("|{}", self.cells.iter().map(cell).collect::<String>())
    }
}

/// The reference's word for a form.
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

/// The default of a group's setting, in the reference's form.
fn default_of(facts: &Facts, value: Value) -> String {
    let text = facts.text(&value).unwrap_or_default();
    match facts.form {
        Form::Quantity(_) => format!("`{}`", text.trim_matches('"')),
        _ => format!("`{text}`"),
    }
}

/// A text line for each setting of a group in the table of this heading. `before` stands before the keys; `default` is
/// the default of all; none: the row's own, or the value in `from`.
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
        let cells = [&key, &type_of(facts.form), &default, &range_of(facts), meaning];
        Line::new(T::TABLE, "Key", &cells)
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
        Line::new("", "Type", &[measure.name, &units])
    }));
    out.extend(Parameter::suggested().map(|parameter| {
        let key = format!("`{}`", parameter.key());
        let path = format!("`{}`", parameter.path());
        Line::new("vary", "Parameter", &[&key, &path, &parameter.suggested_values()])
    }));
    out.extend(presets());
    out.extend(table::shipped().iter().map(tissue));
    out
}

/// The values of the presets of probes.
fn presets() -> impl Iterator<Item = Line> {
    Probe::rows().iter().map(|row| {
        let key = format!("`{}`", row.facts.key);
        let values = Probe::PRESETS.map(|(_, make)| {
            let text = row.facts.text(&(row.get)(&make()));
            text.unwrap_or_default().trim_matches('"').to_owned()
        });
        let values = values.iter().map(String::as_str);
        let cells: Vec<_> = [key.as_str()].into_iter().chain(values).collect();
        Line::new(Probe::TABLE, "Preset value", &cells)
    })
}

/// The line of a shipped tissue.
fn tissue(tissue: &Tissue) -> Line {
    let name = format!("`{}`", tissue.name);
    let surface = tissue.surface;
    let values = [
        tissue.speed,
        tissue.density,
        tissue.attenuation,
        tissue.echogenicity,
        tissue.density_of_scatterers,
        tissue.texture_depth,
        tissue.texture_length,
        surface.roughness,
        surface.thickness,
        surface.specularity,
    ];
    let values = values.map(plain);
    let values = values.iter().map(String::as_str);
    let cells: Vec<_> = [name.as_str()].into_iter().chain(values).collect();
    Line::new(Tissue::TABLE, "Tissue", &cells)
}

/// Paths of the keys that have a row.
pub fn keys() -> Vec<String> {
    let lines = lines().into_iter().filter(|line| line.head == "Key");
    lines.map(|line| format!("{}.{}", line.section, line.cells[0].trim_matches('`'))).collect()
}

/// The document with these lines: existing ones are replaced, others follow the one before.
pub fn written(document: &str, lines: &[Line]) -> String {
    let mut out: Vec<String> = document.lines().map(str::to_owned).collect();
    let mut last = 0;
    for line in lines {
        let table = table(&out, line);
        let there = table.clone().find(|&at| out[at].starts_with(&line.start()));
        last = match there {
            Some(at) => {
                out[at] = line.text();
                at
            }
            None => {
                let at = if table.contains(&last) { last + 1 } else { table.end };
                out.insert(at, line.text());
                at
            }
        };
    }
    out.join("\n") + "\n"
}

/// Numbers of the lines of the table in which `line` belongs, without its head.
fn table(lines: &[String], line: &Line) -> std::ops::Range<usize> {
    let named = match line.section {
        "" => "Quantities and units".to_owned(),
        section => format!("[{section}]"),
    };
    let section = lines.iter().position(|l| l.starts_with('#') && l.contains(&named));
    let section = section.unwrap_or_else(|| panic!("no heading {named}"));
    let head = format!("| {} |", line.head);
    let table = lines[section..].iter().position(|l| l.starts_with(&head));
    let start = section + table.unwrap_or_else(|| panic!("no table {head}")) + 2;
    let length = lines[start..].iter().position(|l| !l.starts_with('|'));
    start..start + length.unwrap_or(lines.len() - start)
}
