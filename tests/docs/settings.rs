//! The text lines of `docs/scenes.md` that follow from the program: a row of a table for each key, the units, and
//! the parameters of `insonify vary`. `INSONIFY_BLESS=1 cargo test --test cpu docs` writes them.

use insonify::scene::file::{Key, reference};
use insonify::scene::tissue::table;
use insonify::scene::vary::Parameter;
use insonify::settings::units::MEASURES;
use insonify::settings::{Facts, Form, Group, Probe, Tissue, plain};

/// A line of a table: the section's heading, the first word of the table's head, and the cells.
#[derive(Debug, PartialEq)]
pub struct Line {
    section: String,
    head: &'static str,
    cells: Vec<String>,
}

impl Line {
    fn new(section: &str, head: &'static str, cells: &[&str]) -> Self {
        let cells = cells.iter().map(|cell| (*cell).to_owned()).collect();
        Self { section: section.to_owned(), head, cells }
    }

    /// The table in which it stands: its section, and the first word of its head.
    pub fn table(&self) -> (String, &'static str) {
        (self.section.clone(), self.head)
    }

    fn text(&self) -> String {
        let cell =
            |cell: &String| if cell.is_empty() { " |".to_owned() } else { format!(" {cell} |") };
        format!("|{}", self.cells.iter().map(cell).collect::<String>())
    }
}

/// The reference's word for what a key takes.
fn type_of(facts: &Facts) -> String {
    match facts.form {
        Form::Number => "number".to_owned(),
        Form::Quantity(measure) => measure.name.to_owned(),
        Form::Whole => "integer".to_owned(),
        Form::Switch => "true or false".to_owned(),
        Form::Words(_) => "one of".to_owned(),
        Form::Numbers(count) => format!("{count} numbers"),
        Form::Quantities(measure, count) => format!("{count} {}s", measure.name),
        Form::Integer => "integer".to_owned(),
        Form::Direction => "3 numbers".to_owned(),
        Form::Factors => "number or 3 numbers".to_owned(),
        Form::Text => "text".to_owned(),
        Form::Texts => "list of texts".to_owned(),
        Form::OneOrSeveral => "text or list of texts".to_owned(),
        Form::TextOrTrue => "text or true".to_owned(),
        Form::Several(_) => match facts.counts {
            Some([least, most]) => format!("{least} to {most} numbers"),
            None => "list".to_owned(),
        },
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
        (_, Form::Direction, _) => "not zero".to_owned(),
        (.., [f64::NEG_INFINITY, f64::INFINITY]) => String::new(),
        (.., [least, f64::INFINITY]) => format!("at least {least}{unit}"),
        (.., [least, most]) => format!("{least} to {most}{unit}"),
    }
}

/// A line for each key. A table in a table has a heading of its own, or its keys are those of the outer one.
fn keys(document: &str) -> Vec<Line> {
    let mut out = Vec::new();
    for (table, keys) in reference() {
        for Key { path, facts, default, .. } in keys {
            let mut place = (table.to_owned(), path.as_str());
            if let Some((inner, key)) = path.split_once('.')
                && heading(document, &format!("{table}.{inner}")).is_some()
            {
                place = (format!("{table}.{inner}"), key);
            }
            let (section, key) = place;
            let default = match (facts.required, key.rsplit_once('.')) {
                (true, Some((inner, _))) => format!("required in `{inner}`"),
                _ => default,
            };
            let key = format!("`{key}`");
            let cells = [&key, &type_of(facts), &default, &range_of(facts), facts.meaning()];
            out.push(Line::new(&section, "Key", &cells));
        }
    }
    out
}

/// Every line that the program knows of this document, by tables.
pub fn lines(document: &str) -> Vec<Line> {
    let mut out = keys(document);
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

/// The document with these lines for those of its tables.
pub fn written(document: &str, lines: &[Line]) -> String {
    let mut out: Vec<String> = document.lines().map(str::to_owned).collect();
    for table in lines.chunk_by(|a, b| a.table() == b.table()) {
        let text = out.join("\n");
        out.splice(place(&text, &table[0]), table.iter().map(Line::text));
    }
    out.join("\n") + "\n"
}

/// Number of the line with the heading of a section.
fn heading(document: &str, section: &str) -> Option<usize> {
    let named = format!("[{section}]");
    document.lines().position(|line| line.starts_with('#') && line.contains(&named))
}

/// Numbers of the lines of the table in which `line` belongs, without its head.
fn place(document: &str, line: &Line) -> std::ops::Range<usize> {
    let section = match line.section.as_str() {
        "" => Some(0),
        section => heading(document, section),
    };
    let section = section.unwrap_or_else(|| panic!("no heading {}", line.section));
    let head = format!("| {} |", line.head);
    let mut below = document.lines().skip(section);
    let table = below.position(|l| l.starts_with(&head));
    let start = section + table.unwrap_or_else(|| panic!("no table {head}")) + 2;
    let length = document.lines().skip(start).take_while(|l| l.starts_with('|')).count();
    start..start + length
}
