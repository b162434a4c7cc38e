//! Results as tables: for a terminal, as Markdown, as CSV.

use std::fmt::Write as _;

use super::{Results, ResultsPart};

/// Content of a table's cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// A count.
    Count(usize),
    /// A mean, a median or a statistic; NaN where there is none.
    Number(f64),
    /// A probability.
    Probability(f64),
}

impl Cell {
    /// Rounded text, for readers.
    fn shown(self) -> String {
        match self {
            Self::Count(n) => n.to_string(),
            Self::Number(x) | Self::Probability(x) if x.is_nan() => "-".to_owned(),
            Self::Number(x) => format!("{x:.2}"),
            Self::Probability(p) if p < 1e-4 => format!("{p:.1e}"),
            Self::Probability(p) => format!("{p:.4}"),
        }
    }

    /// Text with all digits, for programs; empty where there is no number.
    fn exact(self) -> String {
        match self {
            Self::Count(n) => n.to_string(),
            Self::Number(x) | Self::Probability(x) if x.is_nan() => String::new(),
            Self::Number(x) | Self::Probability(x) => x.to_string(),
        }
    }
}

/// One table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Title.
    pub title: String,
    /// Headings of the values.
    pub head: Vec<String>,
    /// Rows: scenario, item, values.
    pub rows: Vec<([String; 2], Vec<Cell>)>,
    /// Note for the reader.
    pub note: String,
}

const ALL: &str = "all scenarios";

impl Results {
    /// The tables in reading order.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = vec![self.agreement(), self.chosen_images()];
        if self.parts.iter().any(|p| p.rated.len() > 1) {
            tables.insert(0, self.ranks());
            tables.extend([self.concordance(), self.pairs()]);
        }
        tables
    }

    /// One row per background of each part.
    fn by_background(
        &self,
        values: impl Fn(&super::BackgroundRatings) -> Vec<Cell>,
    ) -> Vec<([String; 2], Vec<Cell>)> {
        let rows = |part: &ResultsPart| {
            let scenario = part.scenario.clone().unwrap_or_else(|| ALL.to_owned());
            let row = |rated: &super::BackgroundRatings| {
                let names = [scenario.clone(), rated.background.clone()];
                (names, values(rated))
            };
            part.rated.iter().map(row).collect::<Vec<_>>()
        };
        self.parts.iter().flat_map(rows).collect()
    }

    fn ranks(&self) -> Table {
        let count = self.parts[0].rated.len();
        let numbered = (1..=count).map(|rank| format!("rank {rank}"));
        Table {
            title: "Order of the backgrounds".to_owned(),
            head: numbered.chain(["mean rank".to_owned()]).collect(),
            rows: self.by_background(|rated| {
                let counts = rated.ranks.iter().map(|&n| Cell::Count(n));
                counts.chain([Cell::Number(rated.mean_rank())]).collect()
            }),
            note: "Complete rankings of the images chosen before each background; 1 is the most \
                   realistic."
                .to_owned(),
        }
    }

    fn agreement(&self) -> Table {
        let numbered = (1..=super::DEGREES).map(|degree| format!("degree {degree}"));
        Table {
            title: "Agreement that the chosen image is sufficiently realistic".to_owned(),
            head: numbered.chain(["median".to_owned()]).collect(),
            rows: self.by_background(|rated| {
                let counts = rated.agreement.iter().map(|&n| Cell::Count(n));
                counts.chain([Cell::Number(rated.median_agreement())]).collect()
            }),
            note: "1 is the least agreement, 5 the most (Likert 1932).".to_owned(),
        }
    }

    fn chosen_images(&self) -> Table {
        let row = |name: &str, [below, at, above]: [usize; 3]| {
            let counts = [below, at, above, below + at + above].map(Cell::Count);
            ([String::new(), name.to_owned()], counts.to_vec())
        };
        let each = self.chosen.iter().map(|c| row(&c.parameter, c.counts));
        let plain = row("none changed", [0, self.unperturbed, 0]);
        Table {
            title: "Chosen images, by the parameter that was changed".to_owned(),
            head: ["below", "as it is", "above", "chosen"].map(str::to_owned).to_vec(),
            rows: [plain].into_iter().chain(each).collect(),
            note: format!(
                "Images chosen: {}, of them with no parameter changed: {}; by lot it would be {:.1}.",
                self.choices, self.unperturbed, self.by_chance
            ),
        }
    }

    fn concordance(&self) -> Table {
        let [scenarios, slices] = self.places;
        let caution = match self.assessors {
            1 => format!(
                "One assessor: the blocks are slices (there are {slices}, scenarios: {scenarios}), \
                 all ordered by the same person. p says whether this person orders the backgrounds \
                 alike from slice to slice; it says nothing of other people."
            ),
            n => format!(
                "The blocks are slices (there are {slices}, scenarios: {scenarios}), once for each \
                 of {n} assessors. The test takes blocks as independent; those of one person, and \
                 those of one slice, are less so, and p is then too small."
            ),
        };
        let kind = match self.friedman {
            Some(f) if !f.exact => "from chi-squared",
            _ => "exact",
        };
        let row = |f: super::Friedman| {
            let values = vec![
                Cell::Count(f.blocks),
                Cell::Number(f.statistic),
                Cell::Probability(f.p),
                Cell::Number(f.concordance),
            ];
            ([String::new(), "backgrounds".to_owned()], values)
        };
        Table {
            title: "Friedman's test".to_owned(),
            head: ["blocks", "statistic", "p", "Kendall's W"].map(str::to_owned).to_vec(),
            rows: self.friedman.into_iter().map(row).collect(),
            note: format!(
                "p {kind} (Friedman 1937); W is 1 where all blocks agree (Kendall and Babington \
                 Smith 1939). {caution}"
            ),
        }
    }

    fn pairs(&self) -> Table {
        let row = |pair: &super::BackgroundPair| {
            let [a, b] = &pair.backgrounds;
            let values = vec![
                Cell::Count(pair.before[0]),
                Cell::Count(pair.before[1]),
                Cell::Probability(pair.p),
                Cell::Probability(pair.corrected),
            ];
            ([String::new(), format!("{a}, {b}")], values)
        };
        Table {
            title: "Backgrounds in pairs".to_owned(),
            head: ["first before", "second before", "p", "p corrected"].map(str::to_owned).to_vec(),
            rows: self.pairs.iter().map(row).collect(),
            note: "Exact two-sided sign test (Dixon and Mood 1946), corrected for the number of pairs \
                   after Holm 1979."
                .to_owned(),
        }
    }

    /// Text above the tables.
    fn heading(&self) -> String {
        let mut out = format!("Study {}. Filled forms: {}.", self.study, self.assessors);
        for (file, [cases, degrees, rankings]) in &self.missing {
            if cases + degrees + rankings > 0 {
                let file = file.display();
                let _ = write!(
                    out,
                    " {file} is not complete (cases without an image: {cases}, images without a \
                     degree of agreement: {degrees}, rankings without all ranks: {rankings}); what \
                     it holds is counted."
                );
            }
        }
        out
    }
}

/// The tables for a terminal, with aligned columns.
pub fn plain(results: &Results) -> String {
    let mut out = format!("{}\n", results.heading());
    for table in results.tables() {
        let grid = grid(&table);
        let wide = |column: usize| grid.iter().map(|row| row[column].chars().count()).max();
        let widths: Vec<usize> = (0..grid[0].len()).map(|c| wide(c).unwrap_or(0)).collect();
        let _ = writeln!(out, "\n{}", table.title);
        for row in &grid {
            let cells = row.iter().zip(&widths).enumerate();
            let cells =
                cells.map(|(i, (cell, &width))| match i < grid[0].len() - table.head.len() {
                    true => format!("{cell:<width$}"),
                    false => format!("{cell:>width$}"),
                });
            let line = cells.collect::<Vec<_>>().join("  ");
            let _ = writeln!(out, "  {}", line.trim_end());
        }
        let _ = writeln!(out, "{}", table.note);
    }
    out
}

/// The tables as Markdown.
pub fn markdown(results: &Results) -> String {
    let escape = |text: &str| text.replace('\\', "\\\\").replace('|', "\\|").replace('\n', " ");
    let mut out = format!("# Results of a study\n{}\n", escape(&results.heading()));
    for table in results.tables() {
        let grid = grid(&table);
        let _ = writeln!(out, "\n## {}", table.title);
        for (i, row) in grid.iter().enumerate() {
            let cells: Vec<String> = row.iter().map(|c| escape(c)).collect();
            let _ = writeln!(out, "| {} |", cells.join(" | "));
            if i == 0 {
                let names = row.len() - table.head.len();
                let line = "---|".repeat(names) + &"--:|".repeat(table.head.len());
                let _ = writeln!(out, "|{line}");
            }
        }
        let _ = writeln!(out, "\n{}", table.note);
    }
    out
}

/// The tables as CSV: one row per value, with all its digits.
pub fn csv(results: &Results) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |record: [&str; 5]| {
        writer.write_record(record).expect("into memory");
    };
    write(["table", "scenario", "item", "quantity", "value"]);
    for table in results.tables() {
        for ([scenario, item], values) in &table.rows {
            for (quantity, value) in table.head.iter().zip(values) {
                write([&table.title, scenario, item, quantity, &value.exact()]);
            }
        }
    }
    let bytes = writer.into_inner().expect("into memory");
    String::from_utf8(bytes).expect("made of text")
}

/// Heading and rows as texts; without the column of scenarios where none is named.
fn grid(table: &Table) -> Vec<Vec<String>> {
    let named = table.rows.iter().any(|(names, _)| !names[0].is_empty());
    let first = if named { 0 } else { 1 };
    let head = ["scenario", ""].map(str::to_owned);
    let head = head[first..].iter().chain(&table.head).cloned().collect();
    let row = |(names, values): &([String; 2], Vec<Cell>)| {
        let values = values.iter().map(|v| v.shown());
        names[first..].iter().cloned().chain(values).collect()
    };
    [head].into_iter().chain(table.rows.iter().map(row)).collect()
}
