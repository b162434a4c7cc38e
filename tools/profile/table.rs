//! Results as a readable table, CSV, JSON and plots.

use std::path::Path;

use insonify::output;
use insonify::output::plot::{Plot, svg};
use miette::{Context, IntoDiagnostic, Result};
use serde_json::Value;

/// Rows under headings that include their units.
pub struct Table {
    pub title: String,
    pub headings: Vec<&'static str>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(title: impl Into<String>, headings: &[&'static str]) -> Self {
        Self { title: title.into(), headings: headings.to_vec(), rows: Vec::new() }
    }

    pub fn add(&mut self, row: Vec<String>) {
        assert_eq!(row.len(), self.headings.len(), "one value per heading");
        self.rows.push(row);
    }

    /// Prints it as Markdown, aligned.
    pub fn print(&self) {
        let cell = |row: &[String], i: usize| row[i].chars().count();
        let widths: Vec<usize> = (0..self.headings.len())
            .map(|i| {
                let widest = self.rows.iter().map(|r| cell(r, i)).max().unwrap_or(0);
                widest.max(self.headings[i].chars().count())
            })
            .collect();
        let line = |cells: Vec<&str>| {
            let padded = cells.iter().zip(&widths).map(|(c, w)| format!(" {c:<w$} |"));
            format!("|{}", padded.collect::<String>())
        };
        output::line(format_args!("\n{}\n", self.title));
        output::line(line(self.headings.clone()));
        output::line(line(vec!["---"; widths.len()]));
        for row in &self.rows {
            output::line(line(row.iter().map(String::as_str).collect()));
        }
    }

    /// Writes `NAME.csv`; no value holds a comma or a quote.
    pub fn csv(&self, dir: &Path, name: &str) -> Result<()> {
        let mut text = self.headings.join(",") + "\n";
        for row in &self.rows {
            text += &(row.join(",") + "\n");
        }
        write(dir, &format!("{name}.csv"), &text)
    }
}

/// Milliseconds with three significant digits.
pub fn ms(value: f64) -> String {
    match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        v if v >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

pub fn write_json(dir: &Path, name: &str, value: &Value) -> Result<()> {
    let text = serde_json::to_string_pretty(value).into_diagnostic()? + "\n";
    write(dir, &format!("{name}.json"), &text)
}

pub fn write_plot(dir: &Path, name: &str, plot: &Plot) -> Result<()> {
    write(dir, &format!("{name}.svg"), &svg(plot))
}

fn write(dir: &Path, name: &str, text: &str) -> Result<()> {
    let path = dir.join(name);
    std::fs::create_dir_all(dir)
        .and_then(|()| std::fs::write(&path, text))
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", path.display()))?;
    output::line(path.display());
    Ok(())
}
